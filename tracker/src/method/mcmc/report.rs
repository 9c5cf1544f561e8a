//! What is told of the people who are believed in.

use super::Mcmc;
use super::motion::{Belief, Motion};
use super::person::Key;
use super::track::Track;
use crate::silhouette::Body;
use crate::silhouette::visibility::visible_fractions;
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

impl Mcmc {
    /// Everybody who is followed.
    pub(super) fn traces(&self) -> Vec<Trace> {
        let bodies: Vec<Body> = self.tracks.iter().map(Track::body).collect();
        let visible = visible_fractions(&self.views, &bodies);
        let trace = |(track, visible): (&Track, Vec<f64>)| Trace {
            key: track.key,
            id: track.id,
            motion: track.motion.clone(),
            radius_m: track.radius.mean_m,
            height_m: track.height.mean_m,
            confidence: track.existence(),
            visible,
        };
        self.tracks.iter().zip(visible).map(trace).collect()
    }

    /// Of people who are believed in, those in the room: on a doorstep nobody is.
    pub(super) fn in_the_room(&self, mut people: Vec<PersonEstimate>) -> Vec<PersonEstimate> {
        people.retain(|person| self.stage.floor.is_inside(person.x_m, person.y_m));
        people.sort_by_key(|person| person.id);
        people
    }
}
