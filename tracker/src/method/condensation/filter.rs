//! Particle filter of one person (section 2.1, equations 1 to 3): hypotheses of the head's position are predicted,
//! weighed and resampled.
//!
//! A moment has several layers (annealing; J. Deutscher, A. Blake and I. Reid, "Articulated body motion capture by
//! annealed particle filtering", CVPR 2000): each resamples around the best hypotheses of the one before with half the
//! spread. With one layer this is CONDENSATION as published.

use nalgebra::Vector3;
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::exclusion::HeadDistribution;
use super::integration::CameraWeights;
use super::step_times::StepTimes;
use super::weight::{HeadSupport, WeighingInput};

/// Every how many hypotheses one is predicted with a larger step: people stop and turn suddenly.
const ASTRAY_EVERY: usize = 8;
/// Factor of the larger step.
const ASTRAY: f64 = 3.0;

/// Set of weighted hypotheses. Metres, room frame.
#[derive(Debug, Clone)]
pub struct HeadFilter {
    /// s: positions of the head's centre.
    pub hypotheses: Vec<Vector3<f64>>,
    /// π, not negative; they need not sum to 1.
    pub weights: Vec<f64>,
    /// Index of the hypothesis with the largest weight in the latest weighing.
    best: usize,
    predicted: Vec<Vector3<f64>>,
    drawn: Vec<Vector3<f64>>,
    weights_by_camera: Vec<CameraWeights>,
}

impl HeadFilter {
    /// `count` hypotheses around a place.
    pub fn around(place: &Vector3<f64>, sigma_m: &Vector3<f64>, count: usize, rng: &mut Pcg64Mcg) -> Self {
        let mut filter = Self {
            hypotheses: vec![*place; count],
            weights: vec![1.0; count],
            best: 0,
            predicted: Vec::with_capacity(count),
            drawn: Vec::with_capacity(count),
            weights_by_camera: Vec::with_capacity(count),
        };
        filter.scatter(sigma_m, rng);
        filter
    }

    /// Replaces all hypotheses by ones around another place.
    pub fn restart(&mut self, place: &Vector3<f64>, sigma_m: &Vector3<f64>, rng: &mut Pcg64Mcg) {
        self.hypotheses.fill(*place);
        self.weights.fill(1.0);
        self.scatter(sigma_m, rng);
    }

    /// Predicts `count` hypotheses by a drift and a normal step (p(Xₜ | Xₜ₋₁)), and stores them.
    pub fn predict(
        &mut self,
        count: usize,
        drift: &Vector3<f64>,
        sigma_m: &Vector3<f64>,
        rng: &mut Pcg64Mcg,
    ) {
        self.draw(count, rng);
        for s in &mut self.hypotheses {
            *s += drift;
        }
        self.scatter(sigma_m, rng);
        for s in self.hypotheses.iter_mut().step_by(ASTRAY_EVERY) {
            *s += normal(&(sigma_m * ASTRAY), rng);
        }
        self.predicted.clone_from(&self.hypotheses);
    }

    /// Resamples `count` hypotheses by weight, and scatters them.
    pub fn redraw(&mut self, count: usize, sigma_m: &Vector3<f64>, rng: &mut Pcg64Mcg) {
        self.draw(count, rng);
        self.scatter(sigma_m, rng);
    }

    /// Weighs every hypothesis by the moment's pictures.
    pub fn weigh(&mut self, input: &WeighingInput<'_>, times: &mut StepTimes) {
        times.weights.start();
        if self.weights_by_camera.len() < self.hypotheses.len() {
            self.weights_by_camera.resize_with(self.hypotheses.len(), CameraWeights::default);
        }
        input.head_weights.weigh_in_cameras(
            &self.hypotheses,
            input.cameras,
            input.edges,
            &mut self.weights_by_camera,
        );
        times.weights.stop();
        times.integration.start();
        let mut best = (-1.0, 0);
        for (i, (weights_by_camera, weight)) in
            self.weights_by_camera.iter().zip(&mut self.weights).enumerate()
        {
            let integrated = f64::from(input.head_weights.integrate(weights_by_camera));
            if integrated > best.0 {
                best = (integrated, i);
            }
            *weight = integrated.powf(input.sharpness);
        }
        self.best = best.1;
        times.integration.stop();
    }

    /// Support of the cameras for the best hypothesis of a person with this trust.
    pub fn support(&self, trust: f32, input: &WeighingInput<'_>) -> HeadSupport {
        self.hypotheses
            .get(self.best)
            .map_or(HeadSupport::default(), |head| input.head_weights.support(head, trust, input))
    }

    /// Hypothesis of the largest weight; `None` when all weights are 0.
    pub fn heaviest(&self) -> Option<Vector3<f64>> {
        let weighted = self.hypotheses.iter().zip(&self.weights);
        let best = weighted.max_by(|a, b| a.1.total_cmp(b.1))?;
        (*best.1 > 0.0).then_some(*best.0)
    }

    /// Restores the predicted hypotheses with equal weights, after a missed detection.
    pub fn keep_prediction(&mut self) {
        self.hypotheses.clone_from(&self.predicted);
        self.weights.fill(1.0);
    }

    /// Weighted mean and covariance (equation 12).
    pub fn gaussian(&self) -> HeadDistribution {
        HeadDistribution::of(&self.hypotheses, &self.weights)
    }

    /// Systematic resampling of `count` hypotheses in proportion to their weights; uniform if all weights are 0.
    fn draw(&mut self, count: usize, rng: &mut Pcg64Mcg) {
        let mut total: f64 = self.weights.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            self.weights.fill(1.0);
            total = self.weights.len() as f64;
        }
        let step = total / count as f64;
        let mut mark = rng.random::<f64>() * step;
        let mut sum = 0.0;
        self.drawn.clear();
        for (s, weight) in self.hypotheses.iter().zip(&self.weights) {
            sum += weight;
            while mark < sum && self.drawn.len() < count {
                self.drawn.push(*s);
                mark += step;
            }
        }
        // Rounding may leave some out.
        let last = self.drawn.last().copied();
        self.drawn.resize(count, last.unwrap_or_default());
        std::mem::swap(&mut self.drawn, &mut self.hypotheses);
        self.weights.clear();
        self.weights.resize(count, 1.0);
    }

    fn scatter(&mut self, sigma_m: &Vector3<f64>, rng: &mut Pcg64Mcg) {
        for s in &mut self.hypotheses {
            *s += normal(sigma_m, rng);
        }
    }
}

fn normal(sigma_m: &Vector3<f64>, rng: &mut Pcg64Mcg) -> Vector3<f64> {
    let mut draw = || rng.sample::<f64, _>(StandardNormal);
    Vector3::new(sigma_m.x * draw(), sigma_m.y * draw(), sigma_m.z * draw())
}
