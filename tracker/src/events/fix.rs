//! A person's estimated position at one time: what all of the detector works on.

use nalgebra::{Point2, Vector2};

use super::EventOptions;
use super::border::Offset;

/// A person's estimated position at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fix {
    pub frame: u32,
    pub time_s: f64,
    pub place: Point2<f64>,
    pub sigma_m: Vector2<f64>,
}

impl Fix {
    /// Position at a share of the way to a later fix; its frame is the last that is not after it.
    pub(super) fn toward(&self, later: &Self, share: f64) -> Self {
        let share = share.clamp(0.0, 1.0);
        if share >= 1.0 {
            return *later;
        }
        let time_s = self.time_s + share * (later.time_s - self.time_s);
        let place = self.place + (later.place - self.place) * share;
        Self { time_s, place, ..*self }
    }

    /// Standard deviation of the distance from a border, metres.
    pub(super) fn across_m(&self, offset: &Offset, options: &EventOptions) -> f64 {
        let across =
            if offset.across == Vector2::zeros() { Vector2::repeat(0.5_f64.sqrt()) } else { offset.across };
        across.component_mul(&self.sigma_m).norm().hypot(options.path_sigma_m)
    }
}
