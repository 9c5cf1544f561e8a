//! Existence: calibration of the tracks' confidences.
//!
//! Each row of a track has a probability that the person exists. Of all rows with 80 %, eight in ten have to match a
//! person (A. P. Dawid, "The well-calibrated Bayesian", JASA 1982). The rows are put into bins by their confidence; the
//! calibration error is the mean over the rows of the difference between their bin's mean confidence and its share of
//! matches (M. P. Naeini, G. F. Cooper and M. Hauskrecht, "Obtaining well calibrated probabilities using Bayesian
//! binning", AAAI 2015). It does not measure discrimination: always stating the precision is calibrated. The mean
//! squared error does (G. W. Brier, "Verification of forecasts expressed in terms of probability", Monthly Weather
//! Review 1950); for constant certainty it is 1 − precision.

use serde_json::{Value as Json, json};

use super::scenario::Scenario;
use super::{FigureValue, MetricFigure, TrackMetric, Unit, percent};

/// Number of bins, of equal width.
const BINS: usize = 10;

/// Calibration of the confidences.
#[derive(Debug, Clone, PartialEq)]
pub struct Existence {
    /// Bins by confidence, the lowest first; `None` where the 7th column holds no probabilities.
    pub bins: Option<Vec<ReliabilityBin>>,
    /// Sum over the rows of the squared difference between confidence and truth.
    squares: f64,
}

/// Rows with about the same confidence.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ReliabilityBin {
    /// Number of rows.
    pub rows: usize,
    /// Number of rows that match a person.
    pub matched: usize,
    /// Sum of the confidences: the expected number of matches.
    pub expected: f64,
}

impl TrackMetric for Existence {
    fn of(scenario: &Scenario) -> Self {
        let (mut bins, mut squares) = (vec![ReliabilityBin::default(); BINS], 0.0);
        for instant in &scenario.instants {
            for (track, confidence) in instant.tracks.iter().zip(&instant.confidence) {
                let is_somebody = instant.matches.iter().any(|m| m.track == *track);
                let bin = &mut bins[((confidence * BINS as f64) as usize).min(BINS - 1)];
                bin.rows += 1;
                bin.matched += usize::from(is_somebody);
                bin.expected += confidence;
                squares += (confidence - f64::from(u8::from(is_somebody))).powi(2);
            }
        }
        Self { bins: scenario.has_probabilities().then_some(bins), squares }
    }

    fn together<'a>(parts: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let all: Option<Vec<&Vec<ReliabilityBin>>> = parts.clone().map(|p| p.bins.as_ref()).collect();
        let sum = |bin: usize, all: &[&Vec<ReliabilityBin>]| {
            all.iter().map(|bins| bins[bin]).fold(ReliabilityBin::default(), |a, b| ReliabilityBin {
                rows: a.rows + b.rows,
                matched: a.matched + b.matched,
                expected: a.expected + b.expected,
            })
        };
        Self {
            bins: all.map(|all| (0..BINS).map(|bin| sum(bin, &all)).collect()),
            squares: parts.map(|p| p.squares).sum(),
        }
    }

    fn figures(&self) -> Vec<MetricFigure> {
        vec![
            MetricFigure::new(
                "existence error",
                percent(self.error()),
                "calibration: how far the tracks' confidences are from the share that match a person",
            ),
            MetricFigure::new(
                "Brier",
                FigureValue::real(self.brier(), Unit::None),
                "mean squared error of the confidences; of certainty it would be 1 − precision",
            ),
        ]
    }
}

impl Existence {
    /// Expected calibration error, 0 to 1; `None` without rows or probabilities.
    pub fn error(&self) -> Option<f64> {
        let bins = self.bins.as_ref()?;
        let off: f64 = bins.iter().map(|bin| (bin.expected - bin.matched as f64).abs()).sum();
        self.per_row(off)
    }

    /// Brier score, 0 to 1; `None` without rows or probabilities.
    pub fn brier(&self) -> Option<f64> {
        self.per_row(self.squares)
    }

    /// Reliability diagram: number of rows, mean confidence and share of matches of each bin with rows; percent.
    pub(super) fn json(&self) -> Json {
        let bin = |bin: &ReliabilityBin| {
            let percent = |sum: f64| 100.0 * sum / bin.rows as f64;
            json!({ "rows": bin.rows, "told": percent(bin.expected), "matched": percent(bin.matched as f64) })
        };
        json!(self.bins.as_ref().map(|bins| bins.iter().filter(|b| b.rows > 0).map(bin).collect::<Vec<_>>()))
    }

    fn per_row(&self, sum: f64) -> Option<f64> {
        let rows: usize = self.bins.as_ref()?.iter().map(|bin| bin.rows).sum();
        (rows > 0).then(|| sum / rows as f64)
    }
}
