//! Evidence of one moment for the existence of a person.

use crate::likelihood::{Layers, Simulation};
use crate::silhouette::Silhouette;

/// Bound of one moment's evidence by masks, nats, because the errors of masks are correlated.
const MOST_EVIDENCE_NATS: f64 = 4.0;
/// Bound of one moment's evidence by boxes against a person, nats; the cameras' errors are independent, so it is
/// wider.
const MOST_AGAINST_BY_BOXES_NATS: f64 = 15.0;
/// Least foreground fraction of a person's silhouette in clear view of a camera: the worst masks of real people fill
/// half, the best masks without a person a quarter.
const LEAST_FILLED: f64 = 0.35;
/// A camera sees a body clearly when at least this fraction of it is in sight, and more than this many pixels of the
/// full image.
const CLEAR: f64 = 0.5;
const CLEAR_PX: u32 = 100;

/// Evidence of one moment for the existence of one person.
#[derive(Debug, Clone, Copy)]
pub(super) struct Evidence {
    /// Log-likelihood ratio of the observations with and without the person, nats.
    pub(super) support_nats: f64,
    /// Part of the ratio that chance explains, nats.
    pub(super) chance_nats: f64,
    /// Smallest foreground fraction of the visible core, over the cameras that see the person clearly; `None` when
    /// none does.
    pub(super) worst_filled: Option<f64>,
    /// Whether the cameras show an average person there rather than furniture.
    pub(super) is_upright: bool,
    /// Whether a camera sees any of the body.
    pub(super) in_sight: bool,
    /// Whether a detector's boxes are the only observations; their likelihood already models missed detections and
    /// false boxes.
    pub(super) is_by_boxes: bool,
}

impl Evidence {
    /// Bounded log-likelihood ratio for existence, nats.
    pub(super) fn for_presence(&self) -> f64 {
        self.bounded(self.support_nats)
    }

    /// Bounded log-likelihood ratio beyond what chance explains, nats: a new track is confirmed by its sum.
    pub(super) fn beyond_chance(&self) -> f64 {
        self.bounded(self.support_nats - self.chance_nats)
    }

    fn bounded(&self, nats: f64) -> f64 {
        if self.is_by_boxes {
            return nats.clamp(-MOST_AGAINST_BY_BOXES_NATS, MOST_EVIDENCE_NATS);
        }
        let nats = if self.is_contradicted() { -MOST_EVIDENCE_NATS } else { nats };
        // Arms that would reach beyond the occluder may be held close to the body, so their absence is no evidence.
        let least = if self.in_sight { -MOST_EVIDENCE_NATS } else { 0.0 };
        nats.clamp(least, MOST_EVIDENCE_NATS)
    }

    /// Whether the evidence is against existence.
    pub(super) fn is_against(&self) -> bool {
        self.for_presence() < 0.0
    }

    /// Whether a camera with a clear view does not show the person.
    fn is_contradicted(&self) -> bool {
        self.worst_filled.is_some_and(|part| part < LEAST_FILLED)
    }
}

/// Smallest foreground fraction of the body's core over the cameras that see it clearly; `None` when none does.
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
