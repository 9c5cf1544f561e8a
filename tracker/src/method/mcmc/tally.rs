//! Estimate of a moment: each person's mean over the kept states that hold them (equation 9).
//!
//! The states differ in their number of people, so the mean is taken person by person; a person in no more than half
//! of the states is absent.

use nalgebra::{Matrix2, Vector2};

use super::person::{Key, Person};
use super::posture::PostureShares;
use crate::silhouette::Body;

/// Sums over the kept states.
#[derive(Debug, Clone, Default)]
pub(super) struct Tally {
    people: Vec<Sums>,
    states: u32,
    /// Most probable of the states that were compared, with its log density.
    best: Option<(f64, Vec<(Key, Body)>)>,
}

/// Sums over the states that hold one person.
#[derive(Debug, Clone)]
pub(super) struct Sums {
    pub(super) key: Key,
    pub(super) states: u32,
    /// Place in the first state, metres. Sums are of differences from it, to avoid cancellation.
    origin: Vector2<f64>,
    place: Vector2<f64>,
    square: Matrix2<f64>,
    radius: f64,
    height: f64,
    /// Postures of a person known before this moment.
    pub(super) postures: PostureShares,
}

impl Tally {
    /// Adds one state.
    pub(super) fn add(&mut self, people: &[Person]) {
        self.states += 1;
        for person in people {
            let body = &person.body;
            let place = Vector2::new(body.x_m, body.y_m);
            let known = self.people.iter().position(|s| s.key == person.key);
            let i = known.unwrap_or_else(|| {
                self.people.push(Sums::new(person.key, place));
                self.people.len() - 1
            });
            let sums = &mut self.people[i];
            let d = place - sums.origin;
            sums.states += 1;
            sums.place += d;
            sums.square += d * d.transpose();
            sums.radius += body.radius_m;
            sums.height += body.height_m;
            if let Some(known) = &person.known {
                sums.postures.add(&known.size, body);
            }
        }
    }

    /// Compares a state with the most probable one until now; `log_density` is known up to a constant.
    pub(super) fn compare(&mut self, log_density: f64, people: &[Person]) {
        if self.best.as_ref().is_none_or(|(best, _)| log_density > *best) {
            self.best = Some((log_density, people.iter().map(|person| (person.key, person.body)).collect()));
        }
    }

    /// Body of a person in the most probable of the compared states; `None` if they are not in it.
    pub(super) fn most_probable(&self, key: Key) -> Option<&Body> {
        let (_, people) = self.best.as_ref()?;
        people.iter().find(|(of, _)| *of == key).map(|(_, body)| body)
    }

    /// Number of states added.
    pub(super) fn states(&self) -> u32 {
        self.states
    }

    /// Sums of one person; `None` when no state held them.
    pub(super) fn of(&self, key: Key) -> Option<&Sums> {
        self.people.iter().find(|s| s.key == key)
    }

    /// Sums of all people who were in any state.
    pub(super) fn all(&self) -> &[Sums] {
        &self.people
    }
}

impl Sums {
    fn new(key: Key, origin: Vector2<f64>) -> Self {
        Self {
            key,
            states: 0,
            origin,
            place: Vector2::zeros(),
            square: Matrix2::zeros(),
            radius: 0.0,
            height: 0.0,
            postures: PostureShares::default(),
        }
    }

    /// Mean place, metres.
    pub(super) fn place(&self) -> Vector2<f64> {
        self.origin + self.place / f64::from(self.states)
    }

    /// Covariance of the place over the states, m².
    pub(super) fn covariance(&self) -> Matrix2<f64> {
        let mean = self.place / f64::from(self.states);
        self.square / f64::from(self.states) - mean * mean.transpose()
    }

    /// Mean radius, metres.
    pub(super) fn radius_m(&self) -> f64 {
        self.radius / f64::from(self.states)
    }

    /// Mean height, metres.
    pub(super) fn height_m(&self) -> f64 {
        self.height / f64::from(self.states)
    }
}
