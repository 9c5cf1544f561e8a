//! What a moment's masks say about whether a person is there at all.

use crate::likelihood::{Layers, Simulation};
use crate::silhouette::Silhouette;

/// One moment's masks err together: they are worth no more than this about whether somebody is there.
const MOST_EVIDENCE_NATS: f64 = 4.0;
/// A detector's cameras err each for itself: together they may show within a moment that nobody is there.
const MOST_AGAINST_BY_BOXES_NATS: f64 = 15.0;
/// Somebody in clear view of a camera fills at least this part of their silhouette with foreground: the worst masks of
/// real people fill half, the best of nobody's a quarter.
const LEAST_FILLED: f64 = 0.35;
/// A camera sees a body clearly when at least this part of it is in sight, and this many of the camera's pixels.
const CLEAR: f64 = 0.5;
const CLEAR_PX: u32 = 100;

/// What a moment says about whether a person is there at all.
#[derive(Debug, Clone, Copy)]
pub(super) struct Evidence {
    /// How much better the masks are explained with this person than without.
    pub(super) support_nats: f64,
    /// How much of that chance could have done.
    pub(super) chance_nats: f64,
    /// The foreground part of the visible core, in the camera where it is smallest of those that see this person clearly;
    /// `None` when none does.
    pub(super) worst_filled: Option<f64>,
    /// Whether the cameras show an average person there, and not furniture.
    pub(super) is_upright: bool,
    /// Whether a camera sees any of the body.
    pub(super) in_sight: bool,
    /// Whether all this is a detector's: misses and false boxes are then weighed as often as they happen.
    pub(super) is_by_boxes: bool,
}

impl Evidence {
    /// How much more likely all this is with somebody there than without, in nats.
    pub(super) fn for_presence(&self) -> f64 {
        self.bounded(self.support_nats)
    }

    /// How much of that is beyond what chance explains, in nats: what a newcomer has to earn.
    pub(super) fn beyond_chance(&self) -> f64 {
        self.bounded(self.support_nats - self.chance_nats)
    }

    fn bounded(&self, nats: f64) -> f64 {
        if self.is_by_boxes {
            return nats.clamp(-MOST_AGAINST_BY_BOXES_NATS, MOST_EVIDENCE_NATS);
        }
        let nats = if self.is_contradicted() { -MOST_EVIDENCE_NATS } else { nats };
        // Limbs that reach beyond what hides a body may as well be held close to it.
        let least = if self.in_sight { -MOST_EVIDENCE_NATS } else { 0.0 };
        nats.clamp(least, MOST_EVIDENCE_NATS)
    }

    /// Whether all this is less likely with somebody there than without.
    pub(super) fn is_against(&self) -> bool {
        self.for_presence() < 0.0
    }

    /// Whether a camera that should see this person clearly does not.
    fn is_contradicted(&self) -> bool {
        self.worst_filled.is_some_and(|part| part < LEAST_FILLED)
    }
}

/// Of the cameras that see a body clearly, the smallest foreground part of its core; `None` when none does.
pub(super) fn worst_filled(
    simulation: &Simulation,
    layers: &Layers,
    silhouettes: &[Silhouette],
) -> Option<f64> {
    silhouettes
        .iter()
        .enumerate()
        .filter(|(layer, _)| simulation.in_use(*layer) && layers.shape(*layer) == 0)
        .filter(|(layer, s)| {
            s.visible_px * u32::from(layers.views()[layers.camera(*layer)].block).pow(2) > CLEAR_PX
        })
        .filter(|(_, s)| f64::from(s.visible_px) >= CLEAR * f64::from(s.area_px))
        .map(|(camera, s)| f64::from(simulation.foreground_under(camera, s)) / f64::from(s.visible_px))
        .reduce(f64::min)
}
