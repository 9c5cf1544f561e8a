//! The shape that models a person.

use super::{Ellipsoid, Shape};
use crate::PersonEstimate;

/// Upright ellipsoid standing on the floor: the state `M = (x, y, r, h)` of one person. Metres, room frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Position on the floor along x, metres.
    pub x_m: f64,
    /// Position on the floor along y, metres.
    pub y_m: f64,
    /// Horizontal semi-axis, metres.
    pub radius_m: f64,
    /// Height, metres; the vertical semi-axis is half of it.
    pub height_m: f64,
}

impl Body {
    /// An average adult, at the origin.
    pub const ADULT: Self = Self { x_m: 0.0, y_m: 0.0, radius_m: 0.25, height_m: 1.72 };
}

impl From<&PersonEstimate> for Body {
    /// Body of an estimate. Methods that track a head estimate its height; the body stands on the floor all the same.
    fn from(person: &PersonEstimate) -> Self {
        Self { x_m: person.x_m, y_m: person.y_m, radius_m: person.radius_m, height_m: person.height_m }
    }
}

impl Body {
    /// Ellipsoid of the body itself ([`Shape::BODY`]).
    pub fn ellipsoid(&self) -> Ellipsoid {
        Shape::BODY.of(self)
    }

    /// Distance between two bodies on the floor, metres.
    pub fn floor_distance_m(&self, other: &Self) -> f64 {
        let (x, y) = (self.x_m - other.x_m, self.y_m - other.y_m);
        (x * x + y * y).sqrt()
    }
}
