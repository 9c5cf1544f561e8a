//! What an eye sees of the floor.

use calib::Camera;
use nalgebra::{Point2, Point3};

use crate::geometry::vec3_from_point;
use crate::raycast::RayScene;

/// What is lower than this counts as floor: a reconstructed floor is not flat.
const FLOOR_TOLERANCE_M: f64 = 0.1;
/// Places of the floor further away from a camera are nowhere: just below the horizon a pixel spans kilometres.
const FARTHEST_M: f64 = 1000.0;

/// Whether something stands between an eye and a place of the floor (z = 0), both in the world, metres.
pub(super) fn is_hidden(scene: &RayScene, eye: &Point3<f64>, floor: &Point2<f64>) -> bool {
    if eye.z <= FLOOR_TOLERANCE_M {
        return false;
    }
    let way = Point3::new(floor.x, floor.y, 0.0) - eye;
    let end = eye + way * (1.0 - FLOOR_TOLERANCE_M / eye.z);
    scene.is_blocked(vec3_from_point(eye), vec3_from_point(&end))
}

/// The place of the floor (z = 0) that a pixel looks at, whatever stands before it. `None` above the horizon, a kilometre
/// off or where the lens gives no ray.
pub(super) fn floor_under(camera: &Camera, pixel: &Point2<f64>) -> Option<Point2<f64>> {
    let (eye, ray) = (camera.center(), camera.ray(pixel)?);
    let distance = -eye.z / ray.z;
    // False for a ray along the floor, too, which is nowhere near it.
    ((0.0..=FARTHEST_M).contains(&distance)).then(|| (eye + ray.into_inner() * distance).xy())
}
