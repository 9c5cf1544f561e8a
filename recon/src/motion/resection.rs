//! A camera's pose from known points and its pixels, starting from a guess.
//!
//! Iteratively reweighted Levenberg–Marquardt; the Cauchy scale starts at what the guess leaves and falls with the
//! residuals, so that a guess that is tens of pixels off still finds its way past wrong points.

use calib::Intrinsics;
use nalgebra::{Isometry3, Matrix6, Point2, Point3, SMatrix, Vector3, Vector6};

use super::two_views::median;
use crate::bundle::Loss;

const STEPS: usize = 60;
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

/// Pose nearest to `start` that explains the pairs, with the Cauchy scale ending at `inlier_px`.
pub(crate) fn resect(
    intrinsics: &Intrinsics,
    pairs: &[(Point3<f64>, Point2<f64>)],
    start: &Isometry3<f64>,
    inlier_px: f64,
) -> Option<ResectedPose> {
    if pairs.len() < MIN_POINTS {
        return None;
    }
    let errors = |pose: &Isometry3<f64>| -> Vec<f64> {
        pairs
            .iter()
            .map(|(point, pixel)| intrinsics.project(&(pose * point)).map_or(1e4, |p| (p - pixel).norm()))
            .collect()
    };
    let mut pose = *start;
    let mut scale = median(&errors(&pose))?.max(inlier_px);
    let mut damping = 1e-4;
    for _ in 0..STEPS {
        let loss = Loss::Cauchy(scale);
        let cost = |pose: &Isometry3<f64>| errors(pose).iter().map(|e| loss.cost(e * e)).sum::<f64>();
        let (mut normal, mut right) = (Matrix6::<f64>::zeros(), Vector6::<f64>::zeros());
        for (point, pixel) in pairs {
            let p = pose * point;
            let Some(projected) = intrinsics.project(&p) else { continue };
            let by_point = intrinsics.project_jacobian(&p);
            let mut j = SMatrix::<f64, 2, 6>::zeros();
            j.fixed_columns_mut::<3>(0).copy_from(&by_point);
            j.fixed_columns_mut::<3>(3).copy_from(&(-by_point * p.coords.cross_matrix()));
            let residual = projected - pixel;
            let weight = loss.weight(residual.norm_squared());
            normal += weight * j.transpose() * j;
            right -= weight * j.transpose() * residual;
        }
        for k in 0..6 {
            normal[(k, k)] *= 1.0 + damping;
        }
        let step = normal.cholesky()?.solve(&right);
        let mut moved = Isometry3::rotation(Vector3::new(step[3], step[4], step[5])) * pose;
        moved.translation.vector += Vector3::new(step[0], step[1], step[2]);
        let (before, after) = (cost(&pose), cost(&moved));
        if after < before {
            pose = moved;
            damping = (damping * 0.2).max(1e-9);
        } else {
            damping *= 10.0;
        }
        let settled = after >= before * (1.0 - 1e-4) || damping > 1e6;
        if settled && scale <= inlier_px {
            if damping > 1e6 || (after < before && after >= before * (1.0 - 1e-7)) {
                break;
            }
        } else {
            let left = median(&errors(&pose))?;
            scale = (0.7 * scale).min(1.5 * left).max(inlier_px);
        }
    }
    pose.rotation.renormalize();
    let found = errors(&pose);
    let inliers = found.iter().filter(|e| **e <= 2.0 * inlier_px).count();
    let limit = (4.0 * inlier_px).powi(2);
    let cost = found.iter().map(|e| (e * e).min(limit)).sum::<f64>() / found.len() as f64;
    Some(ResectedPose { camera_from_world: pose, inliers, cost })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_far_guess_and_wrong_points_are_overcome() {
        let camera = Intrinsics::from_horizontal_fov(640, 480, 65.0);
        let truth = Isometry3::new(Vector3::new(0.2, -0.1, 0.3), Vector3::new(0.1, 0.2, -0.1));
        let pairs: Vec<_> = (0..60)
            .map(|i| {
                let s = f64::from(i);
                let p = truth.inverse()
                    * Point3::new((1.7 * s).sin() * 1.2, (2.3 * s).cos() * 0.9, 4.0 + (0.9 * s).sin() * 1.5);
                let off = if i % 4 == 0 { 60.0 * (3.1 * s).sin() } else { 0.0 };
                let pixel = camera.project(&(truth * p)).unwrap();
                (p, Point2::new(pixel.x + off, pixel.y - 0.5 * off))
            })
            .collect();
        let start = Isometry3::new(Vector3::new(0.05, 0.0, 0.1), Vector3::new(0.05, 0.02, 0.0)); // ~100 px off
        let found = resect(&camera, &pairs, &start, 1.0).unwrap();
        assert!(found.camera_from_world.rotation.angle_to(&truth.rotation) < 1e-3);
        assert!((found.camera_from_world.translation.vector - truth.translation.vector).norm() < 5e-3);
        assert!(found.inliers >= 45);
        assert!(resect(&camera, &pairs[..5], &start, 1.0).is_none());
    }
}
