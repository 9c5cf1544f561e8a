//! Ellipsoids scaled by a body's radius and height: the body itself, its core, its limbs and the reach of its limbs.
//!
//! A person is not an ellipsoid. Torso and head fill the middle of one in every pose; arms and striding legs come and
//! go around it. A likelihood that models how often they do is not disturbed by a stride.
//!
//! The three nested shapes are those under which masks of walking people are the most probable, each ring with its own
//! share of foreground. They continue below the floor, which cuts them off: people are as wide at their feet as at
//! their hips, and one foot or the other is nearly always under them. Feet are what determines the distance of a person
//! from a single camera; heads do not, since 10 cm of height correspond to a metre of distance for a camera slightly
//! above them.

use nalgebra::{Point3, Vector3};

use super::Body;

/// Upright ellipsoid. Metres, room frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipsoid {
    /// Centre.
    pub center: Point3<f64>,
    /// Semi-axes along x, y and z.
    pub semi_axes: Vector3<f64>,
}

/// Ellipsoid around a body's vertical axis, in units of the body's radius and height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Horizontal semi-axis, in radii.
    pub radius: f64,
    /// Lowest point above the floor, in heights.
    pub bottom: f64,
    /// Highest point above the floor, in heights.
    pub top: f64,
}

impl Shape {
    /// The body itself: the published ellipsoid `(x, y, r, h)`.
    pub const BODY: Self = Self { radius: 1.0, bottom: 0.0, top: 1.0 };
    /// Region that a person fills in nearly every pose: head, torso, and between the feet.
    pub const CORE: Self = Self { radius: 0.6, bottom: -0.03, top: 1.0 };
    /// Region that shoulders, arms and legs fill more often than not.
    pub const LIMBS: Self = Self { radius: 1.0, bottom: -0.11, top: 1.02 };
    /// Region that no limb leaves in any pose.
    pub const REACH: Self = Self { radius: 1.5, bottom: -0.5, top: 1.05 };

    /// Ellipsoid of this shape for one body.
    pub fn of(&self, body: &Body) -> Ellipsoid {
        let (middle, half) = (0.5 * (self.bottom + self.top), 0.5 * (self.top - self.bottom));
        let radius = self.radius * body.radius_m;
        Ellipsoid {
            center: Point3::new(body.x_m, body.y_m, middle * body.height_m),
            semi_axes: Vector3::new(radius, radius, half * body.height_m),
        }
    }
}
