//! The floor in the adjustment of all captures: features that lie on it lie in one plane.
//!
//! A camera's own features tell its height over the floor, in the unit of its own motion; where the floors of two captures meet,
//! they tell where the cameras stand to each other, in height, level and scale. Surfaces cannot, being bent as the capture's own
//! motion was.
//!
//! The frame of the bundle is then the room's, up to metres: the floor is z = 0, and the first camera's centre is held, so that its
//! height is the unit of length. What no residual sees, the turn about the vertical, stays as it is. A known length, height or
//! board says what that unit is in metres and nothing else, so it is taken from the adjusted bundle ([`crate::scale`]), exactly
//! as if it had been one of its residuals.

use nalgebra::{Isometry3, Point3, Vector3};
use scenes::geometry::vector_from_vec3;

use super::adjustment::JointBundle;
use crate::floor::{self, Plane};
use crate::surface::Surface;

/// Standard deviation of a floor from a plane, as a share of the first camera's height.
const UNEVEN: f64 = 0.003;
/// Largest distance of the floor's features from the floor by the surfaces, as a share of that height.
const FARTHEST: f64 = 0.01;
/// Largest angle of the surface at such a feature from level, degrees.
const STEEPEST_DEG: f64 = 25.0;
/// Least number of features on the floor. With fewer, the floor is that of the surfaces.
const LEAST_FEATURES: usize = 100;

impl JointBundle<'_> {
    /// Adjusts the captures with their features on the floor in one plane, from `floor` on, which is in the first camera's frame and
    /// unit. `false` where few features are there: then nothing is changed.
    pub(super) fn lay_on(&mut self, floor: &Plane, surfaces: &[Surface]) -> bool {
        let unit = self.adjusted().unit;
        let first = self.state.poses[0];
        let plane = Plane { normal: floor.normal, distance: floor.distance * unit };
        // The first camera's frame is the common one.
        let level_from_world = floor::world_frame(&plane, &Isometry3::identity()) * first;
        let height = plane.height(&Point3::origin());
        let precision = (self.feature_sigma_px[0] / (UNEVEN * height)).powi(2);
        let mut on_plane = vec![0.0; self.state.points.len()];
        let steepest = STEEPEST_DEG.to_radians().cos();
        for (capture, surface) in surfaces.iter().enumerate() {
            let to_level = level_from_world.rotation * self.reference_pose(capture).rotation.inverse();
            let (features, pixels) = self.motions[capture].in_reference(surface);
            for (feature, pixel) in features.iter().zip(&pixels) {
                let Some(point) = self.point_of[capture][*feature] else { continue };
                let Some(normal) = surface.normal_at(pixel) else { continue };
                let is_level = (to_level * vector_from_vec3(normal)).z > steepest;
                let place = level_from_world * self.state.points[point];
                if is_level && place.z.abs() < FARTHEST * height {
                    on_plane[point] = precision;
                }
            }
        }
        let count = on_plane.iter().filter(|p| **p > 0.0).count();
        if count < LEAST_FEATURES {
            return false;
        }
        for pose in &mut self.state.poses {
            *pose *= level_from_world.inverse();
        }
        for point in &mut self.state.points {
            *point = level_from_world * *point;
        }
        self.problem.on_plane = on_plane;
        tracing::debug!("{count} features on the floor");
        self.minimise();
        true
    }

    /// The floor in the first camera's frame and unit, after the captures were laid on it.
    pub(super) fn floor(&self) -> Plane {
        let first = self.state.poses[0];
        let normal = first.rotation * Vector3::z();
        Plane { normal, distance: normal.dot(&first.translation.vector) / self.adjusted().unit }
    }
}
