//! Depth maps kept beside the room: a file a camera, rebuilt whenever geometry, camera or file disagree.
//!
//! A file is `b"roomtrack depth 1\n"`, the key (BLAKE3 of geometry and camera), width and height (`u32`), the depths
//! (`f32`, metres; all little endian) and the BLAKE3 hash of everything before.

use std::path::{Path, PathBuf};

use calib::Camera;

use super::{DepthMap, render};
use crate::Result;
use crate::geometry::Geometry;
use crate::raycast::RayScene;
use crate::room::{Room, RoomCamera};

/// The folder of a room directory that may be deleted at any time.
const FOLDER: &str = "cache";
/// Changes with the file's layout or the renderer.
const MAGIC: &[u8] = b"roomtrack depth 1\n";
const HASH_BYTES: usize = blake3::OUT_LEN;

/// The static depth of one camera's pinhole twin, from the cache of the room directory where it is up to date.
///
/// A cache that is broken or out of date is rebuilt; a directory that cannot be written only costs the time of
/// rendering again. Without geometry the map says nothing everywhere.
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
        let size = |c: &RoomCamera| DepthMap::nothing(c.camera.intrinsics.width, c.camera.intrinsics.height);
        return Ok(cameras.iter().map(size).collect());
    };
    let geometry_hash = hash_of_geometry(geometry);
    let mut scene = None;
    let mut maps = Vec::with_capacity(cameras.len());
    for room_camera in cameras {
        let camera = pinhole(room_camera);
        let key = key(&geometry_hash, &camera);
        let path = file_of(room_dir, &room_camera.name);
        let found = std::fs::read(&path).ok().and_then(|bytes| decode(&bytes, &key));
        if let Some(map) = found {
            maps.push(map);
            continue;
        }
        let scene = match &scene {
            Some(scene) => scene,
            None => scene.insert(RayScene::new(geometry)?),
        };
        let map = render(scene, &camera);
        if let Err(e) = calib::files::write_atomic(&path, &encode(&map, &key)) {
            tracing::debug!("depth is not cached: {e}");
        }
        maps.push(map);
    }
    Ok(maps)
}

fn file_of(room_dir: &Path, camera_name: &str) -> PathBuf {
    room_dir.join(FOLDER).join(format!("depth_{camera_name}.bin"))
}

/// Of what rays can meet; colours do not count.
fn hash_of_geometry(geometry: &Geometry) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    let mut buffer = Vec::with_capacity(1 << 16);
    let mut floats = |values: &[f32]| {
        buffer.extend(values.iter().flat_map(|v| v.to_le_bytes()));
        if buffer.len() > (1 << 16) - 64 {
            hasher.update(&buffer);
            buffer.clear();
        }
    };
    match geometry {
        Geometry::Mesh(mesh) => {
            floats(&[0.0, f32::from_bits(mesh.vertices.len() as u32)]);
            mesh.vertices.iter().for_each(|v| floats(&v.to_array()));
            // The bits of the indices, not their values: large ones have no exact float.
            mesh.triangles.iter().for_each(|t| floats(&t.map(f32::from_bits)));
        }
        Geometry::Discs(discs) => {
            floats(&[1.0, f32::from_bits(discs.len() as u32)]);
            for d in discs {
                floats(&[d.center.x, d.center.y, d.center.z, d.normal.x, d.normal.y, d.normal.z, d.radius]);
            }
        }
    }
    hasher.update(&buffer);
    hasher.finalize()
}

fn key(geometry: &blake3::Hash, pinhole: &Camera) -> blake3::Hash {
    let k = &pinhole.intrinsics;
    let pose = &pinhole.camera_from_world;
    let mut hasher = blake3::Hasher::new();
    hasher.update(geometry.as_bytes());
    hasher.update(&k.width.to_le_bytes());
    hasher.update(&k.height.to_le_bytes());
    let numbers = [k.fx, k.fy, k.cx, k.cy];
    for value in numbers.iter().chain(pose.rotation.coords.iter()).chain(pose.translation.vector.iter()) {
        hasher.update(&value.to_le_bytes());
    }
    hasher.finalize()
}

fn encode(map: &DepthMap, key: &blake3::Hash) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(MAGIC.len() + 2 * HASH_BYTES + 8 + 4 * map.z_m.len());
    bytes.extend(MAGIC);
    bytes.extend(key.as_bytes());
    bytes.extend(map.width.to_le_bytes());
    bytes.extend(map.height.to_le_bytes());
    bytes.extend(map.z_m.iter().flat_map(|z| z.to_le_bytes()));
    let hash = blake3::hash(&bytes);
    bytes.extend(hash.as_bytes());
    bytes
}

/// The map of a file, unless the file is broken or of another geometry or camera.
fn decode(bytes: &[u8], key: &blake3::Hash) -> Option<DepthMap> {
    let (content, hash) = bytes.split_last_chunk::<HASH_BYTES>()?;
    let rest = content.strip_prefix(MAGIC)?.strip_prefix(key.as_bytes().as_slice())?;
    if blake3::hash(content) != *hash {
        return None;
    }
    let (width, rest) = rest.split_first_chunk()?;
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
        let disc =
            Disc { center: Vec3::Z * 2.0, normal: -Vec3::Z, radius: 1.0, color: [0; 3], filled: false };
        let mut intrinsics = Intrinsics::from_horizontal_fov(64, 48, 80.0);
        intrinsics.distortion.k1 = -0.2;
        let camera = Camera { intrinsics, camera_from_world: Isometry3::identity() };
        let camera = |name: &str| RoomCamera { name: name.into(), camera: camera.clone(), reference: None };
        Room {
            cameras: vec![camera("a"), camera("b")],
            geometry: Some(Geometry::Discs(vec![disc])),
            ..Room::default()
        }
    }

    /// Plants a map that no rendering makes, under the room's own key: reading it back proves that the cache is used.
    fn plant(dir: &Path, room: &Room) -> PathBuf {
        let path = file_of(dir, "a");
        let planted = DepthMap { width: 64, height: 48, z_m: vec![7.0; 64 * 48] };
        let mut pinhole = room.cameras[0].camera.clone();
        pinhole.intrinsics = pinhole.intrinsics.pinhole();
        let key = key(&hash_of_geometry(room.geometry.as_ref().unwrap()), &pinhole);
        calib::files::write_atomic(&path, &encode(&planted, &key)).unwrap();
        path
    }

    #[test]
    fn the_cache_is_used_until_geometry_or_camera_change() {
        let (folder, mut room) = (tempfile::tempdir().unwrap(), room());
        let fresh = cached(folder.path(), &room, "a").unwrap();
        assert_eq!((fresh.at(32, 24), fresh.at(0, 0)), (2.0, 0.0));
        assert!(file_of(folder.path(), "a").is_file() && !file_of(folder.path(), "b").exists());
        assert_eq!(cached_all(folder.path(), &room).unwrap(), [fresh.clone(), fresh.clone()]);

        plant(folder.path(), &room);
        assert_eq!(cached(folder.path(), &room, "a").unwrap().at(0, 0), 7.0);
        room.cameras[0].camera.camera_from_world.translation.z += 0.5;
        assert_eq!(cached(folder.path(), &room, "a").unwrap().at(32, 24), 2.5);
        plant(folder.path(), &room);
        let Some(Geometry::Discs(discs)) = &mut room.geometry else { panic!("a disc") };
        discs[0].radius = 0.9;
        assert_eq!(cached(folder.path(), &room, "a").unwrap().at(32, 24), 2.5);
    }

    #[test]
    fn a_broken_cache_is_rebuilt() {
        let (folder, room) = (tempfile::tempdir().unwrap(), room());
        let path = plant(folder.path(), &room);
        let whole = std::fs::read(&path).unwrap();
        let mut flipped = whole.clone();
        flipped[MAGIC.len() + HASH_BYTES + 100] ^= 1;
        for bad in [&whole[..whole.len() / 2], &whole[..20], &flipped, b"", b"something else"] {
            std::fs::write(&path, bad).unwrap();
            assert_eq!(cached(folder.path(), &room, "a").unwrap().at(32, 24), 2.0);
        }
    }

    #[test]
    fn without_a_place_for_the_cache_or_without_geometry_there_is_a_map_too() {
        let folder = tempfile::tempdir().unwrap();
        // A file where the folder should be: works for root, too, whom no permission stops.
        std::fs::write(folder.path().join(FOLDER), "in the way").unwrap();
        let mut room = room();
        assert_eq!(cached(folder.path(), &room, "b").unwrap().at(32, 24), 2.0);
        assert!(cached(folder.path(), &room, "c").is_err());
        room.geometry = None;
        let map = cached(folder.path(), &room, "b").unwrap();
        assert_eq!((map.width, map.height, map.coverage()), (64, 48, 0.0));
    }
}
