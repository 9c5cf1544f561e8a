//! What makes two detections alike: the paper's thresholds, or distances measured in box heights.

use super::build::Affinity;
use super::detection::Detection;

/// A threshold, in the detections' own units or relative to their size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Gate {
    /// Pixels or square pixels; metres on the floor.
    Absolute(f64),
    /// Box heights, or shares of the larger area.
    Relative(f64),
}

impl Gate {
    fn passes(self, value: f64, size: f64) -> bool {
        match self {
            Self::Absolute(most) => value <= most,
            Self::Relative(most) => value <= most * size,
        }
    }
}

/// Section 4: links pass thresholds on distance and change of area, and all cost the same, whatever their gap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thresholds {
    /// Greatest distance of the boxes' centres.
    pub distance: Gate,
    /// Greatest difference of the boxes' areas.
    pub area_change: Gate,
    /// What every link costs.
    pub link_cost: f64,
}

impl Affinity for Thresholds {
    fn link_cost(&self, from: &Detection, to: &Detection, _gap: u32) -> Option<f64> {
        let distance = (to.place - from.place).norm();
        let change = (to.area() - from.area()).abs();
        let passes = self.distance.passes(distance, from.scale())
            && self.area_change.passes(change, from.area().max(to.area()));
        passes.then_some(self.link_cost)
    }

    fn reach(&self, from: &Detection, _gap: u32) -> f64 {
        match self.distance {
            Gate::Absolute(most) => most,
            Gate::Relative(most) => most * from.scale(),
        }
    }
}

/// Distances in box heights and relative changes of size, so that no size of picture and no zoom needs other numbers:
/// the cost is the negative logarithm of two Gaussians, up to a constant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relative {
    /// Standard deviation of a person's place from one frame to the next, in box heights.
    pub sigma_place: f64,
    /// How much of it each further frame adds.
    pub sigma_growth: f64,
    /// Standard deviation of the logarithm of the height.
    pub sigma_size: f64,
    /// Links whose squared deviation, in standard deviations, is greater than this one's square are left out.
    pub gate: f64,
    /// What a squared standard deviation costs.
    pub weight: f64,
    /// What each frame without a detection costs.
    pub miss_cost: f64,
}

impl Relative {
    /// Squared deviation of two places `distance` apart with this ratio of sizes.
    fn deviation2(&self, distance: f64, log_ratio: f64, gap: u32) -> f64 {
        let sigma = self.sigma_place * (1.0 + self.sigma_growth * f64::from(gap - 1));
        (distance / sigma).powi(2) + (log_ratio / self.sigma_size).powi(2)
    }

    /// Cost of a link between places that are `distance` heights apart, or `None` outside the gate.
    pub fn cost(&self, distance: f64, log_ratio: f64, gap: u32) -> Option<f64> {
        let deviation2 = self.deviation2(distance, log_ratio, gap);
        (deviation2 <= self.gate * self.gate)
            .then(|| self.weight * deviation2 + self.miss_cost * f64::from(gap - 1))
    }
}

impl Affinity for Relative {
    fn link_cost(&self, from: &Detection, to: &Detection, gap: u32) -> Option<f64> {
        let height = 0.5 * (from.scale() + to.scale());
        let log_ratio = (to.scale() / from.scale()).ln();
        self.cost((to.place - from.place).norm() / height, log_ratio, gap)
    }

    fn reach(&self, from: &Detection, gap: u32) -> f64 {
        let sigma = self.sigma_place * (1.0 + self.sigma_growth * f64::from(gap - 1));
        // The other box may be higher, as far as the gate lets it.
        let tallest = 0.5 * from.scale() * (1.0 + (self.gate * self.sigma_size).exp());
        self.gate * sigma * tallest
    }
}
