//! One track at one moment, and the estimate reported for it.

use super::motion::{Belief, Motion};
use super::person::Key;
use super::traits::{LearntTraits, ShownTraits};
use crate::{PersonEstimate, TrackId};

/// Standard deviation of the silhouette's slowly varying offset from the person's position, metres: posture and the
/// visible side shift the silhouette for seconds at a time, so averaging over moments does not reduce it.
pub(super) const LASTING_SIGMA_M: f64 = 0.035;

/// Snapshot of a track, confirmed or not, at one moment.
#[derive(Debug, Clone)]
pub(super) struct Trace {
    pub(super) key: Key,
    pub(super) id: Option<TrackId>,
    pub(super) motion: Motion,
    pub(super) radius_m: f64,
    pub(super) height_m: f64,
    pub(super) confidence: f64,
    pub(super) visible: Vec<f64>,
    /// Traits that this moment's boxes showed.
    pub(super) shown: ShownTraits,
    /// Average of these traits up to this moment.
    pub(super) learnt: LearntTraits,
}

impl Trace {
    /// Estimate to report, with this belief about position and velocity.
    pub(super) fn estimate(&self, id: TrackId, belief: &Belief) -> PersonEstimate {
        let (place, velocity, covariance) = (belief.place(), belief.velocity(), belief.place_covariance());
        let sigma_m = |axis| covariance[(axis, axis)].sqrt().hypot(LASTING_SIGMA_M);
        PersonEstimate {
            id,
            x_m: place.x,
            y_m: place.y,
            z_m: 0.0,
            radius_m: self.radius_m,
            height_m: self.height_m,
            vx: velocity.x,
            vy: velocity.y,
            sigma_m: [sigma_m(0), sigma_m(1)],
            confidence: self.confidence,
            visible: self.visible.clone(),
        }
    }
}
