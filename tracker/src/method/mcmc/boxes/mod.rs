//! A detector's boxes as observations: likelihood of the boxes of all cameras, given the people of a state.
//!
//! In each camera a person is detected with a probability p that depends on the visible fraction. The box of a
//! detected person deviates from the expected one by a Student-t distribution whose spread is given in metres at the
//! person's distance. False boxes are a Poisson process of density κ. Each box belongs to at most one person and each
//! person has at most one box, so the likelihood of a camera's boxes is
//!
//! ```text
//! Π over people (1 − p)  ·  Σ over matchings  Π over pairs  p N(box; person) / ((1 − p) κ)
//! ```
//!
//! up to the density of the boxes as false ones. [`matching`] computes the sum, [`in_camera`] updates it while people
//! move, [`detector`] learns the detector's parameters, [`proposals`] proposes people at unexplained boxes.

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

use std::sync::Arc;

use self::camera::{BoxCamera, POINTS};
use self::detector::{Detected, Detector};
use self::in_camera::InCamera;
pub(super) use self::measurement::BoxMeasurement;
use self::presence::Presence;
pub(super) use self::proposals::Hotspots;
use crate::identity::mean_vector::MeanVector;
use crate::observation::PersonBox;
use crate::prepared_room::PreparedRoom;
use crate::silhouette::Body;

/// Least probability of existence of the people from whom the detector is learnt.
const LEARN_FROM: f64 = 0.95;

/// Least probability that a box is a person's, and least visible points of that person, for the box's appearance vector
/// to be that person's.
const SURELY: f64 = 0.9;
const CLEARLY_VISIBLE: u32 = POINTS * 7 / 10;

/// Appearance vector of each box of a camera.
type BoxVectors = Vec<Option<Arc<[f32]>>>;

/// Boxes of all cameras and the people of a state.
///
/// A state's bodies are [`Self::insert`]ed once a moment; after that each step asks [`Self::try_change`] for the
/// likelihood after a change of one body, and [`Self::commit`]s accepted changes. People have the indices of the
/// state's list: a new person is appended, and the last person takes the index of a removed one.
#[derive(Debug, Clone)]
pub(super) struct Boxes {
    cameras: Vec<InCamera>,
    /// Appearance vectors of each camera's boxes.
    vectors: Vec<BoxVectors>,
    detector: Detector,
    is_in_use: bool,
    has_any: bool,
}

impl Boxes {
    /// Cameras of a room, without boxes.
    pub(super) fn new(stage: &PreparedRoom) -> Self {
        let camera = |(number, camera)| InCamera::new(BoxCamera::new(camera), number);
        let cameras: Vec<InCamera> = stage.cameras.iter().enumerate().map(camera).collect();
        let vectors = vec![Vec::new(); cameras.len()];
        let detector = Detector::new(cameras.len());
        Self { detector, cameras, vectors, is_in_use: false, has_any: false }
    }

    /// Sets the detection probability to 0: the likelihood of no boxes is then the same for all states.
    #[cfg(test)]
    pub(super) fn blind(&mut self) {
        self.detector.blind();
    }

    /// Sets the boxes of a new moment, one entry a camera; `None` leaves a camera out. Removes all people.
    pub(super) fn restart<'a>(&mut self, boxes: impl Iterator<Item = Option<&'a [PersonBox]>>) {
        (self.is_in_use, self.has_any) = (false, false);
        for ((camera, vectors), boxes) in self.cameras.iter_mut().zip(&mut self.vectors).zip(boxes) {
            vectors.clear();
            vectors.extend(boxes.into_iter().flatten().map(|b| b.appearance.clone()));
            let detected = boxes.map(|boxes| {
                boxes.iter().map(|b| Detected { edges: [b.left, b.top, b.right, b.bottom], cut: b.cut })
            });
            camera.restart(detected, &self.detector);
            self.is_in_use |= camera.in_use;
            self.has_any |= !camera.boxes.is_empty();
        }
    }

    /// Removes all people.
    pub(super) fn clear(&mut self) {
        for camera in &mut self.cameras {
            let boxes = std::mem::take(&mut camera.boxes);
            camera.restart(camera.in_use.then_some(boxes.into_iter()), &self.detector);
        }
    }

    /// Whether any camera has a detector's output at this moment, even if it is empty.
    pub(super) fn is_in_use(&self) -> bool {
        self.is_in_use
    }

    /// Log-likelihood of the present state.
    pub(super) fn log_likelihood(&self) -> f64 {
        self.cameras.iter().map(|camera| camera.value).sum()
    }

    /// Log-likelihood of the state in which the person `old` is removed and `new` is added.
    pub(super) fn try_change(&mut self, old: Option<usize>, new: Option<&Body>) -> f64 {
        if !self.is_in_use {
            return 0.0;
        }
        let detector = &self.detector;
        self.cameras.iter_mut().map(|camera| camera.try_change(old, new, detector)).sum()
    }

    /// Commits the change last tried, with the same `old`; `has_new`: whether a person was added.
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

    /// Largest visible fraction of a person of the present state over the cameras with a detector; 0 without any.
    pub(super) fn visible(&self, person: usize) -> f64 {
        let presences = self.cameras.iter().filter(|c| c.in_use).map(|c| &c.people[person]);
        let seen = presences.filter(|p| p.expected.is_some()).map(Presence::visible);
        f64::from(seen.max().unwrap_or(0)) / f64::from(POINTS)
    }

    /// Whether some box of this moment has an appearance vector.
    pub(super) fn has_vectors(&self) -> bool {
        self.vectors.iter().flatten().any(Option::is_some)
    }

    /// Mean appearance vector of each person of the present state at this moment, of the boxes that are surely theirs.
    pub(super) fn vectors(&self) -> Vec<MeanVector> {
        let people = self.cameras.iter().map(|camera| camera.people.len()).max().unwrap_or(0);
        let mut means = vec![MeanVector::default(); people];
        for (camera, vectors) in self.cameras.iter().zip(&self.vectors) {
            if vectors.iter().all(Option::is_none) {
                continue;
            }
            let matching = camera.matching();
            for ((mean, presence), matches) in means.iter_mut().zip(&camera.people).zip(matching.matches()) {
                let sure = matches.filter(|(_, p)| *p > SURELY && presence.visible() >= CLEARLY_VISIBLE);
                sure.filter_map(|(b, _)| vectors[b].as_ref()).for_each(|vector| mean.add_box(vector));
            }
        }
        means
    }

    /// Updates the detector's parameters by the present state, whose people exist with these probabilities.
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
        // A person from whom one camera's parameters are learnt must be detected by other cameras.
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
        self.detector.apply_learnt();
    }
}
