//! Height of a person, averaged over all moments in which a detector's boxes measured it.

use super::options::Spread;

/// Standard deviation of the height shown by one moment, beyond that of the boxes, metres: gait and posture.
const POSE_SIGMA_M: f64 = 0.03;
/// Standard deviation of an average over many moments, metres: the cameras' errors last.
const LASTING_SIGMA_M: f64 = 0.02;

/// Weighted sum of measured heights.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct LearntHeight {
    /// Sum of the weights, 1/m².
    weight: f64,
    /// Sum of the weighted heights, 1/m.
    sum: f64,
}

impl LearntHeight {
    /// Adds the height measured by one moment.
    pub(super) fn add(&mut self, seen: &Spread) {
        let weight = 1.0 / (seen.sigma_m.powi(2) + POSE_SIGMA_M.powi(2));
        self.weight += weight;
        self.sum += weight * seen.mean_m;
    }

    /// Average height, with its standard deviation; `None` before the first measurement.
    fn average(&self) -> Option<Spread> {
        let sigma_m = || (1.0 / self.weight + LASTING_SIGMA_M.powi(2)).sqrt();
        (self.weight > 0.0).then(|| Spread { mean_m: self.sum / self.weight, sigma_m: sigma_m() })
    }

    /// Log density that these are heights of the person of whom `before` was learnt; `prior` is that of all people.
    pub(super) fn log_density(&self, before: &Self, prior: &Spread) -> f64 {
        let Some(seen) = self.average() else { return 0.0 };
        let expected = before.average().map_or(*prior, |learnt| {
            let weight = learnt.sigma_m.powi(-2) + prior.sigma_m.powi(-2);
            let sum = learnt.mean_m * learnt.sigma_m.powi(-2) + prior.mean_m * prior.sigma_m.powi(-2);
            Spread { mean_m: sum / weight, sigma_m: weight.powf(-0.5) }
        });
        Spread { sigma_m: expected.sigma_m.hypot(seen.sigma_m), ..expected }.log_density(seen.mean_m)
    }
}
