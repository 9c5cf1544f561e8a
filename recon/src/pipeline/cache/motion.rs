//! A camera's motion and sparse points as bytes.

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use super::numbers::{CachedLens, head_of, numbers_of, poses_of, with_head};
use crate::pipeline::CameraReport;
use crate::pipeline::camera::CameraMotion;

/// Text before the points.
#[derive(Serialize, Deserialize)]
struct MotionHead {
    lens: CachedLens,
    /// Quaternion (i, j, k, w) and translation of each frame; empty where it has no pose.
    poses: Vec<Vec<f64>>,
    report: CameraReport,
}

const BYTES_A_POINT: usize = 3 * size_of::<f64>();

/// Serialises the head, then point by point three numbers of eight bytes.
pub(super) fn encode(motion: &CameraMotion) -> Option<Vec<u8>> {
    let head = MotionHead {
        lens: CachedLens::of(&motion.lens),
        poses: motion.camera_from_world.iter().map(|pose| numbers_of(pose.as_ref())).collect(),
        report: motion.report.clone(),
    };
    let mut bytes = with_head(&head, BYTES_A_POINT * motion.points.len())?;
    bytes.extend(
        motion.points.iter().flat_map(|p| p.coords.iter().flat_map(|c| c.to_le_bytes()).collect::<Vec<_>>()),
    );
    Some(bytes)
}

pub(super) fn decode(bytes: &[u8]) -> Option<CameraMotion> {
    let (head, rest): (MotionHead, &[u8]) = head_of(bytes)?;
    let (points, []) = rest.as_chunks::<BYTES_A_POINT>() else { return None };
    let point = |bytes: &[u8; BYTES_A_POINT]| {
        let (numbers, _) = bytes.as_chunks::<8>();
        Point3::from_slice(&[0, 1, 2].map(|k| f64::from_le_bytes(numbers[k])))
    };
    Some(CameraMotion {
        lens: head.lens.intrinsics(),
        camera_from_world: poses_of(&head.poses)?,
        points: points.iter().map(point).collect(),
        report: head.report,
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::pipeline::report::StartErrors;

    pub(in super::super) fn motion() -> CameraMotion {
        let super::super::super::camera::ProcessedCapture { lens, camera_from_world, .. } =
            super::super::surface::tests::processed();
        let report = CameraReport {
            name: "cam0".into(),
            start: "two views".into(),
            start_error_px: StartErrors { factorization: None, two_views: Some(0.1 + 0.2) },
            doubts: vec!["two \"different\" motions\nfit".into()],
            ..CameraReport::default()
        };
        let points = vec![Point3::new(0.1 + 0.2, -1.0 / 3.0, 7.0), Point3::new(1e-300, -0.0, 2.5)];
        CameraMotion { lens, camera_from_world, points, report }
    }

    #[test]
    fn damaged_contents_count_as_missing() {
        let whole = encode(&motion()).unwrap();
        assert!(decode(&whole).is_some());
        for length in [0, 7, 8, 100, whole.len() - 1] {
            assert!(decode(&whole[..length]).is_none(), "{length}");
        }
        assert!(decode(&[&whole[..], &[0]].concat()).is_none());
    }
}
