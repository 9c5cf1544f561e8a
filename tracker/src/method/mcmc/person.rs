//! One person of the sampler's state, and the person's prior by the last moment.

use nalgebra::{Matrix2, Vector2};
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::options::Spread;
use super::posture::SizePrior;
use super::vector_places::VectorPlaces;
use crate::likelihood::prior::LOG_IMPOSSIBLE;
use crate::silhouette::{Body, Silhouette};

/// Key of a person of the state, unique within a run. Every proposed birth has a new one.
pub(super) type Key = u64;

/// Person of the state.
#[derive(Debug, Clone)]
pub(super) struct Person {
    pub(super) key: Key,
    pub(super) body: Body,
    /// Silhouettes of `body`, one a layer.
    pub(super) silhouettes: Vec<Silhouette>,
    /// Whether people may disappear where `body` stands.
    pub(super) at_exit: bool,
    /// Prior by the last moment; `None` for a person born in this one.
    pub(super) known: Option<Known>,
    /// Whether DELETE may remove the person outside exit zones, too: the track is unconfirmed or doubtful.
    pub(super) tentative: bool,
}

impl Person {
    /// Whether DELETE may remove the person.
    pub(super) fn may_leave(&self) -> bool {
        self.tentative || self.at_exit
    }

    /// Whether the person was born in this moment.
    pub(super) fn is_new(&self) -> bool {
        self.known.is_none()
    }
}

/// Prior of a person at this moment, by the last one.
#[derive(Debug, Clone)]
pub(super) struct Known {
    pub(super) place: Place,
    pub(super) size: SizePrior,
    /// Log odds of existence before this moment's observations.
    pub(super) log_odds: f64,
    /// Place by a detector's boxes, which UPDATE-P proposes from; no part of the prior.
    pub(super) fit: Option<Gaussian>,
    /// Likelihood of the appearance vectors seen at places, for this person.
    pub(super) vectors: VectorPlaces,
}

impl Known {
    /// Log density of a body under this prior, times the likelihood of the appearance vectors there.
    pub(super) fn log_density(&self, body: &Body) -> f64 {
        self.place.log_density(body.x_m, body.y_m)
            + self.size.log_density(body)
            + self.vectors.log_likelihood(body.x_m, body.y_m)
    }
}

/// Prior of a person's place: the predicted normal distribution, mixed with a wider one of small weight, cut off at a
/// gate. People deviate from the motion model, and the sampler must be able to find a lost person again.
#[derive(Debug, Clone)]
pub(super) struct Place {
    near: Gaussian,
    around: Gaussian,
    /// Distribution of the gate, which ends at [`GATE_SIGMAS`] of its standard deviations.
    gate: Gaussian,
}

/// Weight of the wider distribution: the probability that a person deviates from the motion model.
pub(super) const DEVIATION_WEIGHT: f64 = 0.02;
/// Standard deviation of that deviation, metres.
pub(super) const DEVIATION_SIGMA_M: f64 = 0.5;
/// Gate in standard deviations of the prediction and the deviation together: a person farther away is another one.
const GATE_SIGMAS: f64 = 3.0;

impl Place {
    /// Prior around a prediction with this covariance (m²); `deviation_m` is the standard deviation, metres, by which
    /// the gate is wider than the prediction.
    pub(super) fn new(mean: Vector2<f64>, covariance: &Matrix2<f64>, deviation_m: f64) -> Self {
        let wider = |by_m: f64| Gaussian::new(mean, &(covariance + Matrix2::identity() * by_m.powi(2)));
        Self {
            near: Gaussian::new(mean, covariance),
            around: wider(DEVIATION_SIGMA_M),
            gate: wider(deviation_m),
        }
    }

    /// Covariance of the prediction, m².
    pub(super) fn covariance(&self) -> Matrix2<f64> {
        self.near.root * self.near.root.transpose()
    }

    /// Predicted place, metres.
    pub(super) fn mean(&self) -> Vector2<f64> {
        self.near.mean
    }

    pub(super) fn log_density(&self, x_m: f64, y_m: f64) -> f64 {
        if self.gate.squared_sigmas(x_m, y_m) > GATE_SIGMAS * GATE_SIGMAS {
            return LOG_IMPOSSIBLE;
        }
        let near = self.near.log_density(x_m, y_m) + (1.0 - DEVIATION_WEIGHT).ln();
        let around = self.around.log_density(x_m, y_m) + DEVIATION_WEIGHT.ln();
        let larger = near.max(around);
        larger + ((near - larger).exp() + (around - larger).exp()).ln()
    }

    pub(super) fn sample(&self, rng: &mut Pcg64Mcg) -> Vector2<f64> {
        if rng.random::<f64>() < DEVIATION_WEIGHT { self.around.sample(rng) } else { self.near.sample(rng) }
    }
}

/// Normal distribution over places on the floor.
#[derive(Debug, Clone)]
pub(super) struct Gaussian {
    mean: Vector2<f64>,
    inverse: Matrix2<f64>,
    /// Lower triangular Cholesky factor of the covariance.
    root: Matrix2<f64>,
    log_norm: f64,
}

impl Gaussian {
    /// Normal distribution with this mean and covariance. A covariance that is not positive definite is replaced by
    /// that of 1 cm standard deviation.
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
