//! The shape that stands for a person.

use super::{Ellipsoid, Shape};
use crate::PersonEstimate;

/// An upright ellipsoid standing on the floor: the state `M = (x, y, r, h)` of one person. Metres, room frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Where it stands.
    pub x_m: f64,
    /// Where it stands.
    pub y_m: f64,
    /// Horizontal semi-axis.
    pub radius_m: f64,
    /// Height; the vertical semi-axis is half of it.
    pub height_m: f64,
}

impl Body {
    /// An average adult, at the origin.
    pub const ADULT: Self = Self { x_m: 0.0, y_m: 0.0, radius_m: 0.25, height_m: 1.72 };
}

impl From<&PersonEstimate> for Body {
    /// The body of an estimate. Methods that follow a head say how high that is; the body stands on the floor all the same.
    fn from(person: &PersonEstimate) -> Self {
        Self { x_m: person.x_m, y_m: person.y_m, radius_m: person.radius_m, height_m: person.height_m }
    }
}

impl Body {
    /// The ellipsoid.
    pub fn ellipsoid(&self) -> Ellipsoid {
        Shape::BODY.of(self)
    }

    /// Distance between two bodies on the floor.
    pub fn floor_distance_m(&self, other: &Self) -> f64 {
        let (x, y) = (self.x_m - other.x_m, self.y_m - other.y_m);
        (x * x + y * y).sqrt()
    }
}
