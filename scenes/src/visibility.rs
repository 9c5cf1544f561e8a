//! Visibility of the floor from a camera.

use calib::Camera;
use nalgebra::{Point2, Point3};

use crate::geometry::vec3_from_point;
use crate::raycast::RayScene;

/// Height below which surfaces count as floor: a reconstructed floor is not flat.
const FLOOR_TOLERANCE_M: f64 = 0.1;
/// Largest distance of floor that is considered where the room's extent is unknown: further off people appear small.
const NEAR_M: f64 = 15.0;
/// Number of parts of an image's width and height at whose corners the floor is sampled.
const PARTS: u32 = 12;
/// Distance beyond which a floor point is discarded: just below the horizon a pixel spans kilometres.
const FARTHEST_M: f64 = 1000.0;

/// Tells whether a surface stands between an eye and a place of the floor (z = 0), both in the world, metres.
pub(crate) fn is_hidden(scene: &RayScene, eye: &Point3<f64>, floor: &Point2<f64>) -> bool {
    if eye.z <= FLOOR_TOLERANCE_M {
        return false;
    }
    let way = Point3::new(floor.x, floor.y, 0.0) - eye;
    let end = eye + way * (1.0 - FLOOR_TOLERANCE_M / eye.z);
    scene.is_blocked(vec3_from_point(eye), vec3_from_point(&end))
}

/// Place of the floor (z = 0) on a pixel's ray, without regard to occlusion. `None` above the horizon, a kilometre off
/// or where the lens gives no ray.
pub(crate) fn floor_under(camera: &Camera, pixel: &Point2<f64>) -> Option<Point2<f64>> {
    let (eye, ray) = (camera.center(), camera.ray(pixel)?);
    let distance = -eye.z / ray.z;
    // The comparison is false for a ray parallel to the floor, too.
    ((0.0..=FARTHEST_M).contains(&distance)).then(|| (eye + ray.into_inner() * distance).xy())
}

/// Floor places (z = 0) sampled over the part of a camera's image that shows floor nearby, without regard to occlusion.
pub(crate) fn floor_nearby(camera: &Camera) -> impl Iterator<Item = Point2<f64>> + '_ {
    let (width, height) =
        (f64::from(camera.intrinsics.width) - 1.0, f64::from(camera.intrinsics.height) - 1.0);
    let share = |part: u32| f64::from(part) / f64::from(PARTS);
    let pixels =
        (0..=PARTS).flat_map(move |i| (0..=PARTS).map(move |j| (share(i) * width, share(j) * height)));
    let below = camera.center().xy();
    pixels
        .filter_map(|(u, v)| floor_under(camera, &Point2::new(u, v)))
        .filter(move |place| (place - below).norm() <= NEAR_M)
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::Intrinsics;
    use nalgebra::{Isometry3, Vector3};

    #[test]
    fn the_floor_nearby_is_what_the_image_shows_of_it() {
        let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 90.0);
        let looking = |at: Point3<f64>, up: Vector3<f64>| {
            let eye = Point3::new(1.0, 2.0, 3.0);
            let camera_from_world = Isometry3::face_towards(&eye, &at, &-up).inverse();
            Camera { intrinsics: intrinsics.clone(), camera_from_world }
        };
        // Straight down from 3 m, 90° wide: 3 m to either side, less half a pixel.
        let down = looking(Point3::new(1.0, 2.0, 0.0), Vector3::y());
        let farthest = floor_nearby(&down).map(|p| (p.x - 1.0).abs()).fold(0.0, f64::max);
        assert!((2.97..=3.0).contains(&farthest), "{farthest}");
        // Level: from the floor at the image's lower edge (3 m below 36.8°) to the largest distance.
        let level = looking(Point3::new(9.0, 2.0, 3.0), Vector3::z());
        let ahead: Vec<f64> = floor_nearby(&level).map(|p| p.x - 1.0).collect();
        assert!(ahead.iter().all(|x| (3.9..=NEAR_M).contains(x)) && ahead.len() > 40, "{ahead:?}");
        // A camera that looks at the sky.
        assert_eq!(floor_nearby(&looking(Point3::new(1.1, 2.0, 9.0), Vector3::y())).count(), 0);
    }
}
