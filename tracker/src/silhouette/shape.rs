//! Ellipsoids in a body's own measures: the body itself, its sure core, where its limbs mostly are, and as far as they reach.
//!
//! A person is no ellipsoid. Torso and head fill the middle of one in every pose; arms and striding legs come and go
//! around it. A likelihood that knows how often is not moved by a stride.
//!
//! The three nested shapes are those under which masks of walking people are the most probable, each ring with its own
//! share of foreground. They go on below the floor, which cuts them off: people are as wide at their feet as at their hips,
//! and one foot or the other is nearly always under them. That is what tells a lone camera how far away somebody is; heads
//! do not, since a hand's breadth of height is a metre of distance to a camera not far above them.

use nalgebra::{Point3, Vector3};

use super::Body;

/// An upright ellipsoid. Metres, room frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipsoid {
    /// Its middle.
    pub center: Point3<f64>,
    /// Semi-axes along x, y and z.
    pub semi_axes: Vector3<f64>,
}

/// An ellipsoid around a body's vertical axis, in parts of the body's radius and height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Horizontal semi-axis, in radii.
    pub radius: f64,
    /// Lowest point, in heights above the floor.
    pub bottom: f64,
    /// Highest point, in heights above the floor.
    pub top: f64,
}

impl Shape {
    /// The body itself: the published ellipsoid `(x, y, r, h)`.
    pub const BODY: Self = Self { radius: 1.0, bottom: 0.0, top: 1.0 };
    /// What a person fills in nearly every pose: head, torso, and between the feet.
    pub const CORE: Self = Self { radius: 0.6, bottom: -0.03, top: 1.0 };
    /// What shoulders, arms and legs fill more often than not.
    pub const LIMBS: Self = Self { radius: 1.0, bottom: -0.11, top: 1.02 };
    /// What no limb leaves in any pose.
    pub const REACH: Self = Self { radius: 1.5, bottom: -0.5, top: 1.05 };

    /// This shape of one body.
    pub fn of(&self, body: &Body) -> Ellipsoid {
        let (middle, half) = (0.5 * (self.bottom + self.top), 0.5 * (self.top - self.bottom));
        let radius = self.radius * body.radius_m;
        Ellipsoid {
            center: Point3::new(body.x_m, body.y_m, middle * body.height_m),
            semi_axes: Vector3::new(radius, radius, half * body.height_m),
        }
    }
}
