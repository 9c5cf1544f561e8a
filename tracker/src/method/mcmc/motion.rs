//! Prediction (seed 001, equation 1), with what it does not know.
//!
//! A person's velocity is an Ornstein–Uhlenbeck process: remembered for `velocity_memory_s`, pushed by white
//! acceleration. Place and velocity are a 4-vector with covariance, carried from moment to moment over any time step;
//! with infinite memory its mean is the published `S + V`. The sampler works on the place alone; its posterior mean and
//! covariance are taken back exactly as a Gaussian's: velocity follows through its regression on the place.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

use super::options::MotionOptions;

/// Place (m) and velocity (m/s) on the floor, with their covariance. Order: x, y, vx, vy.
#[derive(Debug, Clone)]
pub(super) struct Motion {
    pub(super) mean: Vector4<f64>,
    pub(super) covariance: Matrix4<f64>,
}

impl Motion {
    /// Somebody who has just appeared: place known with this covariance, velocity not at all.
    pub(super) fn appeared(place: Vector2<f64>, covariance: &Matrix2<f64>, options: &MotionOptions) -> Self {
        let mut all = Matrix4::from_diagonal_element(options.initial_speed_sigma.powi(2));
        all.fixed_view_mut::<2, 2>(0, 0).copy_from(covariance);
        all.fixed_view_mut::<2, 2>(0, 2).fill(0.0);
        all.fixed_view_mut::<2, 2>(2, 0).fill(0.0);
        Self { mean: Vector4::new(place.x, place.y, 0.0, 0.0), covariance: all }
    }

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

    /// Carries the belief `dt_s` seconds on.
    pub(super) fn predict(&mut self, dt_s: f64, options: &MotionOptions) {
        let beta = 1.0 / options.velocity_memory_s;
        // How much of the velocity is left, and how far it carries.
        let left = (-beta * dt_s).exp();
        let carries = if beta * dt_s < 1e-6 { dt_s } else { (1.0 - left) / beta };
        let mut step = Matrix4::identity();
        let mut noise = Matrix4::zeros();
        // White acceleration over a step that is short against the memory.
        let q = options.acceleration_density;
        let (pp, pv, vv) = (q * dt_s.powi(3) / 3.0, q * dt_s.powi(2) / 2.0, q * dt_s);
        for axis in 0..2 {
            step[(axis, axis + 2)] = carries;
            step[(axis + 2, axis + 2)] = left;
            noise[(axis, axis)] = pp;
            noise[(axis, axis + 2)] = pv;
            noise[(axis + 2, axis)] = pv;
            noise[(axis + 2, axis + 2)] = vv;
        }
        self.mean = step * self.mean;
        self.covariance = step * self.covariance * step.transpose() + noise;
    }

    /// Takes in the posterior of the place: its mean and covariance, this belief having been the prior.
    pub(super) fn condition(&mut self, place: &Vector2<f64>, covariance: &Matrix2<f64>) {
        let prior: Matrix2<f64> = self.place_covariance();
        let cross: Matrix2<f64> = self.covariance.fixed_view::<2, 2>(2, 0).into();
        let Some(inverse) = prior.try_inverse() else { return };
        let gain = cross * inverse;
        let shift = place - self.place();
        let velocity = self.velocity() + gain * shift;
        let velocity_covariance: Matrix2<f64> = self.covariance.fixed_view::<2, 2>(2, 2).into();
        let velocity_covariance = velocity_covariance - gain * (prior - covariance) * gain.transpose();
        let cross = gain * covariance;
        self.mean = Vector4::new(place.x, place.y, velocity.x, velocity.y);
        self.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(covariance);
        self.covariance.fixed_view_mut::<2, 2>(2, 0).copy_from(&cross);
        self.covariance.fixed_view_mut::<2, 2>(0, 2).copy_from(&cross.transpose());
        self.covariance.fixed_view_mut::<2, 2>(2, 2).copy_from(&velocity_covariance);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn start() -> Motion {
        let options = MotionOptions::default();
        let mut motion = Motion::appeared(Vector2::new(1.0, 2.0), &(Matrix2::identity() * 0.01), &options);
        motion.mean[2] = 0.7;
        motion.mean[3] = -0.4;
        motion.predict(0.3, &options);
        motion
    }

    #[test]
    fn with_infinite_memory_the_prediction_is_the_published_one() {
        let options = MotionOptions { velocity_memory_s: f64::INFINITY, ..MotionOptions::default() };
        let mut motion = Motion::appeared(Vector2::new(1.0, 2.0), &Matrix2::identity(), &options);
        motion.mean[2] = 0.7;
        motion.mean[3] = -0.4;
        motion.predict(0.5, &options);
        assert_relative_eq!(motion.mean, Vector4::new(1.35, 1.8, 0.7, -0.4), epsilon = 1e-12);
    }

    #[test]
    fn conditioning_on_a_posterior_equals_a_kalman_update_with_the_measurement_behind_it() {
        let prior = start();
        let noise = Matrix2::new(0.02, 0.005, 0.005, 0.03);
        let seen = Vector2::new(1.4, 1.7);
        // The textbook's update.
        let h = nalgebra::Matrix2x4::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0);
        let s = h * prior.covariance * h.transpose() + noise;
        let k = prior.covariance * h.transpose() * s.try_inverse().unwrap();
        let mean = prior.mean + k * (seen - h * prior.mean);
        let covariance = (Matrix4::identity() - k * h) * prior.covariance;

        let mut motion = prior;
        let posterior: Matrix2<f64> = covariance.fixed_view::<2, 2>(0, 0).into();
        motion.condition(&Vector2::new(mean[0], mean[1]), &posterior);
        assert_relative_eq!(motion.mean, mean, epsilon = 1e-9);
        assert_relative_eq!(motion.covariance, covariance, epsilon = 1e-9);
    }

    #[test]
    fn unseen_people_become_uncertain_and_stop_walking() {
        let (mut motion, options) = (start(), MotionOptions::default());
        let before = motion.place_covariance().trace();
        for _ in 0..120 {
            motion.predict(1.0 / 12.0, &options);
        }
        assert!(motion.place_covariance().trace() > before + 1.0);
        assert!(motion.velocity().norm() < 0.05);
    }
}
