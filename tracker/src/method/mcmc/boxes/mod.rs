//! A detector's boxes as observations: how likely the boxes of all cameras are, given who stands where.
//!
//! In each camera a person is found with a probability that depends on how much of them is visible; a found person's box is
//! off by a Student-t distribution whose spread is given in metres in the person's distance; false boxes come as a Poisson
//! process. Each box is at most one person and each person at most one box, so the likelihood of a camera's boxes is
//!
//! ```text
//! Π over people (1 − p)  ·  Σ over matchings  Π over pairs  p N(box; person) / ((1 − p) κ)
//! ```
//!
//! up to the density of the boxes as false ones. See `matching` for the sum, `in_camera` for its upkeep while people move,
//! `detector` for what is learnt of the detector, `proposals` for where boxes ask for people.

mod camera;
mod detector;
mod in_camera;
mod least_squares;
mod matching;
mod measurement;
mod presence;
mod proposals;
#[cfg(test)]
mod tests;

use self::camera::{BoxCamera, POINTS};
use self::detector::{Detected, Detector};
use self::in_camera::InCamera;
pub(super) use self::measurement::Shown;
pub(super) use self::proposals::Hotspots;
use crate::observation::PersonBox;
use crate::prepared_room::PreparedRoom;
use crate::silhouette::Body;

/// People are learnt from when they are there with this probability.
const LEARN_FROM: f64 = 0.95;

/// The boxes of all cameras beside the people of a state.
///
/// A state's bodies are [`Self::insert`]ed once a moment; after that each step asks [`Self::try_change`] for the likelihood
/// that a change of one body would give, and [`Self::commit`]s what is accepted. People have the numbers of the state's list:
/// who comes is the last, and the last takes the number of who goes.
#[derive(Debug, Clone)]
pub(super) struct Boxes {
    cameras: Vec<InCamera>,
    detector: Detector,
    is_in_use: bool,
    has_any: bool,
}

impl Boxes {
    /// The cameras of a stage, without boxes.
    pub(super) fn new(stage: &PreparedRoom) -> Self {
        let camera = |(number, camera)| InCamera::new(BoxCamera::new(camera), number);
        let cameras: Vec<InCamera> = stage.cameras.iter().enumerate().map(camera).collect();
        Self { detector: Detector::new(cameras.len()), cameras, is_in_use: false, has_any: false }
    }

    /// Makes the detector one that finds nobody: the likelihood of no boxes is then the same for all states.
    #[cfg(test)]
    pub(super) fn blind(&mut self) {
        self.detector.blind();
    }

    /// Takes the boxes of a new moment, one entry a camera; `None` leaves a camera out. Forgets all people.
    pub(super) fn restart<'a>(&mut self, boxes: impl Iterator<Item = Option<&'a [PersonBox]>>) {
        (self.is_in_use, self.has_any) = (false, false);
        for (camera, boxes) in self.cameras.iter_mut().zip(boxes) {
            let detected = boxes.map(|boxes| {
                boxes.iter().map(|b| Detected { edges: [b.left, b.top, b.right, b.bottom], cut: b.cut })
            });
            camera.restart(detected, &self.detector);
            self.is_in_use |= camera.in_use;
            self.has_any |= !camera.boxes.is_empty();
        }
    }

    /// Forgets all people.
    pub(super) fn clear(&mut self) {
        for camera in &mut self.cameras {
            let boxes = std::mem::take(&mut camera.boxes);
            camera.restart(camera.in_use.then_some(boxes.into_iter()), &self.detector);
        }
    }

    /// Whether any camera has a detector's boxes at this moment, be they none.
    pub(super) fn is_in_use(&self) -> bool {
        self.is_in_use
    }

    /// Logarithm of the likelihood of the present state.
    pub(super) fn log_likelihood(&self) -> f64 {
        self.cameras.iter().map(|camera| camera.value).sum()
    }

    /// Logarithm of the likelihood of the state in which the person `old` is gone and `new` has come.
    pub(super) fn try_change(&mut self, old: Option<usize>, new: Option<&Body>) -> f64 {
        if !self.is_in_use {
            return 0.0;
        }
        let detector = &self.detector;
        self.cameras.iter_mut().map(|camera| camera.try_change(old, new, detector)).sum()
    }

    /// Makes the change last tried, with the same `old`; `has_new`: whether somebody came.
    pub(super) fn commit(&mut self, old: Option<usize>, has_new: bool) {
        if self.is_in_use {
            self.cameras.iter_mut().for_each(|camera| camera.commit(old, has_new));
        }
    }

    /// Adds a body.
    pub(super) fn insert(&mut self, body: &Body) {
        self.try_change(None, Some(body));
        self.commit(None, true);
    }

    /// The largest part of a person of the present state that a camera with a detector sees; 0 without one.
    pub(super) fn visible(&self, person: usize) -> f64 {
        let presences = self.cameras.iter().filter(|c| c.in_use).map(|c| &c.people[person]);
        let seen = presences.filter(|p| p.expected.is_some()).map(|p| p.visible());
        f64::from(seen.max().unwrap_or(0)) / f64::from(POINTS)
    }

    /// Learns of the detector from the present state, whose people are there with these probabilities.
    pub(super) fn learn(&mut self, existence: &[f64]) {
        if !self.is_in_use {
            return;
        }
        let matchings: Vec<_> = self.cameras.iter().map(InCamera::matching).collect();
        let matches: Vec<Vec<Vec<(usize, f64)>>> =
            matchings.iter().map(|m| m.matches().map(Iterator::collect).collect()).collect();
        let found = |camera: usize, person: usize| -> f64 {
            matches[camera].get(person).map_or(0.0, |pairs| pairs.iter().map(|(_, p)| p).sum())
        };
        let looking = self.cameras.iter().filter(|camera| camera.in_use).count();
        // Whoever is learnt from is known by other cameras than the one that is learnt of.
        let others_needed = looking.saturating_sub(1).min(2) as f64;
        for (number, camera) in self.cameras.iter().enumerate().filter(|(_, camera)| camera.in_use) {
            for (person, presence) in camera.people.iter().enumerate() {
                let by_others: f64 =
                    (0..matches.len()).filter(|c| *c != number).map(|c| found(c, person)).sum();
                let is_known = existence.get(person).is_some_and(|p| *p > LEARN_FROM);
                let Some(expected) = presence.expected.filter(|_| is_known) else { continue };
                if by_others < 0.9 * others_needed || 2 * presence.inside < POINTS {
                    continue;
                }
                self.detector.learn_hit(presence.visible(), found(number, person));
                let best = matches[number][person].iter().copied().max_by(|a, b| a.1.total_cmp(&b.1));
                if let Some((b, weight)) = best.filter(|(_, p)| *p > 0.5)
                    && 6 * presence.visible() > 5 * POINTS
                {
                    self.detector.learn_noise(&presence.noise, &expected, &camera.boxes[b], weight);
                }
            }
            self.detector.learn_clutter(number, matchings[number].unexplained().sum());
        }
        self.detector.learnt();
    }
}
