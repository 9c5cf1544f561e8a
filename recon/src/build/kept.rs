//! Finished cameras are kept, so that a build that was interrupted or refused (a pick that is out, most often) goes on
//! where it ended, and a room is built anew from other picks without its films being worked through again.
//!
//! While a room is unfinished they lie in `OUT.unfinished`, afterwards in the room's cache ([`scenes::cache`]), each
//! keyed by all that it was made from: frames, lens, options, seed.

use std::path::{Path, PathBuf};

use calib::{Distortion, Intrinsics};
use glam::Vec3;
use image::RgbImage;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use scenes::cache;
use serde::{Deserialize, Serialize};

use super::camera::Seen;
use super::{BuildOptions, CameraReport};
use crate::capture::Capture;
use crate::surface::{Origin, Surface};

/// Part of the key: changes when what is made of a capture does.
const STAGE: &str = "capture to surface 9";

/// Where finished cameras are kept.
pub(super) struct Kept {
    unfinished: PathBuf,
    room: PathBuf,
}

impl Kept {
    pub(super) fn beside(room: &Path) -> Self {
        let mut name = room.file_name().unwrap_or_default().to_owned();
        name.push(".unfinished");
        Self { unfinished: room.with_file_name(name), room: room.to_owned() }
    }

    /// What was made of the same capture in the same way, if it is still there.
    pub(super) fn find(&self, name: &str, key: &blake3::Hash) -> Option<Seen> {
        let name = file_name(name);
        let content =
            [&self.unfinished, &self.room].into_iter().find_map(|dir| cache::read(dir, &name, key))?;
        decode(&content)
    }

    /// Keeps a camera until the room is finished.
    pub(super) fn keep(&self, name: &str, key: &blake3::Hash, seen: &Seen) {
        if let Some(content) = encode(seen) {
            cache::write(&self.unfinished, &file_name(name), key, &content);
        }
    }

    /// Keeps a camera in the room itself.
    pub(super) fn keep_in(dir: &Path, name: &str, key: &blake3::Hash, seen: &Seen) {
        if let Some(content) = encode(seen) {
            cache::write(dir, &file_name(name), key, &content);
        }
    }

    /// The room is finished: nothing of ours stays beside it.
    pub(super) fn done<'a>(&self, names: impl Iterator<Item = &'a str>) {
        for name in names {
            let file = cache::file_of(&self.unfinished, &file_name(name));
            // What is not there, or cannot be removed, does no harm.
            let _ = std::fs::remove_file(&file);
            let _ = file.parent().map(std::fs::remove_dir);
        }
        let _ = std::fs::remove_dir(&self.unfinished);
    }
}

fn file_name(camera: &str) -> String {
    format!("capture_{camera}")
}

/// Everything that decides what becomes of a capture.
pub(super) fn key(capture: &Capture, options: &BuildOptions) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    // Rust prints floats so that they read back as they were, so the text stands for the values.
    let made_from = format!(
        "{STAGE} {} {} {:?} {:?} {} {:?} {:?} {:?}",
        capture.name,
        capture.reference,
        capture.intrinsics,
        capture.told_focal_px,
        options.seed,
        options.motion,
        options.dense,
        options.planes
    );
    hasher.update(made_from.as_bytes());
    for frame in &capture.frames {
        hasher.update(&frame.width().to_le_bytes());
        hasher.update(blake3::hash(frame.as_raw()).as_bytes());
    }
    hasher.finalize()
}

/// What comes before the pixels, as text.
#[derive(Serialize, Deserialize)]
struct Head {
    step: f64,
    lens: Lens,
    pinhole: Lens,
    /// Quaternion (i, j, k, w) and translation of each frame; empty where it has no pose.
    poses: Vec<Vec<f64>>,
    range: [f64; 2],
    report: CameraReport,
}

fn numbers_of(pose: Option<&Isometry3<f64>>) -> Vec<f64> {
    let numbers =
        |p: &Isometry3<f64>| [p.rotation.coords.as_slice(), p.translation.vector.as_slice()].concat();
    pose.map_or(Vec::new(), numbers)
}

/// As [`numbers_of`] wrote it; `None` when these are not a pose's numbers.
fn pose_of(numbers: &[f64]) -> Option<Isometry3<f64>> {
    let [i, j, k, w, x, y, z] = *numbers else { return None };
    // As it was, to the last bit: it was of length 1.
    let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
    Some(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
}

#[derive(Serialize, Deserialize)]
struct Lens {
    size: [u32; 2],
    focal: [f64; 2],
    center: [f64; 2],
    distortion: Distortion,
}

impl Lens {
    fn of(k: &Intrinsics) -> Self {
        Self {
            size: [k.width, k.height],
            focal: [k.fx, k.fy],
            center: [k.cx, k.cy],
            distortion: k.distortion,
        }
    }

    fn intrinsics(&self) -> Intrinsics {
        let ([width, height], [fx, fy], [cx, cy]) = (self.size, self.focal, self.center);
        Intrinsics { width, height, fx, fy, cx, cy, distortion: self.distortion }
    }
}

/// The length of the head (eight bytes, little endian), the head, then pixel by pixel colour, depth and normal (four
/// bytes a number), agreeing views, origin.
fn encode(seen: &Seen) -> Option<Vec<u8>> {
    let surface = &seen.surface;
    let head = Head {
        step: f64::from(surface.step),
        lens: Lens::of(&seen.lens),
        pinhole: Lens::of(&surface.intrinsics),
        poses: seen.camera_from_world.iter().map(|pose| numbers_of(pose.as_ref())).collect(),
        range: seen.range.into(),
        report: seen.report.clone(),
    };
    let head = toml::to_string(&head).ok()?;
    let mut bytes = Vec::with_capacity(head.len() + 8 + BYTES_A_PIXEL * surface.depth.len());
    bytes.extend((head.len() as u64).to_le_bytes());
    bytes.extend(head.as_bytes());
    bytes.extend(surface.picture.as_raw());
    bytes.extend(surface.depth.iter().flat_map(|z| z.to_le_bytes()));
    bytes.extend(surface.normal.iter().flat_map(Vec3::to_array).flat_map(f32::to_le_bytes));
    bytes.extend(&surface.agreeing);
    bytes.extend(surface.origin.iter().map(|origin| match origin {
        Origin::Unknown => 0,
        Origin::Stereo => 1,
        Origin::Filled => 2,
    }));
    Some(bytes)
}

const BYTES_A_PIXEL: usize = 3 + 4 + 12 + 1 + 1;

fn decode(bytes: &[u8]) -> Option<Seen> {
    let (length, rest) = bytes.split_first_chunk::<8>()?;
    let (head, rest) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
    let head: Head = toml::from_str(std::str::from_utf8(head).ok()?).ok()?;
    let (lens, pinhole) = (head.lens.intrinsics(), head.pinhole.intrinsics());
    let pixels = (pinhole.width as usize).checked_mul(pinhole.height as usize)?;
    if rest.len() != pixels.checked_mul(BYTES_A_PIXEL)? {
        return None;
    }
    let (picture, rest) = rest.split_at(3 * pixels);
    let (depth, rest) = rest.split_at(4 * pixels);
    let (normal, rest) = rest.split_at(12 * pixels);
    let (agreeing, origin) = rest.split_at(pixels);
    let floats = |bytes: &[u8]| -> Vec<f32> {
        bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
    };
    let surface = Surface {
        picture: RgbImage::from_raw(pinhole.width, pinhole.height, picture.to_vec())?,
        depth: floats(depth),
        normal: floats(normal).as_chunks::<3>().0.iter().map(|n| Vec3::from_array(*n)).collect(),
        agreeing: agreeing.to_vec(),
        origin: origin
            .iter()
            .map(|code| match code {
                1 => Origin::Stereo,
                2 => Origin::Filled,
                _ => Origin::Unknown,
            })
            .collect(),
        intrinsics: pinhole,
        step: head.step as f32,
    };
    if head.poses.iter().any(|numbers| !matches!(numbers.len(), 0 | 7)) {
        return None;
    }
    let camera_from_world = head.poses.iter().map(|numbers| pose_of(numbers)).collect();
    Some(Seen { lens, surface, camera_from_world, range: head.range.into(), report: head.report })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::rendered::Rendering;
    use scenes::raycast::RayScene;
    use scenes::synthetic::RoomOptions;

    fn seen() -> Seen {
        let room = RoomOptions { image_px: [64, 48], ..RoomOptions::default() }.build().unwrap();
        let scene = RayScene::new(room.room.geometry.as_ref().unwrap()).unwrap();
        let rendering = Rendering { unit_m: 0.7, noise: 0.01, holes: 0.1, seed: 1 };
        let mut surface = rendering.of(&scene, &room.room.cameras[0].camera);
        surface.origin[7] = Origin::Filled;
        let mut lens = surface.intrinsics.clone();
        lens.distortion = [-0.1, 0.02, 1e-4, -3e-5, 0.1 + 0.2].into();
        let report =
            CameraReport { name: "cam0".into(), reprojection_rms_px: 0.1 + 0.2, ..CameraReport::default() };
        let camera_from_world = vec![Some(Isometry3::rotation([0.1, -0.7, 0.3].into())), None];
        Seen { lens, surface, camera_from_world, range: (0.1 + 0.2, 7.0), report }
    }

    fn capture() -> Capture {
        let frames = vec![RgbImage::new(8, 6), RgbImage::new(8, 6)];
        Capture { name: "cam0".into(), frames, reference: 1, intrinsics: None, told_focal_px: None }
    }

    #[test]
    fn what_is_kept_comes_back_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        let kept = Kept::beside(&folder.path().join("room"));
        let (seen, key) = (seen(), key(&capture(), &BuildOptions::default()));
        assert!(kept.find("cam0", &key).is_none());
        kept.keep("cam0", &key, &seen);
        let back = kept.find("cam0", &key).unwrap();
        assert_eq!((back.lens, back.report), (seen.lens, seen.report));
        assert_eq!((back.camera_from_world, back.range), (seen.camera_from_world, seen.range));
        let (a, b) = (&back.surface, &seen.surface);
        assert_eq!((&a.picture, &a.depth, &a.normal), (&b.picture, &b.depth, &b.normal));
        assert_eq!((&a.agreeing, &a.origin, a.step), (&b.agreeing, &b.origin, b.step));
        assert_eq!(a.intrinsics, b.intrinsics);
        kept.done(["cam0"].into_iter());
        assert!(kept.find("cam0", &key).is_none());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "something was left behind");
    }

    #[test]
    fn another_capture_or_other_options_have_another_key() {
        let same = key(&capture(), &BuildOptions::default());
        assert_eq!(same, key(&capture(), &BuildOptions::default()));
        let mut others = Vec::new();
        let mut other = |change: &dyn Fn(&mut Capture, &mut BuildOptions)| {
            let (mut capture, mut options) = (capture(), BuildOptions::default());
            change(&mut capture, &mut options);
            others.push(key(&capture, &options));
        };
        other(&|capture, _| capture.frames[0].as_mut()[5] = 1);
        other(&|capture, _| capture.reference = 0);
        other(&|capture, _| capture.intrinsics = Some(Intrinsics::from_horizontal_fov(8, 6, 60.0)));
        other(&|capture, _| capture.told_focal_px = Some(7.0));
        other(&|capture, _| capture.frames = vec![RgbImage::new(6, 8), RgbImage::new(6, 8)]);
        other(&|_, options| options.seed = 1);
        other(&|_, options| options.dense.key_frames = 3);
        others.push(same);
        let count = others.len();
        others.sort_by_key(|key| *key.as_bytes());
        others.dedup();
        assert_eq!(others.len(), count);
        // Picks, metres and zones concern the room alone.
        let mut options = BuildOptions { zones: Some("zones.toml".into()), ..BuildOptions::default() };
        options.assemble.merge.outlier_px = 3.0;
        assert_eq!(key(&capture(), &options), same);
    }

    #[test]
    fn damaged_contents_count_as_missing() {
        let whole = encode(&seen()).unwrap();
        assert!(decode(&whole).is_some());
        for length in [0, 7, 8, 100, whole.len() - 1] {
            assert!(decode(&whole[..length]).is_none(), "{length}");
        }
        assert!(decode(&[&whole[..], &[0]].concat()).is_none());
        let mut long_head = whole.clone();
        long_head[..8].fill(0xff);
        assert!(decode(&long_head).is_none());
    }
}
