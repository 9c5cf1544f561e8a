//! What is told of the people who are believed in.

use super::Mcmc;
use super::track::Track;
use crate::PersonEstimate;
use crate::silhouette::Body;
use crate::silhouette::visibility::visible_fractions;

impl Mcmc {
    pub(super) fn report(&self) -> Vec<PersonEstimate> {
        let bodies: Vec<Body> = self.tracks.iter().map(Track::body).collect();
        let visible = visible_fractions(&self.views, &bodies);
        let mut people: Vec<PersonEstimate> = self
            .tracks
            .iter()
            .zip(visible)
            .filter_map(|(track, visible)| {
                let motion = &track.motion;
                let (place, velocity, covariance) =
                    (motion.place(), motion.velocity(), motion.place_covariance());
                // On a doorstep nobody is in the room.
                if !self.stage.floor.is_inside(place.x, place.y) {
                    return None;
                }
                Some(PersonEstimate {
                    id: track.id?,
                    x_m: place.x,
                    y_m: place.y,
                    z_m: 0.0,
                    radius_m: track.radius.mean_m,
                    height_m: track.height.mean_m,
                    vx: velocity.x,
                    vy: velocity.y,
                    sigma_m: [covariance[(0, 0)].sqrt(), covariance[(1, 1)].sqrt()],
                    confidence: track.existence(),
                    visible,
                })
            })
            .collect();
        people.sort_by_key(|p| p.id);
        people
    }
}
