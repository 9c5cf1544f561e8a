//! Ellipsoids in a body's own measures: the body itself, its sure core, and as far as its limbs reach.
//!
//! A person is no ellipsoid. Torso and head fill the middle of one in every pose; arms and striding legs come and go
//! around it, and feet stand beside its lower tip. A likelihood that knows the difference is not moved by a stride.

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
    /// What a person fills in every pose: head, torso, thighs.
    pub const CORE: Self = Self { radius: 0.83, bottom: 0.15, top: 1.0 };
    /// What no limb leaves in any pose. It goes below the floor, so that it is wide where the feet stand.
    pub const REACH: Self = Self { radius: 1.5, bottom: -0.3, top: 1.03 };

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
