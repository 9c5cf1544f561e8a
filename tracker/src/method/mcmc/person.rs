//! One person of the sampler's state, and what was known of them before this moment.

use nalgebra::{Matrix2, Vector2};
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::options::Spread;
use crate::likelihood::prior::LOG_IMPOSSIBLE;
use crate::silhouette::{Body, Silhouette};

/// Who a person of the state is, within a run. Every proposed birth has a new one.
pub(super) type Key = u64;

/// A person of the state.
#[derive(Debug, Clone)]
pub(super) struct Person {
    pub(super) key: Key,
    pub(super) body: Body,
    /// One a layer, of `body`.
    pub(super) silhouettes: Vec<Silhouette>,
    /// Whether people may disappear where `body` stands.
    pub(super) at_exit: bool,
    /// The belief carried over from the last moment; `None` for somebody born in this one.
    pub(super) known: Option<Known>,
    /// Not yet reported: may vanish anywhere.
    pub(super) tentative: bool,
}

impl Person {
    /// Whether DELETE may take them.
    pub(super) fn may_leave(&self) -> bool {
        self.tentative || self.at_exit
    }

    /// Whether they were born in this moment.
    pub(super) fn is_new(&self) -> bool {
        self.known.is_none()
    }
}

/// What the last moment says about a person now.
#[derive(Debug, Clone)]
pub(super) struct Known {
    pub(super) place: Place,
    pub(super) radius: Spread,
    pub(super) height: Spread,
    /// Log odds of still being there, before looking.
    pub(super) log_odds: f64,
    /// Where a detector's boxes show this person: a proposal, of which the belief knows nothing.
    pub(super) fit: Option<Gaussian>,
}

impl Known {
    /// Log density of a body, given this belief.
    pub(super) fn log_density(&self, body: &Body) -> f64 {
        self.place.log_density(body.x_m, body.y_m)
            + self.radius.log_density(body.radius_m)
            + self.height.log_density(body.height_m)
    }
}

/// Where a person is expected: the prediction, and with a small probability somewhere around it. People trip, and a
/// sampler that has lost somebody must be able to find them again.
#[derive(Debug, Clone)]
pub(super) struct Place {
    near: Gaussian,
    around: Gaussian,
    /// Its outline a few standard deviations out bounds where this person can be.
    farthest: Gaussian,
}

/// Probability that a person is not where they were predicted.
const ASTRAY: f64 = 0.02;
/// How far they are then, metres.
const ASTRAY_SIGMA_M: f64 = 0.5;
/// Nobody is farther away than this many standard deviations of the prediction and of how far they may have gone astray:
/// that is somebody else.
const FARTHEST_SIGMAS: f64 = 3.0;

impl Place {
    /// Around a prediction with this covariance, and nowhere farther than people go astray (one standard deviation).
    pub(super) fn new(mean: Vector2<f64>, covariance: &Matrix2<f64>, astray_m: f64) -> Self {
        let wider = |by_m: f64| Gaussian::new(mean, &(covariance + Matrix2::identity() * by_m.powi(2)));
        Self {
            near: Gaussian::new(mean, covariance),
            around: wider(ASTRAY_SIGMA_M),
            farthest: wider(astray_m),
        }
    }

    /// Covariance of the prediction.
    pub(super) fn covariance(&self) -> Matrix2<f64> {
        self.near.root * self.near.root.transpose()
    }

    /// The prediction.
    pub(super) fn mean(&self) -> Vector2<f64> {
        self.near.mean
    }

    pub(super) fn log_density(&self, x_m: f64, y_m: f64) -> f64 {
        if self.farthest.squared_sigmas(x_m, y_m) > FARTHEST_SIGMAS * FARTHEST_SIGMAS {
            return LOG_IMPOSSIBLE;
        }
        let near = self.near.log_density(x_m, y_m) + (1.0 - ASTRAY).ln();
        let around = self.around.log_density(x_m, y_m) + ASTRAY.ln();
        let larger = near.max(around);
        larger + ((near - larger).exp() + (around - larger).exp()).ln()
    }

    pub(super) fn sample(&self, rng: &mut Pcg64Mcg) -> Vector2<f64> {
        if rng.random::<f64>() < ASTRAY { self.around.sample(rng) } else { self.near.sample(rng) }
    }
}

/// A normal distribution on the floor.
#[derive(Debug, Clone)]
pub(super) struct Gaussian {
    mean: Vector2<f64>,
    inverse: Matrix2<f64>,
    /// Lower triangular root of the covariance.
    root: Matrix2<f64>,
    log_norm: f64,
}

impl Gaussian {
    /// With this mean and covariance. A covariance that is not positive is replaced by a centimetre's.
    pub(super) fn new(mean: Vector2<f64>, covariance: &Matrix2<f64>) -> Self {
        let safe = Matrix2::identity() * 1e-4;
        let (inverse, root) = match (covariance.try_inverse(), covariance.cholesky()) {
            (Some(inverse), Some(cholesky)) => (inverse, cholesky.l()),
            _ => (Matrix2::identity() * 1e4, safe.map(f64::sqrt)),
        };
        let log_norm = -std::f64::consts::TAU.ln() - root.determinant().ln();
        Self { mean, inverse, root, log_norm }
    }

    pub(super) fn log_density(&self, x_m: f64, y_m: f64) -> f64 {
        self.log_norm - 0.5 * self.squared_sigmas(x_m, y_m)
    }

    /// Squared distance from the mean, in standard deviations.
    fn squared_sigmas(&self, x_m: f64, y_m: f64) -> f64 {
        let d = Vector2::new(x_m, y_m) - self.mean;
        d.dot(&(self.inverse * d))
    }

    pub(super) fn sample(&self, rng: &mut Pcg64Mcg) -> Vector2<f64> {
        let z: Vector2<f64> = Vector2::new(rng.sample(StandardNormal), rng.sample(StandardNormal));
        self.mean + self.root * z
    }
}

impl Spread {
    pub(super) fn log_density(&self, value_m: f64) -> f64 {
        let z = (value_m - self.mean_m) / self.sigma_m;
        -0.5 * (z * z + std::f64::consts::TAU.ln()) - self.sigma_m.ln()
    }

    pub(super) fn sample(&self, rng: &mut Pcg64Mcg) -> f64 {
        let z: f64 = rng.sample(StandardNormal);
        self.mean_m + self.sigma_m * z
    }
}
