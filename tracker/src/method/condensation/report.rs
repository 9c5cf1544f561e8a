//! Estimates of the tracked heads, and of the bodies below them.

use super::Condensation;
use super::track::HeadTrack;
use crate::PersonEstimate;
use crate::silhouette::Body;
use crate::silhouette::visibility::visible_fractions;

/// Radius of the body below a head, metres: half of the shoulders' width.
const BODY_RADIUS_M: f64 = 0.25;

impl Condensation {
    pub(super) fn report(&self) -> Vec<PersonEstimate> {
        let half_height_m = self.options.head.half_height_m;
        let reported = || {
            let inside = |t: &&HeadTrack| t.id.is_some() && self.room.floor.is_inside(t.head().x, t.head().y);
            self.tracks.iter().filter(inside)
        };
        let bodies: Vec<Body> = reported()
            .map(|t| {
                let head = t.head();
                Body { x_m: head.x, y_m: head.y, radius_m: BODY_RADIUS_M, height_m: head.z + half_height_m }
            })
            .collect();
        let visible = visible_fractions(&self.views, &bodies);
        let people = reported().zip(&bodies).zip(visible);
        let mut people: Vec<PersonEstimate> = people
            .filter_map(|((track, body), visible)| {
                let covariance = &track.gaussian.covariance;
                Some(PersonEstimate {
                    id: track.id?,
                    x_m: body.x_m,
                    y_m: body.y_m,
                    z_m: track.head().z,
                    radius_m: body.radius_m,
                    height_m: body.height_m,
                    vx: track.velocity.x,
                    vy: track.velocity.y,
                    sigma_m: [covariance[(0, 0)].sqrt(), covariance[(1, 1)].sqrt()],
                    confidence: (-track.unseen_s / self.options.life.trusted_in_s).exp(),
                    visible,
                })
            })
            .collect();
        people.sort_by_key(|p| p.id);
        people
    }
}
