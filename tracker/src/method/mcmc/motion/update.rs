//! Measurement update of a person's motion, from the sampler's posterior or from a measurement of its own.

use std::ops::AddAssign;

use nalgebra::{Matrix2, Matrix2x4, Matrix4, Vector2};

use super::super::options::MotionOptions;
use super::super::person::{DEVIATION_SIGMA_M, DEVIATION_WEIGHT};
use super::{Belief, Measurement, Motion};

/// Squared Mahalanobis distance from the prediction above which the prediction is not trusted: one in a thousand by
/// chance.
const OUTLIER_SQUARED_SIGMAS: f64 = 13.8;
/// Standard deviation of a measurement along an axis without information, metres.
pub(super) const UNINFORMED_SIGMA_M: f64 = 5.0;
/// Ratio of posterior to prior variance above which an axis has no information but the sampler's own noise.
const UNINFORMED_VARIANCE_RATIO: f64 = 0.9;

impl Motion {
    /// Updates the belief by the sampler's posterior of the silhouette's place (mean in metres, covariance in m²), of
    /// which this belief was the prior.
    ///
    /// The likelihood behind that posterior is `N(z, R)` with `R⁻¹ = Σ⁻¹ − P⁻¹`. The offset between silhouette and
    /// person (`gait_sigma_m`) is added to R, and the belief updated with the sum. Directions without information (Σ
    /// as wide as P: the person is hidden) have no R⁻¹, and stay as predicted.
    pub(in super::super) fn condition(
        &mut self,
        place: &Vector2<f64>,
        posterior: &Matrix2<f64>,
        options: &MotionOptions,
    ) {
        let gait = Matrix2::identity() * options.gait_sigma_m.powi(2);
        let shift = place - self.silhouette_place();
        self.inflate_prediction(&shift, &gait);
        let prior = self.silhouette_covariance();
        let Some(root) = prior.cholesky().map(|c| c.l()) else { return };
        let Some(inverse_root) = root.try_inverse() else { return };
        // In units of the prior, the posterior and the likelihood have the same axes: the coordinates along them are
        // the measurement.
        let relative = (inverse_root * posterior * inverse_root.transpose()).symmetric_eigen();
        let mut measures = relative.eigenvectors.transpose() * inverse_root;
        let mut found = measures * shift;
        let mut noise = Matrix2::zeros();
        for i in 0..2 {
            let left = relative.eigenvalues[i].clamp(1e-6, 1.0);
            if left < UNINFORMED_VARIANCE_RATIO {
                found[i] /= 1.0 - left;
                noise[(i, i)] = left / (1.0 - left);
            } else {
                // No measurement: a row of zeros, whose noise does not matter.
                measures.row_mut(i).fill(0.0);
                (found[i], noise[(i, i)]) = (0.0, 1.0);
            }
        }
        noise += measures * gait * measures.transpose();
        self.measured = self.measurement(&measures, &found, &noise);
        let observation = measures * self.silhouette_from_state();
        self.update(&observation, &found, &noise);
    }

    /// Updates the belief by a measurement of the silhouette's place (metres) with this covariance (m²), which does
    /// not depend on the prediction.
    pub(in super::super) fn measure(
        &mut self,
        place: &Vector2<f64>,
        covariance: &Matrix2<f64>,
        options: &MotionOptions,
    ) {
        self.observe(place, &(covariance + Matrix2::identity() * options.gait_sigma_m.powi(2)));
    }

    /// Updates the belief by a measurement of the silhouette's place (metres) whose covariance (m²) includes the offset
    /// between silhouette and person.
    pub(super) fn observe(&mut self, place: &Vector2<f64>, noise: &Matrix2<f64>) {
        let shift = place - self.silhouette_place();
        self.log_evidence = log_density(&shift, &(self.silhouette_covariance() + noise));
        self.inflate_prediction(&shift, noise);
        self.measured = self.measurement(&Matrix2::identity(), &shift, noise);
        self.update(&self.silhouette_from_state(), &shift, noise);
    }

    /// Widens the prediction if a measurement with this noise is too far from it.
    fn inflate_prediction(&mut self, shift: &Vector2<f64>, noise: &Matrix2<f64>) {
        let squared_sigmas = (self.silhouette_covariance() + noise)
            .try_inverse()
            .map_or(0.0, |inverse| shift.dot(&(inverse * shift)));
        if squared_sigmas > OUTLIER_SQUARED_SIGMAS {
            // The measurement contradicts the prediction, so the covariance grows by the square of the shift.
            let more = shift * shift.transpose();
            self.belief.covariance.fixed_view_mut::<2, 2>(0, 0).add_assign(&more);
            if let Some(step) = &mut self.arrived {
                step.predicted.covariance.copy_from(&self.belief.covariance);
            }
        }
    }

    /// Kalman update with `observation · state = silhouette's prediction + found ± noise`.
    fn update(&mut self, observation: &Matrix2x4<f64>, found: &Vector2<f64>, noise: &Matrix2<f64>) {
        let Belief { mean, covariance } = &mut self.belief;
        let innovation = observation * *covariance * observation.transpose() + noise;
        let Some(inverse) = innovation.try_inverse() else { return };
        let gain = *covariance * observation.transpose() * inverse;
        *mean += gain * found;
        // Joseph's form keeps the covariance positive semidefinite.
        let rest = Matrix4::identity() - gain * observation;
        let updated = rest * *covariance * rest.transpose() + gain * noise * gain.transpose();
        *covariance = 0.5 * (updated + updated.transpose());
    }

    /// Measurement of the person's place from `measures · (silhouette − predicted silhouette) = found ± noise`, for
    /// the predicted lean.
    fn measurement(
        &self,
        measures: &Matrix2<f64>,
        found: &Vector2<f64>,
        noise: &Matrix2<f64>,
    ) -> Option<Measurement> {
        if measures.norm_squared() == 0.0 {
            return None;
        }
        let weighted = measures.transpose() * noise.try_inverse()?;
        let information = weighted * measures + Matrix2::from_diagonal_element(UNINFORMED_SIGMA_M.powi(-2));
        let covariance = information.try_inverse()?;
        Some(Measurement { place: self.place() + covariance * weighted * found, covariance })
    }
}

/// Log density, 1/m², of a measurement this far from its prediction, with their covariances together: a normal
/// distribution, and with a small weight a wider one, since people deviate from the motion model.
fn log_density(shift: &Vector2<f64>, covariance: &Matrix2<f64>) -> f64 {
    let normal = |covariance: &Matrix2<f64>| {
        let squared = covariance.try_inverse().map_or(0.0, |inverse| shift.dot(&(inverse * shift)));
        -std::f64::consts::TAU.ln() - 0.5 * (covariance.determinant().max(1e-12).ln() + squared)
    };
    let near = normal(covariance) + (1.0 - DEVIATION_WEIGHT).ln();
    let around =
        normal(&(covariance + Matrix2::identity() * DEVIATION_SIGMA_M.powi(2))) + DEVIATION_WEIGHT.ln();
    let larger = near.max(around);
    larger + ((near - larger).exp() + (around - larger).exp()).ln()
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::super::tests::start;
    use super::*;

    #[test]
    fn conditioning_equals_a_kalman_update_with_the_measurement_behind_the_posterior() {
        let prior = start();
        let options = MotionOptions { gait_sigma_m: 0.05, ..MotionOptions::default() };
        let noise = Matrix2::new(0.02, 0.005, 0.005, 0.03);
        let seen = Vector2::new(1.4, 1.7);
        let lean = options.lean_s;
        let h = Matrix2x4::new(1.0, 0.0, lean, 0.0, 0.0, 1.0, 0.0, lean);
        let update = |r: Matrix2<f64>| {
            let s = h * prior.belief.covariance * h.transpose() + r;
            let k = prior.belief.covariance * h.transpose() * s.try_inverse().unwrap();
            (
                prior.belief.mean + k * (seen - h * prior.belief.mean),
                (Matrix4::identity() - k * h) * prior.belief.covariance,
            )
        };
        // Only the belief includes the gait noise.
        let (mean, covariance) = update(noise);
        let sampled: Matrix2<f64> = h * covariance * h.transpose();
        let mut motion = prior.clone();
        motion.condition(&(h * mean), &sampled, &options);

        let (mean, covariance) = update(noise + Matrix2::identity() * 0.0025);
        assert_relative_eq!(motion.belief.mean, mean, epsilon = 1e-9);
        assert_relative_eq!(motion.belief.covariance, covariance, epsilon = 1e-9);

        // The measurement is that of the silhouette, for the predicted lean.
        let measured = motion.measured.unwrap();
        let stands = seen - prior.belief.velocity() * lean;
        assert_relative_eq!(measured.place, stands, epsilon = 2e-3);
        assert_relative_eq!(measured.covariance, noise + Matrix2::identity() * 0.0025, epsilon = 1e-4);
    }

    #[test]
    fn a_posterior_as_wide_as_the_prior_teaches_nothing() {
        let prior = start();
        let mut motion = prior.clone();
        let place = prior.silhouette_place() + Vector2::new(0.03, -0.05);
        motion.condition(&place, &(prior.silhouette_covariance() * 0.95), &MotionOptions::default());
        assert_relative_eq!(motion.belief.mean, prior.belief.mean, epsilon = 1e-9);
        assert_relative_eq!(motion.belief.covariance, prior.belief.covariance, epsilon = 1e-9);
        assert_eq!(motion.measured, None);
    }

    #[test]
    fn a_measurement_far_from_the_prediction_is_believed() {
        let (mut motion, options) = (start(), MotionOptions::default());
        let place = motion.silhouette_place() + Vector2::new(1.5, 0.0);
        motion.measure(&place, &(Matrix2::identity() * 0.001), &options);
        assert!((motion.silhouette_place() - place).norm() < 0.1, "{:?}", motion.belief);
    }
}
