//! The way from another program's world to the room's: scale, shift and the direction of up.

use calib::Camera;
use glam::DVec3;
use nalgebra::{Isometry3, Point3, Similarity3, Translation3, UnitQuaternion, Vector3};

/// Distance from the origin, metres on any axis, from which on a frame counts as far away: there neighbouring numbers of
/// single precision are more than a millimetre apart.
pub const FAR_M: f64 = 10_000.0;
/// Step of the shift that is taken off a far frame, so that people can add it in their heads.
const SHIFT_STEP_M: f64 = 1000.0;

/// Turns a direction of the source to the room's Z; the rest of the rotation is the shortest.
pub fn upright(up: Vector3<f64>) -> Option<UnitQuaternion<f64>> {
    let up = up.try_normalize(1e-12)?;
    // Half a turn has no shortest way: about x, which keeps it.
    UnitQuaternion::rotation_between(&up, &Vector3::z())
        .or_else(|| Some(UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)))
}

/// Room from source: each point is scaled, turned, and then moved by `shift_m`.
pub fn similarity(scale: f64, turn: UnitQuaternion<f64>, shift_m: DVec3) -> Similarity3<f64> {
    Similarity3::from_parts(Translation3::new(shift_m.x, shift_m.y, shift_m.z), turn, scale)
}

/// The camera in the world `b`; its lens sees the same.
pub fn placed(camera: &Camera, b_from_a: &Similarity3<f64>) -> Camera {
    let pose = &camera.camera_from_world;
    // Lengths in front of the camera grow with the world.
    let scaled = Isometry3::from_parts((pose.translation.vector * b_from_a.scaling()).into(), pose.rotation);
    Camera { intrinsics: camera.intrinsics.clone(), camera_from_world: scaled * b_from_a.isometry.inverse() }
}

/// Shift that brings cameras far away to the origin, metres; `None` where they are near enough. Multiples of a kilometre,
/// on the far axes only.
pub fn shift_of_far_frame(eyes: &[Point3<f64>]) -> Option<DVec3> {
    let median = |axis: usize| {
        let mut values: Vec<f64> = eyes.iter().map(|eye| eye[axis]).filter(|v| v.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    };
    let shift = DVec3::from_array([0, 1, 2].map(|axis| {
        let middle = median(axis);
        if middle.abs() > FAR_M { -(middle / SHIFT_STEP_M).floor() * SHIFT_STEP_M } else { 0.0 }
    }));
    (shift != DVec3::ZERO).then_some(shift)
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::Intrinsics;

    #[test]
    fn a_placed_camera_sees_placed_points_where_it_saw_them() {
        let camera = Camera {
            intrinsics: Intrinsics::from_horizontal_fov(640, 480, 70.0),
            camera_from_world: Isometry3::new(Vector3::new(0.3, -1.2, 4.0), Vector3::new(0.4, -1.1, 2.0)),
        };
        let turn = upright(Vector3::new(0.1, -2.0, 0.3)).unwrap();
        for (scale, shift) in [(1.0, DVec3::ZERO), (1e-3, DVec3::new(5.0, -3.0, 1.0)), (7.0, DVec3::X)] {
            let room_from_source = similarity(scale, turn, shift);
            let placed = placed(&camera, &room_from_source);
            for point in [[0.5, 0.2, 1.0], [-1.0, 2.0, 0.0], [0.0, 0.0, 0.3]] {
                let point = Point3::from(point);
                let (before, after) = (camera.project(&point), placed.project(&(room_from_source * point)));
                let (Some(before), Some(after)) = (before, after) else {
                    assert_eq!(before.is_some(), after.is_some());
                    continue;
                };
                assert!((before - after).norm() < 1e-6, "{before} {after}");
            }
            assert!((placed.center() - room_from_source * camera.center()).norm() < 1e-9);
        }
    }

    #[test]
    fn up_becomes_z() {
        for up in [Vector3::y(), -Vector3::z(), Vector3::z(), Vector3::new(1.0, 2.0, -3.0)] {
            assert!((upright(up).unwrap() * up.normalize() - Vector3::z()).norm() < 1e-9, "{up}");
        }
        assert_eq!(upright(Vector3::z()).unwrap(), UnitQuaternion::identity());
        assert!(upright(Vector3::zeros()).is_none());
    }

    #[test]
    fn far_frames_are_shifted_by_whole_kilometres() {
        let at = |x: f64, y: f64| Point3::new(x, y, 2.0);
        assert_eq!(shift_of_far_frame(&[at(9000.0, -9000.0)]), None);
        assert_eq!(shift_of_far_frame(&[]), None);
        let utm = [at(500_003.0, 5_400_010.0), at(500_007.0, 5_400_012.0), at(499_999.0, 5_400_011.0)];
        assert_eq!(shift_of_far_frame(&utm), Some(DVec3::new(-500_000.0, -5_400_000.0, 0.0)));
        assert_eq!(shift_of_far_frame(&[at(-20_500.0, 0.0)]), Some(DVec3::new(21_000.0, 0.0, 0.0)));
    }
}
