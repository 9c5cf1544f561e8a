//! Nearly-constant-velocity model: a Kalman filter of position and velocity whose acceleration is white noise (Y.
//! Bar-Shalom, X. R. Li and T. Kirubarajan, "Estimation with Applications to Tracking and Navigation", Wiley 2001,
//! section 6.2.2).

use nalgebra::{Point, SMatrix, SVector};

/// Covariance that white-noise acceleration adds along one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProcessNoise {
    /// Variance of the position, m².
    pub position: f64,
    /// Covariance of position and velocity, m²/s.
    pub cross: f64,
    /// Variance of the velocity, m²/s².
    pub velocity: f64,
}

impl ProcessNoise {
    /// Noise of a step of `dt_s` seconds with an acceleration of this spectral density, m²/s³.
    pub fn over(dt_s: f64, density: f64) -> Self {
        Self {
            position: density * dt_s.powi(3) / 3.0,
            cross: density * dt_s.powi(2) / 2.0,
            velocity: density * dt_s,
        }
    }
}

/// Position and velocity along N axes, with their covariance.
///
/// The covariance is stored as N x N blocks, which needs a quarter of the arithmetic of a 2N x 2N matrix. Any unit of
/// length and of time serves; the units below are those of metres and seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<const N: usize> {
    /// Position, metres.
    pub position: Point<f64, N>,
    /// Velocity, m/s.
    pub velocity: SVector<f64, N>,
    /// Covariance of the position, m².
    pub position_covariance: SMatrix<f64, N, N>,
    /// Covariance of position (rows) and velocity (columns), m²/s.
    pub cross_covariance: SMatrix<f64, N, N>,
    /// Covariance of the velocity, m²/s².
    pub velocity_covariance: SMatrix<f64, N, N>,
}

impl<const N: usize> State<N> {
    /// State after a first measurement of the position with this covariance; `velocity_variance` is that of the
    /// velocity along each axis.
    pub fn new(
        position: Point<f64, N>,
        velocity: SVector<f64, N>,
        position_covariance: SMatrix<f64, N, N>,
        velocity_variance: f64,
    ) -> Self {
        Self {
            position,
            velocity,
            position_covariance,
            cross_covariance: SMatrix::zeros(),
            velocity_covariance: SMatrix::from_diagonal_element(velocity_variance),
        }
    }

    /// Predicts the state `dt_s` seconds ahead; `density` is the spectral density of the acceleration, m²/s³.
    pub fn predict(&mut self, dt_s: f64, density: f64) {
        let noise = ProcessNoise::over(dt_s, density);
        let along = SMatrix::from_diagonal_element;
        let cross = self.cross_covariance;
        self.position += self.velocity * dt_s;
        self.position_covariance += (cross + cross.transpose()) * dt_s
            + self.velocity_covariance * (dt_s * dt_s)
            + along(noise.position);
        self.cross_covariance += self.velocity_covariance * dt_s + along(noise.cross);
        self.velocity_covariance += along(noise.velocity);
    }

    /// Updates the state with a measured position and its covariance. Without an inverse of the innovation covariance
    /// the state stays as it is.
    pub fn update(&mut self, measured: &Point<f64, N>, covariance: &SMatrix<f64, N, N>) {
        let Some(inverse) = (self.position_covariance + covariance).try_inverse() else { return };
        let innovation = measured - self.position;
        let position_gain = self.position_covariance * inverse;
        let velocity_gain = self.cross_covariance.transpose() * inverse;
        self.position += position_gain * innovation;
        self.velocity += velocity_gain * innovation;
        self.velocity_covariance -= velocity_gain * self.cross_covariance;
        self.cross_covariance -= position_gain * self.cross_covariance;
        self.position_covariance -= position_gain * self.position_covariance;
        // Rounding must not make the covariances asymmetric.
        self.position_covariance = (self.position_covariance + self.position_covariance.transpose()) * 0.5;
        self.velocity_covariance = (self.velocity_covariance + self.velocity_covariance.transpose()) * 0.5;
    }

    /// The same state in reversed time.
    #[must_use]
    pub fn reversed(&self) -> Self {
        Self { velocity: -self.velocity, cross_covariance: -self.cross_covariance, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Matrix2x4, Matrix4, Point2, Vector2, Vector4};

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
        let mut blocks = State::new(Point2::new(1.0, 2.0), Vector2::zeros(), r, 1.0);
        let mut state = (Vector4::new(1.0, 2.0, 0.0, 0.0), Matrix4::zeros());
        state.1.fixed_view_mut::<2, 2>(0, 0).copy_from(&r);
        state.1.fixed_view_mut::<2, 2>(2, 2).copy_from(&Matrix2::identity());
        for step in 0..50 {
            let dt = 0.05 + 0.01 * f64::from(step % 7);
            let z = Point2::new(1.0 + 0.1 * f64::from(step), 2.0 + 0.3 * f64::from(step % 3));
            blocks.predict(dt, 0.225);
            blocks.update(&z, &r);
            slow(&mut state, dt, 0.225, &z, &r);
            assert!((blocks.position.coords - state.0.fixed_rows::<2>(0)).norm() < 1e-9);
            assert!((blocks.velocity - state.0.fixed_rows::<2>(2)).norm() < 1e-9);
            assert!((blocks.position_covariance - state.1.fixed_view::<2, 2>(0, 0)).norm() < 1e-9);
        }
    }

    #[test]
    fn a_step_in_two_halves_adds_the_noise_of_the_whole_step() {
        let start = State::new(Point::<f64, 1>::origin(), SVector::zeros(), SMatrix::zeros(), 0.0);
        let (mut halves, mut whole) = (start, start);
        halves.predict(0.2, 1.5);
        halves.predict(0.2, 1.5);
        whole.predict(0.4, 1.5);
        assert!((halves.position_covariance - whole.position_covariance).norm() < 1e-12);
        assert!((halves.cross_covariance - whole.cross_covariance).norm() < 1e-12);
        assert!((halves.velocity_covariance - whole.velocity_covariance).norm() < 1e-12);
    }
}
