//! Exclusion (section 4.4, equations 10 to 14): a hypothesis that is closer to another person's distribution than to
//! its own person's gets weight 0.
//!
//! Each person's hypotheses are modelled by a normal distribution with their weighted mean and covariance. The paper
//! assumes equal covariances, so that the Mahalanobis distance decides. Comparing the densities themselves (equation
//! 10) also accounts for a person whose position is hardly known: their density is low everywhere, so they do not
//! exclude others.

use nalgebra::{Matrix3, Vector3};

/// Standard deviation added to each axis of a covariance, metres: hypotheses at a single place are not known better
/// than this, and the covariance becomes invertible.
const LEAST_SIGMA_M: f64 = 0.03;

/// Least distance of two people's heads on the floor plan, metres.
pub const APART_M: f64 = 0.3;

/// Normal distribution of a person's head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeadDistribution {
    /// s̄ (equation 12).
    pub mean: Vector3<f64>,
    /// Σ (equation 12).
    pub covariance: Matrix3<f64>,
    /// Inverse of the covariance with the least variance added.
    inverse: Matrix3<f64>,
    log_determinant: f64,
}

impl HeadDistribution {
    /// Distribution with this mean and covariance.
    pub fn new(mean: Vector3<f64>, covariance: Matrix3<f64>) -> Self {
        let least = LEAST_SIGMA_M * LEAST_SIGMA_M;
        let safe = covariance + Matrix3::identity() * least;
        // Positive definite by the added variance, unless an entry is NaN.
        let (inverse, log_determinant) = match safe.cholesky() {
            Some(root) => (root.inverse(), root.determinant().ln()),
            None => (Matrix3::identity() / least, 3.0 * least.ln()),
        };
        Self { mean, covariance, inverse, log_determinant }
    }

    /// Distribution of weighted hypotheses (equation 12). Weights need not sum to 1; if their sum is 0, all count
    /// alike.
    pub fn of(hypotheses: &[Vector3<f64>], weights: &[f64]) -> Self {
        let total: f64 = weights.iter().sum();
        let uniform = 1.0 / hypotheses.len().max(1) as f64;
        let share = |w: f64| if total > 0.0 && total.is_finite() { w / total } else { uniform };
        let weighted = || hypotheses.iter().zip(weights).map(|(s, w)| (s, share(*w)));
        let mean = weighted().map(|(s, w)| s * w).sum();
        let covariance = weighted()
            .map(|(s, w)| {
                let d: Vector3<f64> = s - mean;
                d * d.transpose() * w
            })
            .sum();
        Self::new(mean, covariance)
    }

    /// Squared Mahalanobis distance (equation 13).
    pub fn distance(&self, s: &Vector3<f64>) -> f64 {
        let d = s - self.mean;
        d.dot(&(self.inverse * d))
    }

    /// Score for the assignment of a place to a person; the lowest wins.
    fn remoteness(&self, s: &Vector3<f64>, equal_covariances: bool) -> f64 {
        self.distance(s) + if equal_covariances { 0.0 } else { self.log_determinant }
    }
}

/// Sets the weights of those hypotheses of person `own` to 0 that are closer to another person (equation 14).
pub fn exclude(
    hypotheses: &[Vector3<f64>],
    weights: &mut [f64],
    own: usize,
    people: &[HeadDistribution],
    equal_covariances: bool,
) {
    /// Distance of two people beyond which no comparison is needed, metres.
    const FAR_M: f64 = 3.0;
    let mean = people[own].mean;
    for (other, gaussian) in people.iter().enumerate() {
        if other == own || (gaussian.mean - mean).norm() > FAR_M {
            continue;
        }
        for (s, weight) in hypotheses.iter().zip(&mut *weights) {
            let theirs = gaussian.remoteness(s, equal_covariances);
            if theirs < people[own].remoteness(s, equal_covariances) {
                *weight = 0.0;
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // zeros and ones that are set, not computed
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn at(x: f64, y: f64) -> Vector3<f64> {
        Vector3::new(x, y, 1.6)
    }

    #[test]
    fn weighted_moments_by_hand() {
        let gaussian = HeadDistribution::of(&[at(0.0, 0.0), at(1.0, 0.0), at(0.0, 9.0)], &[1.0, 3.0, 0.0]);
        assert_relative_eq!(gaussian.mean, at(0.75, 0.0), epsilon = 1e-12);
        assert_relative_eq!(gaussian.covariance[(0, 0)], 0.75 * 0.25, epsilon = 1e-12);
        assert_eq!(gaussian.covariance[(1, 1)], 0.0);
        let known = 0.75 * 0.25 + LEAST_SIGMA_M * LEAST_SIGMA_M;
        assert_relative_eq!(gaussian.distance(&at(1.75, 0.0)), 1.0 / known, epsilon = 1e-9);
    }

    #[test]
    fn between_equals_the_middle_divides() {
        let people =
            [at(0.0, 0.0), at(0.6, 0.0)].map(|m| HeadDistribution::new(m, Matrix3::identity() * 0.01));
        let places = [at(0.0, 0.0), at(0.29, 0.3), at(0.31, 0.3), at(0.6, 0.0)];
        for equal in [true, false] {
            let mut weights = [1.0; 4];
            exclude(&places, &mut weights, 0, &people, equal);
            assert_eq!(weights, [1.0, 1.0, 0.0, 0.0]);
            let mut weights = [1.0; 4];
            exclude(&places, &mut weights, 1, &people, equal);
            assert_eq!(weights, [0.0, 0.0, 1.0, 1.0]);
        }
    }

    #[test]
    fn somebody_lost_does_not_push_somebody_found() {
        let people = [
            HeadDistribution::new(at(0.0, 0.0), Matrix3::identity() * 0.0004),
            HeadDistribution::new(at(0.5, 0.0), Matrix3::identity()),
        ];
        let beside = [at(0.07, 0.0)];
        let mut weights = [1.0];
        exclude(&beside, &mut weights, 0, &people, true);
        assert_eq!(weights, [0.0], "as published");
        weights = [1.0];
        exclude(&beside, &mut weights, 0, &people, false);
        assert_eq!(weights, [1.0]);
        exclude(&[at(0.02, 0.0)], &mut weights, 1, &people, false);
        assert_eq!(weights, [0.0], "and they do not take the place of who is there");
    }

    #[test]
    fn degenerate_distributions_do_not_blow_up() {
        let one_place = HeadDistribution::of(&[at(1.0, 1.0); 5], &[0.2; 5]);
        assert!(one_place.distance(&at(1.1, 1.0)).is_finite());
        let weightless = HeadDistribution::of(&[at(0.0, 0.0), at(1.0, 0.0)], &[0.0, 0.0]);
        assert_relative_eq!(weightless.mean, at(0.5, 0.0), epsilon = 1e-12);
        let nan = HeadDistribution::new(at(0.0, 0.0), Matrix3::from_element(f64::NAN));
        assert!(nan.distance(&at(0.1, 0.0)).is_finite());
        // Two people at the same place keep their hypotheses.
        let mut weights = [1.0];
        exclude(&[at(1.0, 1.0)], &mut weights, 0, &[one_place, one_place], true);
        assert_eq!(weights, [1.0]);
    }
}
