//! Alignment of one room's frame with another's, by the cameras that stand in both.
//!
//! A room that was reconstructed again has its own origin, but its cameras are the same, so their poses in both rooms
//! give the rigid transform on the floor (a rotation about the vertical and a translation: the floor stays the floor)
//! from one room to the other. It is fitted by least squares over each camera's centre and the points `REACH_M` along
//! its three axes, so that centres and orientations both count, by their effect on positions where people stand.

use std::path::Path;

use nalgebra::{Isometry2, Point2, Point3, Vector2};
use scenes::room::Room;

use crate::{Error, Result};

/// Distance along each axis at which a camera's orientation is probed, metres: about its distance from people.
const REACH_M: f64 = 3.0;

/// Transform between two rooms, and its fit.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomAlignment {
    /// Transform of floor positions from the tracks' room to the truth's.
    pub truth_from_room: Isometry2<f64>,
    /// Number of cameras that stand in both.
    pub cameras: usize,
    /// Root-mean-square distance on the floor between the cameras' centres after the fit, metres.
    pub center_rms_m: f64,
}

/// [`align`] for two room directories.
///
/// # Errors
/// Errors of [`align`] and of the rooms' reader.
pub fn between(truth_dir: &Path, room_dir: &Path) -> Result<RoomAlignment> {
    align(&Room::read(truth_dir)?, truth_dir, &Room::read(room_dir)?, room_dir)
}

/// Transform from `room` to `truth`.
///
/// # Errors
/// No camera of the one has a namesake in the other; the directories are named.
pub fn align(truth: &Room, truth_dir: &Path, room: &Room, room_dir: &Path) -> Result<RoomAlignment> {
    let mut pairs: Vec<(Point2<f64>, Point2<f64>)> = Vec::new();
    let mut centers = Vec::new();
    for camera in &room.cameras {
        let Ok(twin) = truth.camera(&camera.name) else { continue };
        let (from_room, from_truth) =
            (camera.camera.camera_from_world.inverse(), twin.camera.camera_from_world.inverse());
        centers.push(pairs.len());
        for probe in [[0.0; 3], [REACH_M, 0.0, 0.0], [0.0, REACH_M, 0.0], [0.0, 0.0, REACH_M]] {
            let probe = Point3::from(probe);
            pairs.push(((from_room * probe).xy(), (from_truth * probe).xy()));
        }
    }
    if pairs.is_empty() {
        let names = |room: &Room| room.cameras.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ");
        return Err(Error::content(
            room_dir,
            "cameras",
            format!(
                "none of {} stands in {} ({}); the rooms need a camera of the same name",
                names(room),
                truth_dir.display(),
                names(truth)
            ),
        ));
    }
    let truth_from_room = rigid(&pairs);
    let square_sum: f64 =
        centers.iter().map(|i| (truth_from_room * pairs[*i].0 - pairs[*i].1).norm_squared()).sum();
    let cameras = centers.len();
    Ok(RoomAlignment { truth_from_room, cameras, center_rms_m: (square_sum / cameras as f64).sqrt() })
}

/// Rigid transform of the plane with the least squared distance from each first point to its second.
fn rigid(pairs: &[(Point2<f64>, Point2<f64>)]) -> Isometry2<f64> {
    let n = pairs.len() as f64;
    let mean_a = pairs.iter().map(|(a, _)| a.coords).sum::<Vector2<f64>>() / n;
    let mean_b = pairs.iter().map(|(_, b)| b.coords).sum::<Vector2<f64>>() / n;
    let (mut sine, mut cosine) = (0.0, 0.0);
    for (a, b) in pairs {
        let (a, b) = (a.coords - mean_a, b.coords - mean_b);
        cosine += a.dot(&b);
        sine += a.perp(&b);
    }
    let turn = Isometry2::rotation(sine.atan2(cosine));
    Isometry2::new(mean_b - turn * mean_a, turn.rotation.angle())
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use calib::{Camera, Intrinsics};
    use nalgebra::{Isometry3, Vector3};
    use scenes::room::RoomCamera;

    fn camera(name: &str, eye: [f64; 3], target: [f64; 3]) -> RoomCamera {
        // OpenCV's camera: x right, y down, z forward.
        let pose = Isometry3::face_towards(&Point3::from(eye), &Point3::from(target), &-Vector3::z());
        RoomCamera {
            name: name.into(),
            camera: Camera {
                intrinsics: Intrinsics::from_horizontal_fov(640, 480, 70.0),
                camera_from_world: pose.inverse(),
            },
            reference: None,
        }
    }

    fn moved(room: &Room, by: &Isometry3<f64>) -> Room {
        let mut moved = room.clone();
        for camera in &mut moved.cameras {
            camera.camera = camera.camera.moved(by);
        }
        moved
    }

    fn aligned(truth: &Room, room: &Room) -> Result<RoomAlignment> {
        align(truth, Path::new("truth"), room, Path::new("room"))
    }

    #[test]
    fn a_moved_room_is_brought_back_by_any_number_of_cameras() {
        let all = [
            camera("a", [0.0, 0.0, 2.5], [3.0, 2.0, 0.0]),
            camera("down", [2.0, 1.0, 3.0], [2.001, 1.0, 0.0]),
            camera("c", [6.0, 5.0, 2.0], [1.0, 2.0, 1.0]),
        ];
        let by = Isometry3::new(Vector3::new(4.0, -2.0, 0.1), Vector3::z() * 2.3);
        for count in 1..=3 {
            let truth = Room { cameras: all[3 - count..].to_vec(), ..Room::default() };
            let found = aligned(&truth, &moved(&truth, &by)).unwrap();
            assert_eq!(found.cameras, count);
            let p = Point3::new(1.5, -0.7, 0.0);
            assert_relative_eq!(found.truth_from_room * (by * p).xy(), p.xy(), epsilon = 1e-9);
            assert!(found.center_rms_m < 1e-9);
        }
    }

    #[test]
    fn an_error_in_one_camera_is_shared_and_strangers_are_refused() {
        let truth = Room {
            cameras: vec![
                camera("a", [0.0, 0.0, 2.5], [3.0, 2.0, 0.0]),
                camera("b", [6.0, 5.0, 2.0], [1.0, 2.0, 1.0]),
            ],
            ..Room::default()
        };
        let mut room = truth.clone();
        room.cameras[1].camera = room.cameras[1].camera.moved(&Isometry3::translation(0.0768, 0.064, 0.0));
        let found = aligned(&truth, &room).unwrap();
        // Moved apart along their line, where no rotation helps, each camera keeps half of the 10 cm.
        assert_relative_eq!(found.center_rms_m, 0.05, epsilon = 0.005);

        room.cameras.iter_mut().for_each(|c| c.name.push('x'));
        let error = aligned(&truth, &room).unwrap_err().to_string();
        assert!(error.contains("ax, bx") && error.contains("a, b"), "{error}");
    }
}
