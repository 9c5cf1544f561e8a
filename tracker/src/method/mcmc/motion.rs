//! Motion model: prediction (equation 1 of the paper cited in [`super`]) with its uncertainty, and measurement
//! update.
//!
//! A person's velocity is an Ornstein–Uhlenbeck process: it decays over a memory time and is driven by white
//! acceleration. Place and velocity form a 4-vector with covariance, which is predicted over any time step; with
//! infinite memory its mean is the published `S + V`. The sampler works on the place of the silhouette alone; the
//! information of its posterior beyond the prediction updates the state as a measurement of that place.
//!
//! A walking person leans forward: head and trunk, which make up most of the silhouette, are ahead of the pelvis by
//! about `lean_s` times the velocity. The silhouette therefore stands at `C · state`, with `C = [I, lean_s · I]`, and
//! the reported place is that of the person.

use std::ops::AddAssign;

use nalgebra::{Matrix2, Matrix2x4, Matrix4, Vector2, Vector4};

use super::options::MotionOptions;
use super::person::{DEVIATION_SIGMA_M, DEVIATION_WEIGHT};

/// Squared Mahalanobis distance from the prediction above which the prediction is not trusted: one in a thousand by
/// chance.
const OUTLIER_SQUARED_SIGMAS: f64 = 13.8;
/// Longest part of a step, as a fraction of the velocity's memory.
const LONGEST_PART: f64 = 0.25;
/// Largest number of parts of one step.
const MOST_PARTS: f64 = 1000.0;
/// Standard deviation of a measurement along an axis without information, metres.
const UNINFORMED_SIGMA_M: f64 = 5.0;
/// Ratio of posterior to prior variance above which an axis has no information but the sampler's own noise.
const UNINFORMED_VARIANCE_RATIO: f64 = 0.9;

/// Place (m) and velocity (m/s) on the floor, with their covariance. Order: x, y, vx, vy.
#[derive(Debug, Clone)]
pub(super) struct Belief {
    pub(super) mean: Vector4<f64>,
    pub(super) covariance: Matrix4<f64>,
}

impl Belief {
    pub(super) fn place(&self) -> Vector2<f64> {
        self.mean.fixed_rows::<2>(0).into()
    }

    pub(super) fn velocity(&self) -> Vector2<f64> {
        self.mean.fixed_rows::<2>(2).into()
    }

    /// Covariance of the place.
    pub(super) fn place_covariance(&self) -> Matrix2<f64> {
        self.covariance.fixed_view::<2, 2>(0, 0).into()
    }
}

/// Prediction step from the moment before to this one.
#[derive(Debug, Clone)]
pub(super) struct Step {
    pub(super) transition: Matrix4<f64>,
    /// Belief predicted for this moment, before its observations.
    pub(super) predicted: Belief,
}

/// Measurement of a person's place by one moment alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measurement {
    pub(super) place: Vector2<f64>,
    /// Covariance, m²; the standard deviation is [`UNINFORMED_SIGMA_M`] along an axis without information.
    pub(super) covariance: Matrix2<f64>,
}

/// Place and velocity of a person over time.
#[derive(Debug, Clone)]
pub(super) struct Motion {
    pub(super) belief: Belief,
    /// Measurement behind the last posterior; `None` when the moment had no information.
    pub(super) measured: Option<Measurement>,
    /// Step from the moment before; `None` for a person who has just appeared.
    pub(super) arrived: Option<Step>,
    /// Log density of the last measurement under its prediction; 0 without one.
    pub(super) log_evidence: f64,
    lean_s: f64,
}

impl Motion {
    /// Motion of a person who has just appeared: place known with this covariance (m²), velocity unknown.
    pub(super) fn appeared(place: Vector2<f64>, covariance: &Matrix2<f64>, options: &MotionOptions) -> Self {
        let mut all = Matrix4::from_diagonal_element(options.initial_speed_sigma.powi(2));
        all.fixed_view_mut::<2, 2>(0, 0).copy_from(covariance);
        all.fixed_view_mut::<2, 2>(0, 2).fill(0.0);
        all.fixed_view_mut::<2, 2>(2, 0).fill(0.0);
        let belief = Belief { mean: Vector4::new(place.x, place.y, 0.0, 0.0), covariance: all };
        let measured = Some(Measurement { place, covariance: *covariance });
        Self { belief, measured, arrived: None, log_evidence: 0.0, lean_s: options.lean_s }
    }

    pub(super) fn place(&self) -> Vector2<f64> {
        self.belief.place()
    }

    /// Place of the person's silhouette, metres: an upright person standing there would have the same one.
    pub(super) fn silhouette_place(&self) -> Vector2<f64> {
        self.place() + self.belief.velocity() * self.lean_s
    }

    /// Covariance of [`Self::silhouette_place`].
    pub(super) fn silhouette_covariance(&self) -> Matrix2<f64> {
        let c = self.silhouette_from_state();
        c * self.belief.covariance * c.transpose()
    }

    /// Matrix C: silhouette's place from the state.
    fn silhouette_from_state(&self) -> Matrix2x4<f64> {
        let l = self.lean_s;
        Matrix2x4::new(1.0, 0.0, l, 0.0, 0.0, 1.0, 0.0, l)
    }

    /// Predicts the belief `dt_s` seconds ahead, for a person in sight or not. A step that is long against the memory
    /// of the velocity is divided into parts, over each of which the acceleration is white.
    pub(super) fn predict(&mut self, dt_s: f64, in_sight: bool, options: &MotionOptions) {
        let memory_s = if in_sight { options.velocity_memory_s } else { options.unseen_velocity_memory_s };
        let parts = (dt_s / (LONGEST_PART * memory_s)).ceil().clamp(1.0, MOST_PARTS);
        let (step, noise) = carried(dt_s / parts, memory_s, options.acceleration_density);
        let mut transition = Matrix4::identity();
        for _ in 0..parts as u32 {
            transition = step * transition;
            self.belief.mean = step * self.belief.mean;
            self.belief.covariance = step * self.belief.covariance * step.transpose() + noise;
        }
        self.arrived = Some(Step { transition, predicted: self.belief.clone() });
        (self.measured, self.log_evidence) = (None, 0.0);
    }

    /// Stops the person at this place: the predicted movement did not happen.
    pub(super) fn halt(&mut self, place: Vector2<f64>) {
        self.belief.mean = Vector4::new(place.x, place.y, 0.0, 0.0);
        if let Some(step) = &mut self.arrived {
            step.predicted.mean = self.belief.mean;
        }
    }

    /// Updates the belief by the sampler's posterior of the silhouette's place (mean in metres, covariance in m²), of
    /// which this belief was the prior.
    ///
    /// The likelihood behind that posterior is `N(z, R)` with `R⁻¹ = Σ⁻¹ − P⁻¹`. The offset between silhouette and
    /// person (`gait_sigma_m`) is added to R, and the belief updated with the sum. Directions without information (Σ
    /// as wide as P: the person is hidden) have no R⁻¹, and stay as predicted.
    pub(super) fn condition(
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
}

impl Motion {
    /// Updates the belief by a measurement of the silhouette's place (metres) with this covariance (m²), which does
    /// not depend on the prediction.
    pub(super) fn measure(
        &mut self,
        place: &Vector2<f64>,
        covariance: &Matrix2<f64>,
        options: &MotionOptions,
    ) {
        self.observe(place, &(covariance + Matrix2::identity() * options.gait_sigma_m.powi(2)));
    }

    /// Updates the belief by a measurement of the silhouette's place (metres) whose covariance (m²) includes the offset
    /// between silhouette and person.
    fn observe(&mut self, place: &Vector2<f64>, noise: &Matrix2<f64>) {
        let shift = place - self.silhouette_place();
        self.log_evidence = log_density(&shift, &(self.silhouette_covariance() + noise));
        self.inflate_prediction(&shift, noise);
        self.measured = self.measurement(&Matrix2::identity(), &shift, noise);
        self.update(&self.silhouette_from_state(), &shift, noise);
    }

    /// Motion `dt_s` seconds later, had the person been where this measurement of another track is; `in_sight` at the
    /// earlier moment.
    pub(super) fn continued(
        &self,
        dt_s: f64,
        in_sight: bool,
        measured: Option<&Measurement>,
        options: &MotionOptions,
    ) -> Self {
        let mut motion = self.clone();
        motion.predict(dt_s, in_sight, options);
        if let Some(Measurement { place, covariance }) = measured {
            motion.observe(&(place + motion.belief.velocity() * motion.lean_s), covariance);
        }
        motion
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

/// Transition matrix over a step that is short against the memory of the velocity, and the covariance added by white
/// acceleration of this density (m²/s³).
fn carried(dt_s: f64, memory_s: f64, density: f64) -> (Matrix4<f64>, Matrix4<f64>) {
    let beta = 1.0 / memory_s;
    // Remaining fraction of the velocity, and distance per unit of velocity.
    let left = (-beta * dt_s).exp();
    let carries = if beta * dt_s < 1e-6 { dt_s } else { (1.0 - left) / beta };
    let (pp, pv, vv) = (density * dt_s.powi(3) / 3.0, density * dt_s.powi(2) / 2.0, density * dt_s);
    let mut step = Matrix4::identity();
    let mut noise = Matrix4::zeros();
    for axis in 0..2 {
        step[(axis, axis + 2)] = carries;
        step[(axis + 2, axis + 2)] = left;
        noise[(axis, axis)] = pp;
        noise[(axis, axis + 2)] = pv;
        noise[(axis + 2, axis)] = pv;
        noise[(axis + 2, axis + 2)] = vv;
    }
    (step, noise)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn start() -> Motion {
        let options = MotionOptions::default();
        let mut motion = Motion::appeared(Vector2::new(1.0, 2.0), &(Matrix2::identity() * 0.01), &options);
        motion.belief.mean[2] = 0.7;
        motion.belief.mean[3] = -0.4;
        motion.predict(0.3, true, &options);
        motion
    }

    #[test]
    fn with_infinite_memory_the_prediction_is_the_published_one() {
        let options = MotionOptions { velocity_memory_s: f64::INFINITY, ..MotionOptions::default() };
        let mut motion = Motion::appeared(Vector2::new(1.0, 2.0), &Matrix2::identity(), &options);
        motion.belief.mean[2] = 0.7;
        motion.belief.mean[3] = -0.4;
        motion.predict(0.5, true, &options);
        assert_relative_eq!(motion.belief.mean, Vector4::new(1.35, 1.8, 0.7, -0.4), epsilon = 1e-12);
    }

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

    #[test]
    fn unseen_people_become_uncertain_and_stop_walking() {
        let (mut motion, options) = (start(), MotionOptions::default());
        let before = motion.belief.place_covariance().trace();
        for _ in 0..120 {
            motion.predict(1.0 / 12.0, false, &options);
        }
        assert!(motion.belief.place_covariance().trace() > before + 1.0);
        assert!(motion.belief.velocity().norm() < 0.05);
    }

    /// Variance of a known place in the Ornstein–Uhlenbeck process in closed form (Uhlenbeck & Ornstein 1930).
    #[test]
    fn people_wander_over_minutes_as_far_as_the_process_says() {
        let options = MotionOptions::default();
        for (seconds, in_sight) in [(10.0, false), (120.0, true), (400.0, false)] {
            let memory_s =
                if in_sight { options.velocity_memory_s } else { options.unseen_velocity_memory_s };
            let mut motion = Motion::appeared(Vector2::zeros(), &(Matrix2::identity() * 1e-4), &options);
            motion.belief.covariance.fixed_view_mut::<2, 2>(2, 2).fill(0.0);
            motion.predict(seconds, in_sight, &options);
            let (once, twice) = ((-seconds / memory_s).exp(), (-2.0 * seconds / memory_s).exp());
            let way_s = seconds - 2.0 * memory_s * (1.0 - once) + 0.5 * memory_s * (1.0 - twice);
            let variance = options.acceleration_density * memory_s.powi(2) * way_s;
            // Parts of a quarter of the memory overestimate the effect of the acceleration slightly.
            let found = motion.belief.covariance[(0, 0)] / variance;
            assert!((0.95..1.3).contains(&found), "{seconds} s: {found}");
        }
    }
}
