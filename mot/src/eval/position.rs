//! Position error: distance of the matched tracks from the truth.
//!
//! The mean is CLEAR's MOTP (cited in [`super::clear`]) on the floor; Osawa et al., whose method is
//! the tracker's `method::mcmc`, report mean and maximum.

use super::scenario::{Scenario, Space};
use super::{FigureValue, MetricFigure, TrackMetric, Unit};

/// Statistics of the distance over all CLEAR matches.
#[derive(Debug, Clone, PartialEq)]
pub struct PositionError {
    /// Mean, median and maximum; metres on the floor, pixels between foot points in the image. `None` without a match.
    pub statistics: Option<PositionStatistics>,
    /// Distances in ascending order.
    errors: Vec<f64>,
    space: Space,
}

/// Statistics of the distances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionStatistics {
    /// Arithmetic mean.
    pub mean: f64,
    /// Median; of an even number the mean of the middle two.
    pub median: f64,
    /// Maximum.
    pub max: f64,
}

impl TrackMetric for PositionError {
    fn of(scenario: &Scenario) -> Self {
        let errors = scenario.instants.iter().flat_map(|i| &i.matches).map(|m| m.distance).collect();
        Self::from_errors(errors, scenario.space)
    }

    fn together<'a>(parts: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let space = parts.clone().next().map_or(Space::Floor, |p| p.space);
        Self::from_errors(parts.flat_map(|p| &p.errors).copied().collect(), space)
    }

    fn figures(&self) -> Vec<MetricFigure> {
        let unit = if self.space == Space::Floor { Unit::Metres } else { Unit::Pixels };
        let of = |part: fn(&PositionStatistics) -> f64| {
            FigureValue::real(self.statistics.as_ref().map(part), unit)
        };
        vec![
            MetricFigure::new("mean error", of(|s| s.mean), "distance from the truth, over all matches"),
            MetricFigure::new("median error", of(|s| s.median), "half of the matches are closer"),
            MetricFigure::new("maximum error", of(|s| s.max), "the worst match"),
        ]
    }
}

impl PositionError {
    fn from_errors(mut errors: Vec<f64>, space: Space) -> Self {
        errors.sort_by(f64::total_cmp);
        let n = errors.len();
        let statistics = errors.last().map(|max| PositionStatistics {
            mean: errors.iter().sum::<f64>() / n as f64,
            median: 0.5 * (errors[(n - 1) / 2] + errors[n / 2]),
            max: *max,
        });
        Self { statistics, errors, space }
    }
}
