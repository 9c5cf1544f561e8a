//! Poses and lenses as text that reads back to the last bit.

use calib::{Distortion, Intrinsics};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

/// Quaternion (i, j, k, w) and translation; empty where there is no pose.
pub(super) fn numbers_of(pose: Option<&Isometry3<f64>>) -> Vec<f64> {
    let numbers =
        |p: &Isometry3<f64>| [p.rotation.coords.as_slice(), p.translation.vector.as_slice()].concat();
    pose.map_or(Vec::new(), numbers)
}

/// Inverse of [`numbers_of`]; `None` when these are not a pose's numbers.
fn pose_of(numbers: &[f64]) -> Option<Isometry3<f64>> {
    let [i, j, k, w, x, y, z] = *numbers else { return None };
    // Exactly as serialised: it was of length 1.
    let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
    Some(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
}

/// Intrinsics.
#[derive(Serialize, Deserialize)]
pub(super) struct CachedLens {
    size: [u32; 2],
    focal: [f64; 2],
    center: [f64; 2],
    distortion: Distortion,
}

impl CachedLens {
    pub(super) fn of(k: &Intrinsics) -> Self {
        Self {
            size: [k.width, k.height],
            focal: [k.fx, k.fy],
            center: [k.cx, k.cy],
            distortion: k.distortion,
        }
    }

    pub(super) fn intrinsics(&self) -> Intrinsics {
        let ([width, height], [fx, fy], [cx, cy]) = (self.size, self.focal, self.center);
        Intrinsics { width, height, fx, fy, cx, cy, distortion: self.distortion }
    }
}

/// Poses serialised by [`numbers_of`]; `None` when one is neither a pose nor missing.
pub(super) fn poses_of(poses: &[Vec<f64>]) -> Option<Vec<Option<Isometry3<f64>>>> {
    poses
        .iter()
        .map(|numbers| if numbers.is_empty() { Some(None) } else { pose_of(numbers).map(Some) })
        .collect()
}

/// Length of the head (eight bytes, little endian), then the head, with space for `rest` more bytes.
pub(super) fn with_head(head: &impl Serialize, rest: usize) -> Option<Vec<u8>> {
    let head = toml::to_string(head).ok()?;
    let mut bytes = Vec::with_capacity(8 + head.len() + rest);
    bytes.extend((head.len() as u64).to_le_bytes());
    bytes.extend(head.as_bytes());
    Some(bytes)
}

/// Head serialised by [`with_head`], and the bytes after it.
pub(super) fn head_of<T: serde::de::DeserializeOwned>(bytes: &[u8]) -> Option<(T, &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<8>()?;
    let (head, rest) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
    Some((toml::from_str(std::str::from_utf8(head).ok()?).ok()?, rest))
}
