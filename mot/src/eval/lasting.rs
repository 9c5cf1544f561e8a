//! CLEAR as counted by `motmetrics`: a pair outlives a loss.
//!
//! TrackEval keeps a pair from one frame to the next; `motmetrics` (C. Heindl, py-motmetrics) keeps it for good: a
//! person who is found again near their last track is assigned to it even if another is nearer. Most files give the
//! same figures; mainly fragmentations may differ. Open pairs are assigned such that there are as many as possible, and
//! then for the least distance.

use super::assignment::best;
use super::grid::PairTable;
use super::instant::{Instant, SIMILARITY_TOLERANCE};
use super::scenario::Scenario;
use super::{FigureValue, MetricFigure, TrackMetric, percent};

/// Weight of a pair beside its similarity: more than any frame's similarities together.
const PAIR: f64 = 1000.0;

/// Figures of `motmetrics`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LastingPairs {
    /// Number of truth rows with a matching track.
    pub matches: usize,
    /// Number of truth rows without.
    pub misses: usize,
    /// Number of track rows without a matching person.
    pub false_positives: usize,
    /// Number of times that a person's track differs from the last one they had.
    pub switches: usize,
    /// Number of times that a person is lost between two matches.
    pub fragmentations: usize,
    has_identities: bool,
}

impl TrackMetric for LastingPairs {
    fn of(scenario: &Scenario) -> Self {
        let mut pairs = LastingMatcher::new(scenario);
        for instant in &scenario.instants {
            pairs.advance(instant, scenario.threshold());
        }
        Self {
            matches: pairs.matches,
            misses: scenario.truth_rows - pairs.matches,
            false_positives: scenario.track_rows - pairs.matches,
            switches: pairs.switches,
            fragmentations: pairs.fragmentations,
            has_identities: scenario.has_identities,
        }
    }

    fn together<'a>(parts: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let sum = |count: fn(&Self) -> usize| parts.clone().map(count).sum();
        Self {
            matches: sum(|p| p.matches),
            misses: sum(|p| p.misses),
            false_positives: sum(|p| p.false_positives),
            switches: sum(|p| p.switches),
            fragmentations: sum(|p| p.fragmentations),
            has_identities: parts.clone().all(|p| p.has_identities),
        }
    }

    fn figures(&self) -> Vec<MetricFigure> {
        let count = |value: usize| FigureValue::count(self.has_identities.then_some(value));
        vec![
            MetricFigure::new("MOTA", percent(self.mota()), "tracking accuracy, where pairs outlive losses"),
            MetricFigure::new(
                "ID switches",
                count(self.switches),
                "times a person's track becomes another one",
            ),
            MetricFigure::new(
                "fragmentations",
                count(self.fragmentations),
                "times a person is lost between matches",
            ),
            MetricFigure::new("false positives", count(self.false_positives), "rows that match no person"),
            MetricFigure::new("misses", count(self.misses), "truth rows without a track"),
        ]
    }
}

impl LastingPairs {
    /// Accuracy, at most 1; `None` without truth or identities.
    pub fn mota(&self) -> Option<f64> {
        let truth = self.matches + self.misses;
        let errors = self.misses + self.false_positives + self.switches;
        (self.has_identities && truth > 0).then(|| 1.0 - errors as f64 / truth as f64)
    }
}

/// Each person's track so far, and the counts.
struct LastingMatcher {
    track_of: Vec<Option<usize>>,
    is_lost: Vec<bool>,
    matches: usize,
    switches: usize,
    fragmentations: usize,
}

impl LastingMatcher {
    fn new(scenario: &Scenario) -> Self {
        Self {
            track_of: vec![None; scenario.people],
            is_lost: vec![false; scenario.people],
            matches: 0,
            switches: 0,
            fragmentations: 0,
        }
    }

    fn advance(&mut self, instant: &Instant, threshold: f64) {
        let is_pair = |i: usize, j: usize| instant.similarity.at(i, j) >= threshold - SIMILARITY_TOLERANCE;
        let mut found: Vec<Option<usize>> = vec![None; instant.truth.len()];
        let mut is_taken = vec![false; instant.tracks.len()];
        for (i, person) in instant.truth.iter().enumerate() {
            let kept = self.track_of[*person]
                .and_then(|track| instant.tracks.iter().position(|t| *t == track))
                .filter(|j| !is_taken[*j] && is_pair(i, *j));
            if let Some(j) = kept {
                found[i] = Some(j);
                is_taken[j] = true;
            }
        }
        let rest = PairTable::from_fn(instant.truth.len(), instant.tracks.len(), |i, j| {
            let is_open = found[i].is_none() && !is_taken[j] && is_pair(i, j);
            if is_open { PAIR + instant.similarity.at(i, j) } else { 0.0 }
        });
        for (i, j) in best(&rest) {
            found[i] = Some(j);
        }
        for (person, found) in instant.truth.iter().zip(found) {
            let last = &mut self.track_of[*person];
            match found.map(|j| instant.tracks[j]) {
                Some(track) => {
                    self.matches += 1;
                    self.switches += usize::from(last.is_some_and(|last| last != track));
                    self.fragmentations += usize::from(std::mem::take(&mut self.is_lost[*person]));
                    *last = Some(track);
                }
                None => self.is_lost[*person] |= last.is_some(),
            }
        }
    }
}
