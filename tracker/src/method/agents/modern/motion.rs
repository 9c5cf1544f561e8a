//! Motion of one person on the floor: the filter of [`white_noise_acceleration`](mot::white_noise_acceleration),
//! bounded while nobody measures the person.

use std::ops::{Deref, DerefMut};

use mot::white_noise_acceleration::State;
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

/// Place (m) and velocity (m/s) of a person on the floor, with their covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Motion(State<2>);

impl Deref for Motion {
    type Target = State<2>;

    fn deref(&self) -> &State<2> {
        &self.0
    }
}

impl DerefMut for Motion {
    fn deref_mut(&mut self) -> &mut State<2> {
        &mut self.0
    }
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
    pub(super) fn first(position: Point2<f64>, velocity: Vector2<f64>, covariance: Matrix2<f64>) -> Self {
        Self(State::new(position, velocity, covariance, UNKNOWN_SPEED_M_S * UNKNOWN_SPEED_M_S))
    }

    /// Place and velocity: x, y, vx, vy.
    pub(super) fn mean(&self) -> Vector4<f64> {
        Vector4::new(self.position.x, self.position.y, self.velocity.x, self.velocity.y)
    }

    /// Covariance of [`Self::mean`].
    pub(super) fn covariance(&self) -> Matrix4<f64> {
        let mut covariance = Matrix4::zeros();
        covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&self.position_covariance);
        covariance.fixed_view_mut::<2, 2>(0, 2).copy_from(&self.cross_covariance);
        covariance.fixed_view_mut::<2, 2>(2, 0).copy_from(&self.cross_covariance.transpose());
        covariance.fixed_view_mut::<2, 2>(2, 2).copy_from(&self.velocity_covariance);
        covariance
    }

    /// Predicts the state `dt` seconds ahead; `acceleration` is its standard deviation, m/s².
    pub(super) fn walk(&mut self, dt: f64, acceleration: f64) {
        self.predict(dt, acceleration * acceleration * ACCELERATION_LASTS_S);
    }

    /// Slows down an unmeasured person over `dt` seconds and bounds the covariance.
    pub(super) fn slow_down(&mut self, dt: f64) {
        let kept = (-dt / SLOWING_S).exp();
        let State { velocity, position_covariance, cross_covariance, velocity_covariance, .. } = &mut self.0;
        *velocity *= kept;
        *cross_covariance *= kept;
        shrink(position_covariance, cross_covariance, LARGEST_SIGMA_M);
        shrink(velocity_covariance, cross_covariance, LARGEST_SPEED_SIGMA_M_S);
    }

    /// Fit of a measurement to the state; `None` for a singular innovation covariance.
    pub(super) fn fit(&self, measured: &Point2<f64>, covariance: &Matrix2<f64>) -> Option<Fit> {
        let s = self.position_covariance + covariance;
        let determinant = s.determinant();
        if determinant <= 1e-12 {
            return None;
        }
        let v = measured - self.position;
        let distance =
            (s[(1, 1)] * v.x * v.x - 2.0 * s[(0, 1)] * v.x * v.y + s[(0, 0)] * v.y * v.y) / determinant;
        Some(Fit { distance, log_determinant: determinant.ln() })
    }

    /// Squared Mahalanobis distance of two people's places and velocities.
    pub(super) fn distance(&self, other: &Self) -> f64 {
        let covariance = self.covariance() + other.covariance();
        let (place, speed) = (self.position - other.position, self.velocity - other.velocity);
        let difference = Vector4::new(place.x, place.y, speed.x, speed.y);
        // A covariance that rounding has made indefinite discriminates nothing.
        covariance.cholesky().map_or(0.0, |c| difference.dot(&c.solve(&difference)))
    }

    /// Standard deviation of the place, metres: the mean over directions.
    pub(super) fn sigma_m(&self) -> f64 {
        (self.position_covariance.trace() / 2.0).max(0.0).sqrt()
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
    use super::*;

    #[test]
    fn the_covariance_of_an_unmeasured_person_is_bounded() {
        let mut motion = Motion::first(Point2::origin(), Vector2::new(1.5, 0.0), Matrix2::identity() * 0.1);
        for _ in 0..6000 {
            motion.walk(0.1, 1.5);
            motion.slow_down(0.1);
        }
        assert!(motion.sigma_m() <= LARGEST_SIGMA_M + 1e-9);
        assert!(motion.velocity.norm() < 1e-6);
        assert!(motion.position.x < 3.0);
    }
}
