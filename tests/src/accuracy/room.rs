//! A finished room's cameras against the true room's: to each other, and to the floor.

use calib::{Camera, rotation::angle_between_deg};
use nalgebra::{Isometry3, Vector3};

/// Error of the pose of one camera seen from another.
#[derive(Debug, Clone, Copy)]
pub struct RelativePoseError {
    /// Distance between the estimated and the true position of the second camera in the first one's frame, centimetres.
    pub position_cm: f64,
    /// Angle between the estimated and the true relative rotation, degrees.
    pub rotation_deg: f64,
}

/// Pose of `second` in `first`'s frame, against the truth. Metres count: no scale is removed.
pub fn relative_pose(estimated: [&Camera; 2], truth: [&Camera; 2]) -> RelativePoseError {
    let first_from_second = |[first, second]: [&Camera; 2]| -> Isometry3<f64> {
        first.camera_from_world * second.camera_from_world.inverse()
    };
    let (e, t) = (first_from_second(estimated), first_from_second(truth));
    RelativePoseError {
        position_cm: 100.0 * (e.translation.vector - t.translation.vector).norm(),
        rotation_deg: angle_between_deg(&e.rotation, &t.rotation),
    }
}

/// Error of a camera's pose above the floor.
#[derive(Debug, Clone, Copy)]
pub struct CameraError {
    /// Angle between the estimated and the true vertical in the camera's frame, degrees.
    pub tilt_deg: f64,
    /// Estimated less true height above the floor, centimetres.
    pub height_cm: f64,
}

/// Error of one camera's pose above the floor.
pub fn camera_against_floor(estimated: &Camera, truth: &Camera) -> CameraError {
    let up = |camera: &Camera| camera.camera_from_world.rotation * Vector3::z();
    CameraError {
        tilt_deg: up(estimated).angle(&up(truth)).to_degrees(),
        height_cm: 100.0 * (estimated.center().z - truth.center().z),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::Intrinsics;

    #[test]
    fn known_disturbances_are_measured() {
        let camera = |t: [f64; 3], turn: [f64; 3]| Camera {
            intrinsics: Intrinsics::from_horizontal_fov(64, 48, 60.0),
            camera_from_world: Isometry3::new(t.into(), turn.into()).inverse(),
        };
        let (a, b) = (camera([0.0, 0.0, 2.0], [0.0; 3]), camera([3.0, 1.0, 2.0], [0.0, 0.0, 1.0]));
        let moved = camera([3.0, 1.0, 2.03], [0.0, 0.0, 1.0 + 0.5_f64.to_radians()]);
        let error = relative_pose([&a, &moved], [&a, &b]);
        assert!(
            (error.position_cm - 3.0).abs() < 1e-9 && (error.rotation_deg - 0.5).abs() < 1e-9,
            "{error:?}"
        );

        let tilted = camera([0.0, 0.0, 1.98], [0.3_f64.to_radians(), 0.0, 0.0]);
        let error = camera_against_floor(&tilted, &a);
        assert!((error.tilt_deg - 0.3).abs() < 1e-9 && (error.height_cm + 2.0).abs() < 1e-9, "{error:?}");
    }
}
