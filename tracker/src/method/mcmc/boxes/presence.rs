//! One person of a state as one camera sees them: the expected box, what of it is visible, and the boxes that may be the person.

use super::camera::{ExpectedBox, POINTS};
use super::detector::{Detector, Noise};

/// Boxes that one person may be: the best ones count.
const MOST_CANDIDATES: usize = 8;

/// One person in one camera.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Presence {
    /// `None` for somebody who is not in front of the camera.
    pub(super) expected: Option<ExpectedBox>,
    pub(super) noise: Noise,
    /// Points of the expected box that are outside the image or hidden by the room.
    pub(super) fixed: u32,
    /// Points of it that are in the image.
    pub(super) inside: u32,
    /// Points of it that other people hide, too.
    pub(super) hidden: u32,
    /// Log probability of being missed.
    pub(super) log_miss: f64,
    /// Odds of being found.
    pub(super) hit_odds: f64,
    /// Boxes that may be the person, with their density over that of false boxes.
    candidates: [(u32, f64); MOST_CANDIDATES],
    count: u32,
    /// The person's terms of the sum over matchings.
    pub(super) term: f64,
}

impl Presence {
    /// Somebody whose box is expected so, before anything else is known.
    pub(super) fn of(expected: Option<ExpectedBox>) -> Self {
        Self { expected, ..Self::default() }
    }

    /// Points that are visible.
    pub(super) fn visible(&self) -> u32 {
        POINTS - (self.fixed | self.hidden).count_ones()
    }

    /// The boxes that may be the person, with their density over that of false boxes.
    pub(super) fn candidates(&self) -> &[(u32, f64)] {
        &self.candidates[..self.count as usize]
    }

    /// The boxes that may be the person, with the odds that they are.
    pub(super) fn odds(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.candidates().iter().map(|(b, density)| (*b as usize, density * self.hit_odds))
    }

    /// Takes in the points that other people hide.
    pub(super) fn set_hidden(&mut self, hidden: u32, detector: &Detector) {
        self.hidden = hidden;
        let visible = if self.expected.is_some() { self.visible() } else { 0 };
        [self.log_miss, self.hit_odds] = detector.miss_and_odds(self.inside, visible);
    }

    /// Keeps a candidate if it is among the best.
    pub(super) fn add(&mut self, candidate: (u32, f64)) {
        let count = self.count as usize;
        if count < MOST_CANDIDATES {
            self.candidates[count] = candidate;
            self.count += 1;
            return;
        }
        let worst = (0..count).min_by(|a, b| self.candidates[*a].1.total_cmp(&self.candidates[*b].1));
        if let Some(worst) = worst.filter(|worst| self.candidates[*worst].1 < candidate.1) {
            self.candidates[worst] = candidate;
        }
    }
}
