//! Interface for fusing several trackers: measurements of a moment going out, fused beliefs coming back. The fused
//! belief is the prior of the next moment; a measurement holds only the information beyond its prior, so no
//! information is counted twice.

use nalgebra::{Matrix2, Matrix4, Point2, Vector2, Vector4};

use super::Mcmc;
use super::motion::Belief;
use super::trace::LASTING_SIGMA_M;
use crate::TrackId;
use crate::silhouette::Body;

/// Least standard deviation of a fused place, metres, because the errors of several trackers may be correlated.
const LEAST_KNOWN_M: f64 = 0.15;

/// Measurement of one person by one moment, without the prior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Identity of the person.
    pub id: TrackId,
    /// Place on the floor, metres.
    pub place: Point2<f64>,
    /// Covariance of the place, m². Errors that last for seconds are not included, except the silhouette's own.
    pub covariance: Matrix2<f64>,
    /// Most probable body of the person.
    pub body: Body,
}

impl Mcmc {
    /// Measurements at the last moment of the confirmed people inside the room; people of whom it held no information
    /// are left out.
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

    /// Allows births near these places (metres) at the next moment, where the masks show a person whom no track
    /// explains: other trackers see people there.
    pub fn expect(&mut self, places: impl IntoIterator<Item = Point2<f64>>) {
        self.expected_at.clear();
        self.expected_at.extend(places.into_iter().map(|place| Vector2::new(place.x, place.y)));
    }

    /// Replaces the beliefs of confirmed people by these: place (m) and velocity (m/s) with their covariance. The
    /// track of a person who is not listed and was not measured at the last moment ends.
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

    /// Ends the tracks of these people, who turned out not to exist.
    pub fn end(&mut self, people: &[TrackId]) {
        self.tracks.retain(|track| !track.id.is_some_and(|id| people.contains(&id)));
    }
}
