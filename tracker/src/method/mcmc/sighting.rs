//! The place at which the masks last showed a person, and the density of the person's place some time later.

use std::f64::consts::TAU;

use nalgebra::{Matrix2, Vector2};

use super::motion::Motion;
use super::options::MotionOptions;

/// Place and motion of a person at the last moment whose masks showed them.
#[derive(Debug, Clone)]
pub(super) struct Sighting {
    pub(super) time_s: f64,
    pub(super) motion: Motion,
    /// Whether the person was in an exit zone, or close to one.
    pub(super) at_exit: bool,
}

impl Sighting {
    /// Log density of this person's place at a later time, 1/m².
    pub(super) fn log_density(&self, place: &Vector2<f64>, time_s: f64, options: &MotionOptions) -> f64 {
        let mut motion = self.motion.clone();
        motion.predict(time_s - self.time_s, false, options);
        let covariance: Matrix2<f64> = motion.silhouette_covariance();
        let away = place - motion.silhouette_place();
        // A covariance of motion over some time has an inverse; without one, the place says nothing.
        let Some(inverse) = covariance.try_inverse() else { return f64::NEG_INFINITY };
        -0.5 * away.dot(&(inverse * away)) - TAU.ln() - 0.5 * covariance.determinant().ln()
    }
}
