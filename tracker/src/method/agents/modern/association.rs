//! Association of one sender's measurements with people.

use super::ModernOptions;
use super::assignment::{Assignment, Pair};
use super::measurement::Measurement;
use super::people::People;
use super::person::{LEARNT, Person};

/// Joint assignment of measurements to people; its buffers are reused from sender to sender.
#[derive(Debug, Default)]
pub(super) struct Association {
    assignment: Assignment,
    pairs: Vec<Pair>,
    of: Vec<Option<usize>>,
}

impl Association {
    /// Associates the measurements of one sender with people; at most one measurement per person.
    pub(super) fn solve(&mut self, measurements: &[Measurement], people: &People, options: &ModernOptions) {
        self.pairs.clear();
        for (row, measurement) in measurements.iter().enumerate() {
            let spread = measurement.covariance.trace();
            for (column, person) in people.iter().enumerate() {
                // The largest eigenvalue is at most the trace, so this cheap test rejects most pairs.
                let away = (measurement.position - person.motion.position).norm_squared();
                if away > options.gate * (spread + person.motion.position_covariance.trace())
                    || person.spare_s.is_some()
                {
                    continue;
                }
                if let Some(cost) = cost(measurement, person, options) {
                    self.pairs.push(Pair { row, column, cost });
                }
            }
        }
        self.of.clear();
        self.of.resize(measurements.len(), None);
        for pair in self.assignment.solve(&self.pairs, measurements.len(), people.len()) {
            self.of[pair.row] = Some(pair.column);
        }
    }

    /// Index of the associated person for each measurement; `None` for an unassociated one.
    pub(super) fn people(&self) -> &[Option<usize>] {
        &self.of
    }

    /// Index of the person associated with one measurement.
    pub(super) fn person_of(&self, measurement: usize) -> Option<usize> {
        self.of[measurement]
    }

    /// Assignment solver, for reuse by other assignments.
    pub(super) fn solver(&mut self) -> &mut Assignment {
        &mut self.assignment
    }
}

/// Cost of associating a measurement with a person, in units of squared Mahalanobis distance; `None` beyond the gate.
fn cost(measurement: &Measurement, person: &Person, options: &ModernOptions) -> Option<f64> {
    /// Determinant at which the covariance's share of the cost is 0, m⁴.
    const SMALLEST_DETERMINANT: f64 = 1e-4;
    /// Maximum share of the looks in the cost.
    const MOST_OF_LOOKS: f64 = 25.0;
    let fit = person.motion.fit(&measurement.position, &measurement.covariance)?;
    if fit.distance >= options.gate {
        return None;
    }
    let place = fit.distance + fit.log_determinant - SMALLEST_DETERMINANT.ln();
    let looks = match &measurement.signature {
        Some(signature) if person.identity.learnt.weight >= LEARNT => {
            let factor = if measurement.is_crowded { options.crowded_factor } else { 1.0 };
            person.identity.learnt.distance(signature, factor).min(MOST_OF_LOOKS)
        }
        _ => 0.0,
    };
    Some(place + looks)
}
