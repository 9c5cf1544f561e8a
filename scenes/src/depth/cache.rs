//! Depth maps cached beside the room: one a camera, rendered again whenever geometry or camera change.

use std::path::Path;

use calib::Camera;

use super::{DepthMap, render};
use crate::geometry::Geometry;
use crate::raycast::RayScene;
use crate::room::{Room, RoomCamera};
use crate::{Result, cache};

/// Part of the key: change it when the renderer changes.
const RENDERER: &[u8] = b"depth 1";

/// Static depth of one camera's pinhole twin, from the cache of the room directory where that is up to date.
///
/// A cache that is damaged or out of date is rebuilt; a directory that cannot be written only costs the time of
/// rendering again. Without geometry every pixel of the map is empty.
///
/// # Errors
/// [`crate::Error::UnknownCamera`]; [`crate::Error::Geometry`] when the geometry cannot be intersected.
pub fn cached(room_dir: &Path, room: &Room, camera_name: &str) -> Result<DepthMap> {
    let camera = room.camera(camera_name)?;
    let mut maps = of_cameras(room_dir, room.geometry.as_ref(), std::slice::from_ref(camera))?;
    Ok(maps.swap_remove(0))
}

/// [`cached`] for all cameras, in the room's order; the ray scene is built once at most.
///
/// # Errors
/// As [`cached`].
pub fn cached_all(room_dir: &Path, room: &Room) -> Result<Vec<DepthMap>> {
    of_cameras(room_dir, room.geometry.as_ref(), &room.cameras)
}

fn of_cameras(room_dir: &Path, geometry: Option<&Geometry>, cameras: &[RoomCamera]) -> Result<Vec<DepthMap>> {
    let pinhole = |c: &RoomCamera| Camera { intrinsics: c.camera.intrinsics.pinhole(), ..c.camera.clone() };
    let Some(geometry) = geometry else {
        let nothing = |c: &RoomCamera| {
            let twin = c.camera.intrinsics.pinhole();
            DepthMap::nothing(twin.width, twin.height)
        };
        return Ok(cameras.iter().map(nothing).collect());
    };
    let shape = geometry.shape_hash();
    let mut scene = None;
    let mut maps = Vec::with_capacity(cameras.len());
    for room_camera in cameras {
        let camera = pinhole(room_camera);
        let (name, key) = (name_of(&room_camera.name), key(&shape, &camera));
        if let Some(map) = cache::read(room_dir, &name, &key).and_then(|bytes| decode(&bytes)) {
            maps.push(map);
            continue;
        }
        let scene = match &scene {
            Some(scene) => scene,
            None => scene.insert(RayScene::new(geometry)?),
        };
        let map = render(scene, &camera);
        cache::write(room_dir, &name, &key, &encode(&map));
        maps.push(map);
    }
    Ok(maps)
}

fn name_of(camera_name: &str) -> String {
    format!("depth_{camera_name}")
}

fn key(shape: &blake3::Hash, pinhole: &Camera) -> blake3::Hash {
    let k = &pinhole.intrinsics;
    let pose = &pinhole.camera_from_world;
    let mut hasher = blake3::Hasher::new();
    hasher.update(RENDERER);
    hasher.update(shape.as_bytes());
    hasher.update(&k.width.to_le_bytes());
    hasher.update(&k.height.to_le_bytes());
    let numbers = [k.fx, k.fy, k.cx, k.cy];
    for value in numbers.iter().chain(pose.rotation.coords.iter()).chain(pose.translation.vector.iter()) {
        hasher.update(&value.to_le_bytes());
    }
    hasher.finalize()
}

/// Serialises width, height, then the depths; little endian.
fn encode(map: &DepthMap) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(8 + 4 * map.z_m.len());
    bytes.extend(map.width.to_le_bytes());
    bytes.extend(map.height.to_le_bytes());
    bytes.extend(map.z_m.iter().flat_map(|z| z.to_le_bytes()));
    bytes
}

fn decode(bytes: &[u8]) -> Option<DepthMap> {
    let (width, rest) = bytes.split_first_chunk()?;
    let (height, rest) = rest.split_first_chunk()?;
    let (numbers, left) = rest.as_chunks::<4>();
    let map = DepthMap {
        width: u32::from_le_bytes(*width),
        height: u32::from_le_bytes(*height),
        z_m: numbers.iter().map(|z| f32::from_le_bytes(*z)).collect(),
    };
    let whole = left.is_empty() && map.z_m.len() as u64 == u64::from(map.width) * u64::from(map.height);
    whole.then_some(map)
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // what is cached comes back bit by bit
mod tests {
    use super::*;
    use crate::geometry::Disc;
    use calib::Intrinsics;
    use glam::Vec3;
    use nalgebra::Isometry3;

    /// A disc of 1 m, two metres in front of a camera that looks along the world's z.
    fn room() -> Room {
        let disc = Disc {
            center: Vec3::Z * 2.0,
            normal: -Vec3::Z,
            radius: 1.0,
            color: [0; 3],
            filled: false,
            confidence: 1.0,
        };
        let mut intrinsics = Intrinsics::from_horizontal_fov(64, 48, 80.0);
        intrinsics.distortion = [-0.2, 0.0, 0.0, 0.0, 0.0].into();
        let camera = Camera { intrinsics, camera_from_world: Isometry3::identity() };
        let camera = |name: &str| RoomCamera { name: name.into(), camera: camera.clone(), reference: None };
        Room {
            cameras: vec![camera("a"), camera("b")],
            geometry: Some(Geometry::Discs(vec![disc])),
            ..Room::default()
        }
    }

    /// Depth in the middle of a map of the first camera.
    fn in_the_middle(room: &Room, map: &DepthMap) -> f32 {
        let twin = room.cameras[0].camera.intrinsics.pinhole();
        assert_eq!((map.width, map.height), (twin.width, twin.height));
        map.at(twin.cx as u32, twin.cy as u32)
    }

    /// Plants a map that no rendering makes, under the room's own key: reading it back proves that the cache is used.
    fn plant(dir: &Path, room: &Room) {
        let mut pinhole = room.cameras[0].camera.clone();
        pinhole.intrinsics = pinhole.intrinsics.pinhole();
        let (width, height) = (pinhole.intrinsics.width, pinhole.intrinsics.height);
        let planted = DepthMap { width, height, z_m: vec![7.0; (width * height) as usize] };
        let key = key(&room.geometry.as_ref().unwrap().shape_hash(), &pinhole);
        cache::write(dir, &name_of("a"), &key, &encode(&planted));
    }

    #[test]
    fn the_cache_is_used_until_geometry_or_camera_change() {
        let (folder, mut room) = (tempfile::tempdir().unwrap(), room());
        let fresh = cached(folder.path(), &room, "a").unwrap();
        assert_eq!((in_the_middle(&room, &fresh), fresh.at(0, 0)), (2.0, 0.0));
        let file = |camera: &str| cache::file_of(folder.path(), &name_of(camera));
        assert!(file("a").is_file() && !file("b").exists());
        assert_eq!(cached_all(folder.path(), &room).unwrap(), [fresh.clone(), fresh.clone()]);

        plant(folder.path(), &room);
        assert_eq!(cached(folder.path(), &room, "a").unwrap().at(0, 0), 7.0);
        room.cameras[0].camera.camera_from_world.translation.z += 0.5;
        assert_eq!(in_the_middle(&room, &cached(folder.path(), &room, "a").unwrap()), 2.5);
        plant(folder.path(), &room);
        let Some(Geometry::Discs(discs)) = &mut room.geometry else { panic!("a disc") };
        discs[0].radius = 0.9;
        assert_eq!(in_the_middle(&room, &cached(folder.path(), &room, "a").unwrap()), 2.5);
    }

    #[test]
    fn a_broken_cache_is_rebuilt() {
        let (folder, room) = (tempfile::tempdir().unwrap(), room());
        plant(folder.path(), &room);
        std::fs::write(cache::file_of(folder.path(), &name_of("a")), "something else").unwrap();
        assert_eq!(in_the_middle(&room, &cached(folder.path(), &room, "a").unwrap()), 2.0);
        for bad in [&encode(&DepthMap::nothing(3, 2))[..20], &[0; 9], b""] {
            assert_eq!(decode(bad), None);
        }
    }

    #[test]
    fn without_geometry_there_is_a_map_too() {
        let folder = tempfile::tempdir().unwrap();
        let room = Room { geometry: None, ..room() };
        assert!(cached(folder.path(), &room, "c").is_err());
        let map = cached(folder.path(), &room, "b").unwrap();
        let twin = room.cameras[1].camera.intrinsics.pinhole();
        assert!(twin.width > 64 && twin.height > 48, "a barrel's picture is straightened to a larger one");
        assert_eq!((map.width, map.height, map.coverage()), (twin.width, twin.height, 0.0));
    }
}
