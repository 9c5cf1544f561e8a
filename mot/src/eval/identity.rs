//! Identity: share of rows in which the right track follows the right person.
//!
//! E. Ristani, F. Solera, R. Zou, R. Cucchiara and C. Tomasi, "Performance measures and a data set for multi-target,
//! multi-camera tracking", ECCV Workshops 2016. Each person gets at most one track for the whole recording, such that
//! as many rows as possible agree; their minimum-cost assignment with dummies is the assignment with the most agreeing
//! rows.

use super::pair_sums::PairSums;
use super::scenario::Scenario;
use super::{MetricFigure, TrackMetric, percent};

/// Identity figures.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentityMetric {
    /// Number of rows in which a person has their own track.
    pub true_positives: usize,
    /// Number of track rows that are not their person's.
    pub false_positives: usize,
    /// Number of truth rows without their own track.
    pub misses: usize,
    has_identities: bool,
}

impl TrackMetric for IdentityMetric {
    fn of(scenario: &Scenario) -> Self {
        let true_positives = if scenario.has_identities { agreeing_rows(scenario) } else { 0 };
        Self {
            true_positives,
            false_positives: scenario.track_rows - true_positives,
            misses: scenario.truth_rows - true_positives,
            has_identities: scenario.has_identities,
        }
    }

    fn together<'a>(parts: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let sum = |count: fn(&Self) -> usize| parts.clone().map(count).sum();
        Self {
            true_positives: sum(|p| p.true_positives),
            false_positives: sum(|p| p.false_positives),
            misses: sum(|p| p.misses),
            has_identities: parts.clone().all(|p| p.has_identities),
        }
    }

    fn figures(&self) -> Vec<MetricFigure> {
        vec![
            MetricFigure::new(
                "IDF1",
                percent(self.idf1()),
                "identity: share of rows in which everybody has their own track",
            ),
            MetricFigure::new("ID recall", percent(self.recall()), "share of the truth with its own track"),
            MetricFigure::new(
                "ID precision",
                percent(self.precision()),
                "share of the tracks' rows that are their person's",
            ),
        ]
    }
}

impl IdentityMetric {
    /// Ratio of rows with the right identity, 0 to 1; `None` without identities or rows.
    pub fn idf1(&self) -> Option<f64> {
        self.ratio(2 * self.true_positives, 2 * self.true_positives + self.false_positives + self.misses)
    }

    /// Share of the truth's rows with the right identity, 0 to 1.
    pub fn recall(&self) -> Option<f64> {
        self.ratio(self.true_positives, self.true_positives + self.misses)
    }

    /// Share of the tracks' rows with the right identity, 0 to 1.
    pub fn precision(&self) -> Option<f64> {
        self.ratio(self.true_positives, self.true_positives + self.false_positives)
    }

    fn ratio(&self, part: usize, whole: usize) -> Option<f64> {
        (self.has_identities && whole > 0).then(|| part as f64 / whole as f64)
    }
}

fn agreeing_rows(scenario: &Scenario) -> usize {
    let mut together = PairSums::default();
    for instant in &scenario.instants {
        for (i, person) in instant.truth.iter().enumerate() {
            for (j, track) in instant.tracks.iter().enumerate() {
                if instant.similarity.at(i, j) >= scenario.threshold() {
                    together.add(*person, *track, 1.0);
                }
            }
        }
    }
    together.assigned().iter().map(|rows| *rows as usize).sum()
}
