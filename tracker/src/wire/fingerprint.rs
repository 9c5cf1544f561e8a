//! Digest of the facts about a room that two machines must agree on, 16 bytes.

use scenes::room::Room;

/// Digest of the facts that a station and its gatherer must agree on: names, lenses and poses of all cameras of a room.
///
/// Zones, floor and geometry are the gatherer's alone and are no part of it; nor is the cameras' order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Fingerprint(pub(crate) [u8; Fingerprint::BYTES]);

/// Step to which numbers are rounded before hashing (pixels, metres and rotation matrices' entries), so that rounding
/// errors of another processor give the same room.
const STEP: f64 = 1e-6;

impl Fingerprint {
    /// Length in bytes.
    pub(crate) const BYTES: usize = 16;

    /// Fingerprint of a room.
    pub fn of(room: &Room) -> Self {
        let mut cameras: Vec<_> = room.cameras.iter().collect();
        cameras.sort_by(|a, b| a.name.cmp(&b.name));
        let mut hasher = blake3::Hasher::new();
        hasher.update(b"roomtrack room 1");
        for camera in cameras {
            hasher.update(&(camera.name.len() as u64).to_le_bytes()).update(camera.name.as_bytes());
            let (k, pose) = (&camera.camera.intrinsics, &camera.camera.camera_from_world);
            hasher.update(&k.width.to_le_bytes()).update(&k.height.to_le_bytes());
            let lens = k.distortion.coefficients();
            // The five numbers of a lens without a name are hashed alone, as before there were others.
            if !k.distortion.model().is_default() {
                hasher.update(k.distortion.model().name().as_bytes());
            }
            let rotation = pose.rotation.to_rotation_matrix();
            let numbers = [k.fx, k.fy, k.cx, k.cy].into_iter().chain(lens);
            let numbers = numbers.chain(rotation.matrix().iter().copied());
            for number in numbers.chain(pose.translation.vector.iter().copied()) {
                hasher.update(&((number / STEP).round() as i64).to_le_bytes());
            }
        }
        let mut digest = [0; Self::BYTES];
        digest.copy_from_slice(&hasher.finalize().as_bytes()[..Self::BYTES]);
        Self(digest)
    }
}

/// Writes the first 8 bytes as 16 hexadecimal digits, as used in keys and log lines.
impl std::fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0[..8].iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::{Camera, Fisheye, Intrinsics};
    use nalgebra::{Isometry3, Point2, Vector3};
    use scenes::polygon::Polygon;
    use scenes::room::{RoomCamera, Zone, ZoneKind};

    fn room() -> Room {
        let camera = |name: &str, x: f64| RoomCamera {
            name: name.into(),
            camera: Camera {
                intrinsics: Intrinsics::from_horizontal_fov(640, 480, 70.0),
                camera_from_world: Isometry3::new(Vector3::new(x, 0.2, 2.4), Vector3::new(0.1, 2.0, 0.3)),
            },
            reference: None,
        };
        Room { cameras: vec![camera("a", 0.0), camera("b", 3.0)], ..Room::default() }
    }

    #[test]
    fn everything_that_stations_share_changes_it_and_nothing_else() {
        let one = Fingerprint::of(&room());
        let with = |change: &dyn Fn(&mut Room)| {
            let mut room = room();
            change(&mut room);
            Fingerprint::of(&room)
        };
        let polygon = Polygon::rectangle(Point2::new(0.0, 0.0), Point2::new(1.0, 1.0));
        assert_eq!(one, with(&|room| room.cameras.reverse()));
        assert_eq!(one, with(&|room| room.cameras[0].camera.intrinsics.fx += 1e-10));
        assert_eq!(one, with(&|room| room.cameras[0].reference = Some("a.jpg".into())));
        assert_eq!(
            one,
            with(&|room| {
                room.zones.push(Zone { name: "door".into(), polygon: polygon.clone(), kind: ZoneKind::Both });
            })
        );
        let changes: [&dyn Fn(&mut Room); 8] = [
            &|room| room.cameras[0].name = "c".into(),
            &|room| room.cameras[0].camera.intrinsics.width = 641,
            &|room| room.cameras[1].camera.intrinsics.cy += 1e-3,
            &|room| room.cameras[1].camera.intrinsics.distortion = [0.0, 0.0, 0.0, 0.0, 1e-3].into(),
            &|room| room.cameras[1].camera.intrinsics.distortion = Fisheye::from([0.0; 4]).into(),
            &|room| room.cameras[0].camera.camera_from_world.translation.vector.z += 1e-4,
            &|room| room.cameras[0].camera = room.cameras[1].camera.clone(),
            &|room| {
                room.cameras.pop();
            },
        ];
        for (i, change) in changes.iter().enumerate() {
            assert_ne!(one, with(change), "change {i}");
        }
        assert_eq!(one.to_string().len(), 16);
    }
}
