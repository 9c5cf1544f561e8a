//! A capture's surface and motion as bytes.

use glam::Vec3;
use image::RgbImage;
use scenes::geometry::Disc;
use serde::{Deserialize, Serialize};

use super::numbers::{CachedLens, head_of, numbers_of, poses_of, with_head};
use crate::pipeline::CameraReport;
use crate::pipeline::camera::ProcessedCapture;
use crate::surface::{DepthOrigin, Surface};

/// Text before the pixels.
#[derive(Serialize, Deserialize)]
struct SurfaceHead {
    step: f64,
    lens: CachedLens,
    pinhole: CachedLens,
    /// Quaternion (i, j, k, w) and translation of each frame; empty where it has no pose.
    poses: Vec<Vec<f64>>,
    range: [f64; 2],
    /// Number of discs after the pixels.
    discs: usize,
    report: CameraReport,
}

/// Serialises the head, then pixel by pixel colour, depth and normal (four bytes a number), agreeing views, origin;
/// then the discs that only key frames saw: centre, normal, radius, confidence, colour, whether it was filled.
pub(super) fn encode(processed: &ProcessedCapture) -> Option<Vec<u8>> {
    let surface = &processed.surface;
    let head = SurfaceHead {
        step: f64::from(surface.step),
        lens: CachedLens::of(&processed.lens),
        pinhole: CachedLens::of(&surface.intrinsics),
        poses: processed.camera_from_world.iter().map(|pose| numbers_of(pose.as_ref())).collect(),
        range: processed.range.into(),
        discs: processed.key_frame_discs.len(),
        report: processed.report.clone(),
    };
    let mut bytes = with_head(
        &head,
        BYTES_A_PIXEL * surface.depth.len() + BYTES_A_DISC * processed.key_frame_discs.len(),
    )?;
    bytes.extend(surface.picture.as_raw());
    bytes.extend(surface.depth.iter().flat_map(|z| z.to_le_bytes()));
    bytes.extend(surface.normal.iter().flat_map(Vec3::to_array).flat_map(f32::to_le_bytes));
    bytes.extend(&surface.agreeing);
    bytes.extend(surface.origin.iter().map(|origin| match origin {
        DepthOrigin::Unknown => 0,
        DepthOrigin::Stereo => 1,
        DepthOrigin::Filled => 2,
    }));
    for disc in &processed.key_frame_discs {
        let numbers = [disc.center.to_array(), disc.normal.to_array()].concat();
        let numbers = numbers.into_iter().chain([disc.radius, disc.confidence]);
        bytes.extend(numbers.flat_map(f32::to_le_bytes));
        bytes.extend(disc.color);
        bytes.push(u8::from(disc.filled));
    }
    Some(bytes)
}

const BYTES_A_PIXEL: usize = 3 + 4 + 12 + 1 + 1;
const BYTES_A_DISC: usize = 4 * 8 + 3 + 1;

pub(super) fn decode(bytes: &[u8]) -> Option<ProcessedCapture> {
    let (head, rest): (SurfaceHead, &[u8]) = head_of(bytes)?;
    let (lens, pinhole) = (head.lens.intrinsics(), head.pinhole.intrinsics());
    let pixels = (pinhole.width as usize).checked_mul(pinhole.height as usize)?;
    let discs = head.discs.checked_mul(BYTES_A_DISC)?;
    if rest.len() != pixels.checked_mul(BYTES_A_PIXEL)?.checked_add(discs)? {
        return None;
    }
    let (rest, discs) = rest.split_at(rest.len() - discs);
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
                1 => DepthOrigin::Stereo,
                2 => DepthOrigin::Filled,
                _ => DepthOrigin::Unknown,
            })
            .collect(),
        intrinsics: pinhole,
        step: head.step as f32,
    };
    let camera_from_world = poses_of(&head.poses)?;
    let key_frame_discs = discs.as_chunks::<BYTES_A_DISC>().0.iter().map(disc).collect();
    Some(ProcessedCapture {
        lens,
        surface,
        key_frame_discs,
        camera_from_world,
        range: head.range.into(),
        report: head.report,
    })
}

fn disc(bytes: &[u8; BYTES_A_DISC]) -> Disc {
    let (numbers, rest) = bytes.split_at(4 * 8);
    let mut n = [0.0; 8];
    for (number, bytes) in n.iter_mut().zip(numbers.as_chunks::<4>().0) {
        *number = f32::from_le_bytes(*bytes);
    }
    Disc {
        center: Vec3::new(n[0], n[1], n[2]),
        normal: Vec3::new(n[3], n[4], n[5]),
        radius: n[6],
        confidence: n[7],
        color: [rest[0], rest[1], rest[2]],
        filled: rest[3] != 0,
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::surface::rendered::Rendering;
    use nalgebra::Isometry3;
    use scenes::raycast::RayScene;
    use synthetic::RoomOptions;

    pub(in super::super) fn processed() -> ProcessedCapture {
        let room = RoomOptions { image_px: [64, 48], ..RoomOptions::default() }.build().unwrap();
        let scene = RayScene::new(room.room.geometry.as_ref().unwrap()).unwrap();
        let rendering = Rendering { unit_m: 0.7, noise: 0.01, holes: 0.1, seed: 1 };
        let mut surface = rendering.of(&scene, &room.room.cameras[0].camera);
        surface.origin[7] = DepthOrigin::Filled;
        let mut lens = surface.intrinsics.clone();
        lens.distortion = [-0.1, 0.02, 1e-4, -3e-5, 0.1 + 0.2].into();
        let report =
            CameraReport { name: "cam0".into(), reprojection_rms_px: 0.1 + 0.2, ..CameraReport::default() };
        let camera_from_world = vec![Some(Isometry3::rotation([0.1, -0.7, 0.3].into())), None];
        let disc = Disc {
            center: Vec3::new(0.1, -0.7, 3.0),
            normal: -Vec3::Z,
            radius: 0.02,
            color: [7, 80, 255],
            filled: false,
            confidence: 3.5,
        };
        let key_frame_discs = vec![disc, Disc { center: Vec3::ONE, filled: true, ..disc }];
        ProcessedCapture {
            lens,
            surface,
            key_frame_discs,
            camera_from_world,
            range: (0.1 + 0.2, 7.0),
            report,
        }
    }

    #[test]
    fn damaged_contents_count_as_missing() {
        let whole = encode(&processed()).unwrap();
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
