//! Somebody at one moment, and what is told of them.

use super::motion::{Belief, Motion};
use super::person::Key;
use crate::{PersonEstimate, TrackId};

/// How somebody holds themselves, and which side of them the cameras see, puts the middle of their silhouette off by this
/// much for seconds at a time, in metres (one standard deviation): no number of moments averages that out.
pub(super) const LASTING_SIGMA_M: f64 = 0.035;

/// Somebody at one moment, believed in or not yet.
#[derive(Debug, Clone)]
pub(super) struct Trace {
    pub(super) key: Key,
    pub(super) id: Option<TrackId>,
    pub(super) motion: Motion,
    pub(super) radius_m: f64,
    pub(super) height_m: f64,
    pub(super) confidence: f64,
    pub(super) visible: Vec<f64>,
}

impl Trace {
    /// What is told of them, with this belief about where they are.
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
