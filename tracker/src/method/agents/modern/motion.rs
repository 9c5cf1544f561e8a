//! Constant-velocity Kalman filter of one person on the floor.
//!
//! The covariance is stored as 2 x 2 blocks, which needs a quarter of the arithmetic of a 4 x 4 matrix.

use nalgebra::{Matrix2, Matrix4, Point2, Vector2, Vector4};

/// Correlation time of the acceleration, seconds: one frame of the published simulation.
const ACCELERATION_LASTS_S: f64 = 0.1;
/// Standard deviation of a new person's velocity, m/s.
const UNKNOWN_SPEED_M_S: f64 = 1.0;
/// Time constant at which the velocity of an unmeasured person decays, seconds.
const SLOWING_S: f64 = 1.5;
/// Largest standard deviation of an unmeasured person's place, metres.
const LARGEST_SIGMA_M: f64 = 3.0;
/// Largest standard deviation of an unmeasured person's velocity, m/s.
const LARGEST_SPEED_SIGMA_M_S: f64 = 1.5;

/// Place and velocity of a person, with their covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Motion {
    /// Place on the floor, metres.
    pub(super) position: Point2<f64>,
    /// Velocity, m/s.
    pub(super) velocity: Vector2<f64>,
    /// Covariance of the place, m².
    pub(super) place: Matrix2<f64>,
    /// Covariance of place (rows) and velocity (columns), m²/s.
    cross: Matrix2<f64>,
    /// Covariance of the velocity, m²/s².
    speed: Matrix2<f64>,
}

/// Fit of a measurement to a prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    /// Square of the Mahalanobis distance.
    pub(super) distance: f64,
    /// Natural logarithm of the determinant of the innovation covariance, which is in m⁴.
    pub(super) log_determinant: f64,
}

impl Motion {
    /// Initialises the state from a person's first measurement.
    pub(super) fn new(position: Point2<f64>, velocity: Vector2<f64>, covariance: Matrix2<f64>) -> Self {
        Self {
            position,
            velocity,
            place: covariance,
            cross: Matrix2::zeros(),
            speed: Matrix2::identity() * (UNKNOWN_SPEED_M_S * UNKNOWN_SPEED_M_S),
        }
    }

    /// Place and velocity: x, y, vx, vy.
    pub(super) fn mean(&self) -> Vector4<f64> {
        Vector4::new(self.position.x, self.position.y, self.velocity.x, self.velocity.y)
    }

    /// Covariance of [`Self::mean`].
    pub(super) fn covariance(&self) -> Matrix4<f64> {
        let mut covariance = Matrix4::zeros();
        covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&self.place);
        covariance.fixed_view_mut::<2, 2>(0, 2).copy_from(&self.cross);
        covariance.fixed_view_mut::<2, 2>(2, 0).copy_from(&self.cross.transpose());
        covariance.fixed_view_mut::<2, 2>(2, 2).copy_from(&self.speed);
        covariance
    }

    /// Predicts the state `dt` seconds ahead; `acceleration` is its standard deviation, m/s².
    pub(super) fn predict(&mut self, dt: f64, acceleration: f64) {
        // Spectral density of the acceleration, m²/s³.
        let density = acceleration * acceleration * ACCELERATION_LASTS_S;
        let eye = Matrix2::identity();
        self.position += self.velocity * dt;
        self.place += (self.cross + self.cross.transpose()) * dt
            + self.speed * (dt * dt)
            + eye * (density * dt * dt * dt / 3.0);
        self.cross += self.speed * dt + eye * (density * dt * dt / 2.0);
        self.speed += eye * (density * dt);
    }

    /// Slows down an unmeasured person over `dt` seconds and bounds the covariance.
    pub(super) fn slow_down(&mut self, dt: f64) {
        let kept = (-dt / SLOWING_S).exp();
        self.velocity *= kept;
        self.cross *= kept;
        shrink(&mut self.place, &mut self.cross, LARGEST_SIGMA_M);
        shrink(&mut self.speed, &mut self.cross, LARGEST_SPEED_SIGMA_M_S);
    }

    /// Fit of a measurement to the state; `None` for a singular innovation covariance.
    pub(super) fn fit(&self, measured: &Point2<f64>, covariance: &Matrix2<f64>) -> Option<Fit> {
        let s = self.place + covariance;
        let determinant = s.determinant();
        if determinant <= 1e-12 {
            return None;
        }
        let v = measured - self.position;
        let distance =
            (s[(1, 1)] * v.x * v.x - 2.0 * s[(0, 1)] * v.x * v.y + s[(0, 0)] * v.y * v.y) / determinant;
        Some(Fit { distance, log_determinant: determinant.ln() })
    }

    /// Updates the state with a measured place, metres, and its covariance, m².
    pub(super) fn update(&mut self, measured: &Point2<f64>, covariance: &Matrix2<f64>) {
        let Some(inverse) = (self.place + covariance).try_inverse() else { return };
        let v = measured - self.position;
        let place_gain = self.place * inverse;
        let speed_gain = self.cross.transpose() * inverse;
        self.position += place_gain * v;
        self.velocity += speed_gain * v;
        self.speed -= speed_gain * self.cross;
        self.cross -= place_gain * self.cross;
        self.place -= place_gain * self.place;
        self.place = (self.place + self.place.transpose()) * 0.5;
        self.speed = (self.speed + self.speed.transpose()) * 0.5;
    }

    /// Squared Mahalanobis distance of two people's places and velocities.
    pub(super) fn distance(&self, other: &Self) -> f64 {
        let mut covariance = Matrix4::zeros();
        covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&(self.place + other.place));
        covariance.fixed_view_mut::<2, 2>(0, 2).copy_from(&(self.cross + other.cross));
        covariance.fixed_view_mut::<2, 2>(2, 0).copy_from(&(self.cross + other.cross).transpose());
        covariance.fixed_view_mut::<2, 2>(2, 2).copy_from(&(self.speed + other.speed));
        let (place, speed) = (self.position - other.position, self.velocity - other.velocity);
        let difference = Vector4::new(place.x, place.y, speed.x, speed.y);
        // A covariance that rounding has made indefinite discriminates nothing.
        covariance.cholesky().map_or(0.0, |c| difference.dot(&c.solve(&difference)))
    }

    /// Standard deviation of the place, metres: the mean over directions.
    pub(super) fn sigma_m(&self) -> f64 {
        (self.place.trace() / 2.0).max(0.0).sqrt()
    }
}

/// Scales a covariance, and its cross-covariance, down to a largest standard deviation.
fn shrink(covariance: &mut Matrix2<f64>, cross: &mut Matrix2<f64>, largest_sigma: f64) {
    let limit = 2.0 * largest_sigma * largest_sigma;
    let trace = covariance.trace();
    if trace > limit {
        *covariance *= limit / trace;
        *cross *= (limit / trace).sqrt();
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2x4, SMatrix};

    use super::*;

    /// Reference implementation of one prediction and update with 4 x 4 matrices.
    fn slow(state: &mut (Vector4<f64>, Matrix4<f64>), dt: f64, q: f64, z: &Point2<f64>, r: &Matrix2<f64>) {
        let mut f = Matrix4::identity();
        f[(0, 2)] = dt;
        f[(1, 3)] = dt;
        let mut noise = Matrix4::zeros();
        for i in 0..2 {
            noise[(i, i)] = q * dt.powi(3) / 3.0;
            noise[(i, i + 2)] = q * dt * dt / 2.0;
            noise[(i + 2, i)] = q * dt * dt / 2.0;
            noise[(i + 2, i + 2)] = q * dt;
        }
        let x = f * state.0;
        let p = f * state.1 * f.transpose() + noise;
        let h = Matrix2x4::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0);
        let gain: SMatrix<f64, 4, 2> = p * h.transpose() * (h * p * h.transpose() + r).try_inverse().unwrap();
        state.0 = x + gain * (z.coords - h * x);
        state.1 = (Matrix4::identity() - gain * h) * p;
    }

    #[test]
    fn block_updates_equal_those_of_the_whole_matrix() {
        let r = Matrix2::new(0.12, 0.03, 0.03, 0.05);
        let mut motion = Motion::new(Point2::new(1.0, 2.0), Vector2::zeros(), r);
        let mut state = (Vector4::new(1.0, 2.0, 0.0, 0.0), Matrix4::zeros());
        state.1.fixed_view_mut::<2, 2>(0, 0).copy_from(&r);
        state.1.fixed_view_mut::<2, 2>(2, 2).copy_from(&Matrix2::identity());
        for step in 0..50 {
            let dt = 0.05 + 0.01 * f64::from(step % 7);
            let z = Point2::new(1.0 + 0.1 * f64::from(step), 2.0 + 0.3 * f64::from(step % 3));
            motion.predict(dt, 1.5);
            motion.update(&z, &r);
            slow(&mut state, dt, 1.5 * 1.5 * 0.1, &z, &r);
            assert!((motion.position.coords - state.0.fixed_rows::<2>(0)).norm() < 1e-9);
            assert!((motion.velocity - state.0.fixed_rows::<2>(2)).norm() < 1e-9);
            assert!((motion.place - state.1.fixed_view::<2, 2>(0, 0)).norm() < 1e-9);
        }
    }

    #[test]
    fn the_covariance_of_an_unmeasured_person_is_bounded() {
        let mut motion = Motion::new(Point2::origin(), Vector2::new(1.5, 0.0), Matrix2::identity() * 0.1);
        for _ in 0..6000 {
            motion.predict(0.1, 1.5);
            motion.slow_down(0.1);
        }
        assert!(motion.sigma_m() <= LARGEST_SIGMA_M + 1e-9);
        assert!(motion.velocity.norm() < 1e-6);
        assert!(motion.position.x < 3.0);
    }
}
