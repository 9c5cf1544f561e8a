//! A camera's pose from known points and its pixels, starting from a guess.
//!
//! Robust refinement with a Cauchy scale that starts at what the guess leaves and falls with the residuals, so that a
//! guess that is tens of pixels off still finds its way past wrong points.

use calib::Intrinsics;
use calib::least_squares::{Loss, Options};
use calib::resection::{Pick, refine_pose};
use nalgebra::Isometry3;

use super::two_views::median;

/// Refinement at an intermediate scale: the next scale does the rest.
const PASSING: Options = Options { max_iterations: 2, cost_tolerance: 1e-4, initial_damping: 1e-4 };
/// Refinement at the last scale.
const FINAL: Options = Options { max_iterations: 60, cost_tolerance: 1e-7, initial_damping: 1e-4 };
/// Least number of points of a pose.
const MIN_POINTS: usize = 6;

/// A resected pose.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ResectedPose {
    pub(crate) camera_from_world: Isometry3<f64>,
    /// Points within the inlier distance.
    pub(crate) inliers: usize,
    /// Mean truncated squared error, for comparing poses.
    pub(crate) cost: f64,
}

/// Pose nearest to `start` that explains the picks, with the Cauchy scale ending at `inlier_px`.
pub(crate) fn resect(
    intrinsics: &Intrinsics,
    picks: &[Pick],
    start: &Isometry3<f64>,
    inlier_px: f64,
) -> Option<ResectedPose> {
    if picks.len() < MIN_POINTS {
        return None;
    }
    let errors = |pose: &Isometry3<f64>| -> Vec<f64> {
        let error =
            |p: &Pick| intrinsics.project(&(pose * p.world)).map_or(1e4, |seen| (seen - p.pixel).norm());
        picks.iter().map(error).collect()
    };
    let mut pose = *start;
    let mut scale = median(&errors(&pose))?;
    while scale > inlier_px {
        pose = refine_pose(intrinsics, picks, &pose, Loss::Cauchy(scale), &PASSING);
        scale = (0.7 * scale).min(1.5 * median(&errors(&pose))?);
    }
    pose = refine_pose(intrinsics, picks, &pose, Loss::Cauchy(inlier_px), &FINAL);
    let found = errors(&pose);
    let inliers = found.iter().filter(|e| **e <= 2.0 * inlier_px).count();
    let limit = (4.0 * inlier_px).powi(2);
    let cost = found.iter().map(|e| (e * e).min(limit)).sum::<f64>() / found.len() as f64;
    Some(ResectedPose { camera_from_world: pose, inliers, cost })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point2, Point3, Vector3};

    #[test]
    fn a_far_guess_and_wrong_points_are_overcome() {
        let camera = Intrinsics::from_horizontal_fov(640, 480, 65.0);
        let truth = Isometry3::new(Vector3::new(0.2, -0.1, 0.3), Vector3::new(0.1, 0.2, -0.1));
        let picks: Vec<Pick> = (0..60)
            .map(|i| {
                let s = f64::from(i);
                let p = truth.inverse()
                    * Point3::new((1.7 * s).sin() * 1.2, (2.3 * s).cos() * 0.9, 4.0 + (0.9 * s).sin() * 1.5);
                let off = if i % 4 == 0 { 60.0 * (3.1 * s).sin() } else { 0.0 };
                let pixel = camera.project(&(truth * p)).unwrap();
                Pick { world: p, pixel: Point2::new(pixel.x + off, pixel.y - 0.5 * off) }
            })
            .collect();
        let start = Isometry3::new(Vector3::new(0.05, 0.0, 0.1), Vector3::new(0.05, 0.02, 0.0)); // ~100 px off
        let found = resect(&camera, &picks, &start, 1.0).unwrap();
        assert!(found.camera_from_world.rotation.angle_to(&truth.rotation) < 1e-3);
        assert!((found.camera_from_world.translation.vector - truth.translation.vector).norm() < 5e-3);
        assert!(found.inliers >= 45);
        assert!(resect(&camera, &picks[..5], &start, 1.0).is_none());
    }
}
