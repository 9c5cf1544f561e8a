//! One person of a state in one camera: the expected box, its visible part, and the candidate boxes.

use super::camera::{ExpectedBox, POINTS};
use super::detector::{Detector, Noise};

/// Largest number of candidate boxes of one person: the best ones are kept.
const MOST_CANDIDATES: usize = 8;

/// One person in one camera.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Presence {
    /// Expected box; `None` for a person not in front of the camera.
    pub(super) expected: Option<ExpectedBox>,
    pub(super) noise: Noise,
    /// Points of the expected box that are outside the image or hidden by the room.
    pub(super) fixed: u32,
    /// Points of it that are in the image.
    pub(super) inside: u32,
    /// Points of it that other people hide, too.
    pub(super) hidden: u32,
    /// Log probability of a missed detection.
    pub(super) log_miss: f64,
    /// Odds of a detection.
    pub(super) hit_odds: f64,
    /// Candidate boxes, with their density over that of false boxes.
    candidates: [(u32, f64); MOST_CANDIDATES],
    count: u32,
    /// Term of the person in the log sum over matchings.
    pub(super) term: f64,
}

impl Presence {
    /// Presence with this expected box and nothing else computed.
    pub(super) fn of(expected: Option<ExpectedBox>) -> Self {
        Self { expected, ..Self::default() }
    }

    /// Number of visible points.
    pub(super) fn visible(&self) -> u32 {
        POINTS - (self.fixed | self.hidden).count_ones()
    }

    /// Candidate boxes, with their density over that of false boxes.
    pub(super) fn candidates(&self) -> &[(u32, f64)] {
        &self.candidates[..self.count as usize]
    }

    /// Candidate boxes, with the odds that they belong to the person.
    pub(super) fn odds(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.candidates().iter().map(|(b, density)| (*b as usize, density * self.hit_odds))
    }

    /// Sets the points that other people hide, and updates the probability of detection.
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
