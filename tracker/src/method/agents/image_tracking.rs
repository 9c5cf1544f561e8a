//! Image tracking of one station: from its foreground mask, or a detector's boxes, to sightings, in metres on the floor (Nakazawa et al.,
//! section 3.1).
//!
//! The paper fits an upright ellipsoid to the mask of each person. Here the ellipsoids of all people in the image are
//! fitted together, their number included, by the trans-dimensional sampler ([`crate::method::mcmc`]) with this camera
//! alone. A sighting is the measurement of the current moment and not the filtered state, so that stations do not count
//! the same information twice.

use nalgebra::{Matrix2, Point2};

use super::{Followed, Looks, Restart, Sighting, Sightings};
use crate::method::Method;
use crate::method::mcmc::{Mcmc, McmcOptions, Measured};
use crate::prepared_room::{PreparedRoom, resolution};
use crate::silhouette::visibility::{fraction, visible_parts};
use crate::silhouette::{Body, Silhouette, View};
use crate::{CameraFrame, Moment, Result, TrackId};

/// Distance on the floor below which two people's measurements may be swapped, metres.
const CROWDED_M: f64 = 0.9;
/// Occluded fraction of a person above which the person's measurement may be of the occluder.
const COVERED: f64 = 0.1;
/// Standard deviation of range errors that last for seconds, metres: a stride, a bent back or hidden legs look like a
/// nearer or farther person.
const RANGE_SIGMA_M: f64 = 0.25;
/// Visible fraction of a person from which colours are measured.
const LEAST_VISIBLE: f64 = 0.6;

/// Image tracking of one camera.
#[derive(Debug, Clone)]
pub struct ImageTracking {
    sampler: Mcmc,
    /// The camera at the sampler's resolution.
    view: View,
}

impl ImageTracking {
    /// Prepares the tracking of one camera of a room.
    ///
    /// # Errors
    /// [`crate::Error::Option`] for an option that is out of range.
    pub fn new(stage: &PreparedRoom, camera: usize, options: &McmcOptions) -> Result<Self> {
        let of_camera = &stage.cameras[camera];
        let average =
            Body { radius_m: options.radius.mean_m, height_m: options.height.mean_m, ..Body::ADULT };
        let view = View::coarse(of_camera, resolution::block(of_camera, &average, &stage.floor));
        let alone = PreparedRoom { cameras: vec![of_camera.clone()], ..stage.clone() };
        // Most people are out of one camera's sight: the station decides who has left.
        let options = McmcOptions { lag_s: 0.0, unseen_leaves_per_s: 0.0, ..options.clone() };
        Ok(Self { sampler: Mcmc::new(alone, options)?, view })
    }

    /// Measures the people in one frame; births are also proposed at the places of `restarts`.
    ///
    /// # Errors
    /// [`crate::Error::FrameSize`] for a mask that does not fit the camera.
    pub fn track(
        &mut self,
        frame: u32,
        time_s: f64,
        camera: &CameraFrame,
        restarts: &[Restart],
    ) -> Result<Sightings> {
        self.sampler.expect(restarts.iter().map(|restart| restart.position));
        let cameras = std::slice::from_ref(camera);
        self.sampler.step(&Moment { frame, time_s, cameras })?;
        let measured = self.sampler.measured();
        let bodies: Vec<Body> = measured.iter().map(|person| person.body).collect();
        let parts = visible_parts(&self.view, &bodies);
        let people = measured.iter().zip(&parts).map(|(person, part)| {
            let whole = Silhouette::new(&self.view, &person.body.ellipsoid());
            self.sighting(person, &bodies, &whole, part, camera)
        });
        Ok(Sightings {
            time_s,
            people: people.collect(),
            is_usable: camera.mask.is_some() || camera.boxes.is_some(),
        })
    }

    /// Uses the station's states of the tracked people as the prediction of the next frame. Image tracks without such a
    /// state end once they are out of sight.
    pub fn follow(&mut self, followed: &[Followed]) {
        let known = followed.iter().map(|f| (TrackId(f.track), f.mean, f.covariance));
        self.sampler.follow(&known.collect::<Vec<_>>());
    }

    /// Ends image tracks.
    pub fn end(&mut self, tracks: &[u32]) {
        self.sampler.end(&tracks.iter().copied().map(TrackId).collect::<Vec<_>>());
    }

    fn sighting(
        &self,
        person: &Measured,
        bodies: &[Body],
        whole: &Silhouette,
        part: &Silhouette,
        camera: &CameraFrame,
    ) -> Sighting {
        let near = |other: &&Body| person.body.floor_distance_m(other) < CROWDED_M;
        let covered = 1.0 - f64::from(part.visible_px) / f64::from(whole.visible_px.max(1));
        // The count includes the person.
        let is_crowded = bodies.iter().filter(near).count() > 1 || covered > COVERED;
        let is_seen = !is_crowded && fraction(part) >= LEAST_VISIBLE;
        let colours = camera.colours.as_ref().filter(|_| is_seen);
        Sighting {
            track: person.id.0,
            position: person.place,
            covariance: person.covariance + self.range_error(&person.place),
            height_m: person.body.height_m,
            looks: colours.and_then(|colours| Looks::of_part(colours, &self.view, part)),
            is_crowded,
        }
    }

    /// Covariance of the lasting range error at a place, m².
    fn range_error(&self, place: &Point2<f64>) -> Matrix2<f64> {
        let away = (place - self.view.center.xy()).try_normalize(0.0).unwrap_or_default();
        away * away.transpose() * RANGE_SIGMA_M.powi(2)
    }

    /// Bodies of the tracked people.
    pub fn bodies(&self) -> Vec<Body> {
        self.sampler.measured().iter().map(|person| person.body).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::mcmc::test_room::{empty_room, masks, standing};

    const RATE_HZ: f64 = 12.0;

    /// Tracks two people who stand away from the zones in front of the first camera of an empty room.
    fn track(people: [Body; 2], restarts: &[Restart]) -> Sightings {
        let stage = empty_room();
        let mut tracking = ImageTracking::new(&stage, 0, &McmcOptions::default()).unwrap();
        let mut last = Sightings::default();
        for frame in 1..=60 {
            // The room is empty at first, so that no person is part of the initial state.
            let there: &[Body] = if frame > 24 { &people } else { &[] };
            let time_s = f64::from(frame) / RATE_HZ;
            let frames = masks(&stage, there);
            let given = if frame > 24 { restarts } else { &[] };
            last = tracking.track(frame, time_s, &frames[0], given).unwrap();
        }
        last
    }

    #[test]
    fn restarts_away_from_zones_give_sightings_within_their_covariance() {
        let people = [standing(2.0, 3.4), standing(3.6, 1.4)];
        let restarts = people.map(|p| Restart { position: Point2::new(p.x_m + 0.3, p.y_m), height_m: 1.75 });
        let found = track(people, &restarts);
        assert!(found.is_usable);
        assert_eq!(found.people.len(), 2, "{found:?}");
        for person in &people {
            let at = Point2::new(person.x_m, person.y_m);
            let of = |s: &&Sighting| (s.position - at).norm() < 0.6;
            let sighting = found.people.iter().find(of).unwrap_or_else(|| panic!("{at} in {found:?}"));
            let error = sighting.position - at;
            let squared = error.dot(&(sighting.covariance.try_inverse().unwrap() * error));
            // Chi-squared of two degrees of freedom: one in a thousand.
            assert!(squared < 13.8, "{error:?}, {:?}", sighting.covariance);
            // Longer along the line of sight, from the corner (0.2, 0.2), than across.
            let away = (at - Point2::new(0.2, 0.2)).normalize();
            let across = nalgebra::Vector2::new(-away.y, away.x);
            let variance = |axis: nalgebra::Vector2<f64>| axis.dot(&(sighting.covariance * axis));
            assert!(variance(away) > 4.0 * variance(across), "{:?}", sighting.covariance);
            assert!(!sighting.is_crowded && sighting.looks.is_none());
        }
    }

    #[test]
    fn a_person_behind_another_is_crowded() {
        let people = [standing(1.8, 1.8), standing(3.0, 3.0)];
        let restarts = people.map(|p| Restart { position: Point2::new(p.x_m, p.y_m), height_m: 1.75 });
        let found = track(people, &restarts);
        let behind = found.people.iter().find(|s| s.position.x > 2.5);
        assert!(behind.is_none_or(|sighting| sighting.is_crowded), "{found:?}");
    }
}
