//! For those who bring together what several trackers see: what one moment alone showed of everybody, and what they
//! make of it. Their knowledge is the prior of the next moment; as a measurement is what a moment says beyond its prior,
//! nothing comes back twice.

use nalgebra::{Matrix2, Matrix4, Point2, Vector2, Vector4};

use super::Mcmc;
use super::motion::Belief;
use super::trace::LASTING_SIGMA_M;
use crate::TrackId;
use crate::silhouette::Body;

/// Nobody's place is known better from others than this, metres: what they say may be wrong together.
const LEAST_KNOWN_M: f64 = 0.15;

/// Measurement of one person at one moment, without what was believed before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// The person.
    pub id: TrackId,
    /// Place on the floor, metres.
    pub place: Point2<f64>,
    /// Covariance of the place, m². Errors that last for seconds are not in it, but for the silhouette's own.
    pub covariance: Matrix2<f64>,
    /// The person's body where it is believed to be.
    pub body: Body,
}

impl Mcmc {
    /// Measurements of the people who are believed in and inside the room, at the last moment; nobody of whom it
    /// showed nothing.
    pub fn measured(&self) -> Vec<Measured> {
        let measured = self.tracks.iter().filter_map(|track| {
            let (id, measured, body) = (track.id?, track.motion.measured?, track.body());
            let place = Point2::from(measured.place);
            let covariance = measured.covariance + Matrix2::from_diagonal_element(LASTING_SIGMA_M.powi(2));
            let inside = self.stage.floor.is_inside(body.x_m, body.y_m);
            inside.then_some(Measured { id, place, covariance, body })
        });
        let mut people: Vec<Measured> = measured.collect();
        people.sort_by_key(|person| person.id);
        people
    }

    /// Lets people appear near these places at the next moment, where the masks show somebody whom nobody explains: others
    /// see them there.
    pub fn expect(&mut self, places: impl IntoIterator<Item = Point2<f64>>) {
        self.expected_at.clear();
        self.expected_at.extend(places.into_iter().map(|place| Vector2::new(place.x, place.y)));
    }

    /// Takes over what is known of the people who are believed in, place and velocity with their covariance. Whoever is
    /// not among these and was not seen at the last moment is followed no more.
    pub fn follow(&mut self, known: &[(TrackId, Vector4<f64>, Matrix4<f64>)]) {
        self.tracks.retain_mut(|track| {
            let Some(id) = track.id else { return true };
            let Some((_, mean, covariance)) = known.iter().find(|(known, ..)| *known == id) else {
                return track.motion.measured.is_some();
            };
            let mut covariance = *covariance;
            for axis in 0..2 {
                covariance[(axis, axis)] += LEAST_KNOWN_M.powi(2);
            }
            track.motion.belief = Belief { mean: *mean, covariance };
            true
        });
    }

    /// Follows these people no more: they are nobody.
    pub fn end(&mut self, people: &[TrackId]) {
        self.tracks.retain(|track| !track.id.is_some_and(|id| people.contains(&id)));
    }
}
