//! Part of the floor on which a camera can track people.
//!
//! A room without a known floor has no end. Beyond some distance a person is too small in the image to be told from
//! noise, so the floor that a camera sees within that distance bounds the search for people.

use calib::{Camera, Intrinsics};
use nalgebra::Point2;

/// Height of the smallest person that is tracked, as a fraction of the image's height.
const LEAST_HEIGHT: f64 = 1.0 / 30.0;
/// Assumed height of a person, metres.
const PERSON_M: f64 = 1.7;
/// Samples along each side of the image.
const PROBES: u32 = 16;

/// Places on the floor that `camera` (a pinhole) sees, no farther than people can be tracked in what `filmed` shows,
/// metres. A camera that never sees the floor gets the places below its farthest rays.
pub(super) fn of(camera: &Camera, filmed: &Intrinsics) -> Vec<Point2<f64>> {
    let k = &camera.intrinsics;
    let farthest_m = filmed.fy * PERSON_M / (LEAST_HEIGHT * f64::from(filmed.height));
    let eye = camera.center();
    let at = |i: u32, size: u32| f64::from(i) / f64::from(PROBES) * f64::from(size) - 0.5;
    (0..(PROBES + 1).pow(2))
        .filter_map(|i| {
            let pixel = Point2::new(at(i % (PROBES + 1), k.width), at(i / (PROBES + 1), k.height));
            let ray = camera.back_project(&pixel, 1.0)? - eye;
            let to_floor = if ray.z < 0.0 { -eye.z / ray.z } else { f64::INFINITY };
            Some((eye + ray * to_floor.clamp(0.0, farthest_m)).xy())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Point3, Vector3};

    #[test]
    fn a_level_camera_sees_as_far_as_people_are_large_enough() {
        let (eye, aim) = (Point3::new(1.0, 2.0, 1.5), Point3::new(9.0, 2.0, 1.5));
        let pose = Isometry3::face_towards(&eye, &aim, &-Vector3::z()).inverse();
        let camera =
            Camera { intrinsics: Intrinsics::from_horizontal_fov(640, 480, 90.0), camera_from_world: pose };
        let places = of(&camera, &camera.intrinsics);
        let farthest = places.iter().map(|p| p.x).fold(f64::MIN, f64::max);
        // A person 1.7 m tall at f = 320 px is 480 / 30 = 16 px tall at 34 m.
        assert!((farthest - 35.0).abs() < 1e-6, "{farthest}");
        assert!(places.iter().all(|p| p.x > 1.0), "nothing behind the camera");
    }

    #[test]
    fn a_camera_that_looks_down_sees_the_floor_below_it() {
        let pose =
            Isometry3::face_towards(&Point3::new(0.0, 0.0, 3.0), &Point3::origin(), &Vector3::y()).inverse();
        let camera =
            Camera { intrinsics: Intrinsics::from_horizontal_fov(640, 480, 90.0), camera_from_world: pose };
        let widest = of(&camera, &camera.intrinsics).iter().map(|p| p.coords.amax()).fold(0.0, f64::max);
        assert!((widest - 3.0).abs() < 1e-2, "{widest}");
    }
}
