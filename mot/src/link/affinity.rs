//! Affinity of two detections in the paper: three thresholds (section 4).

use super::build::Affinity;
use super::detection::{Detection, colour_distance};

/// A gating threshold, absolute or relative to the detections' size.
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

/// Affinity by thresholds on distance, change of area and colours; all links cost the same, whatever their gap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thresholds {
    /// Largest distance of the boxes' centres.
    pub distance: Gate,
    /// Largest difference of the boxes' areas.
    pub area_change: Gate,
    /// Largest Hellinger distance of the boxes' colours, where they are known.
    pub colour_distance: f64,
    /// Cost of every link.
    pub link_cost: f64,
}

impl Affinity for Thresholds {
    fn link_cost(&self, from: &Detection, to: &Detection, _gap: u32) -> Option<f64> {
        let distance = (to.place - from.place).norm();
        let change = (to.area() - from.area()).abs();
        let passes = self.distance.passes(distance, from.scale())
            && self.area_change.passes(change, from.area().max(to.area()))
            && colour_distance(from, to).is_none_or(|d| d <= self.colour_distance);
        passes.then_some(self.link_cost)
    }

    fn reach(&self, from: &Detection, _gap: u32) -> f64 {
        match self.distance {
            Gate::Absolute(most) => most,
            Gate::Relative(most) => most * from.scale(),
        }
    }
}
