//! Number of people: calibration of the distribution that the tracks' confidences imply.
//!
//! The confidences of a frame's rows give the probability of every number of people ([`count`]). Frames with a row in
//! either file are judged by how often the true number is in the 90 % set, and by the logarithm of its probability (I.
//! J. Good, "Rational decisions", J. Royal Statistical Society B 1952). Numbers are integers, so a calibrated set
//! covers more than 90 %: with two or three people who are nearly certain, nearly always.

use super::scenario::Scenario;
use super::{FigureValue, MetricFigure, TrackMetric, Unit, percent};
use crate::count;

/// Probability of the judged set.
const SHARE: f64 = 0.9;
/// Least probability of the true number: confidences are written to three decimals, so an impossible number may be as
/// probable as this.
const LEAST: f64 = 5e-4;

/// Calibration of the number of people.
#[derive(Debug, Clone, PartialEq)]
pub struct PeopleCount {
    frames: usize,
    /// Number of frames whose true number is in the set.
    covered: usize,
    /// Sum over the frames of the log probability of the true number, nats.
    log_score: f64,
    has_probabilities: bool,
}

impl TrackMetric for PeopleCount {
    fn of(scenario: &Scenario) -> Self {
        let has_probabilities = scenario.has_probabilities();
        let (mut covered, mut log_score) = (0, 0.0);
        for instant in scenario.instants.iter().filter(|_| has_probabilities) {
            let distribution = count::distribution(instant.confidence.iter().copied());
            let people = instant.truth.len();
            covered += usize::from(count::is_likely(&distribution, people, SHARE));
            log_score += distribution.get(people).map_or(LEAST, |p| p.max(LEAST)).ln();
        }
        Self { frames: scenario.instants.len(), covered, log_score, has_probabilities }
    }

    fn together<'a>(parts: impl Iterator<Item = &'a Self> + Clone) -> Self {
        Self {
            frames: parts.clone().map(|p| p.frames).sum(),
            covered: parts.clone().map(|p| p.covered).sum(),
            log_score: parts.clone().map(|p| p.log_score).sum(),
            has_probabilities: parts.clone().all(|p| p.has_probabilities),
        }
    }

    fn figures(&self) -> Vec<MetricFigure> {
        vec![
            MetricFigure::new(
                "count coverage",
                percent(self.coverage()),
                "frames whose true number of people is in the 90 % set of what the confidences say",
            ),
            MetricFigure::new(
                "count log score",
                FigureValue::real(self.log_score(), Unit::None),
                "mean log probability of the true number, nats: 0 is sure and right",
            ),
        ]
    }
}

impl PeopleCount {
    /// Share of the frames whose true number is in the 90 % set, 0 to 1; `None` without frames or probabilities.
    pub fn coverage(&self) -> Option<f64> {
        self.per_frame(self.covered as f64)
    }

    /// Mean log probability of the true number, nats, at least ln 0.0005; `None` without frames or probabilities.
    pub fn log_score(&self) -> Option<f64> {
        self.per_frame(self.log_score)
    }

    fn per_frame(&self, sum: f64) -> Option<f64> {
        (self.has_probabilities && self.frames > 0).then(|| sum / self.frames as f64)
    }
}
