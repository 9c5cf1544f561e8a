//! Uncertainty of the lens in a bundle problem with correlated errors.
//!
//! The covariance of least squares, `σ² H⁻¹`, assumes independent errors. Here they are not: a feature's patch looks a
//! little different from everywhere, so all its observations err alike, and a blurred frame moves all its observations.
//! The contribution of each observation to the lens, its influence `H⁻¹ Jᵀ w r`, is therefore summed over each feature,
//! and over each frame, before it is squared: the covariance clustered two ways of A. C. Cameron, J. B. Gelbach, D. L.
//! Miller, "Robust inference with multiway clustering" (Journal of Business & Economic Statistics 2011), equation 2.8,
//! `features + frames − single observations`.

use calib::least_squares::Problem;
use nalgebra::{DVector, Matrix3, Vector3};

use super::equations::POSE;
use super::{BundleProblem, BundleState, LensFreedom, residual};
use crate::schur::SchurStep;

/// Damping that makes the matrix, singular by the free scale, invertible; it does not affect the lens.
const DAMPING: f64 = 1e-10;

/// Estimate of `(ln f, k1, k2)` from the observations; zero where a parameter is fixed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LensEvidence {
    /// Change of the lens in the next step of adjustment, poses and points with it: zero once it has been adjusted.
    pub step: Vector3<f64>,
    /// Covariance of the estimated lens.
    pub covariance: Matrix3<f64>,
}

impl BundleProblem {
    /// Estimates the lens where poses and points have been adjusted; the options select its unknowns. `None` where the
    /// observations do not determine them.
    pub fn lens_evidence(&self, state: &BundleState) -> Option<LensEvidence> {
        let columns = self.lens_columns(state)?;
        let (lens, free) = (POSE * state.poses.len(), columns.len());
        let poses = state.pose_matrices();
        let mut of_frames = vec![Vector3::zeros(); state.poses.len()];
        let (mut features, mut singles) = (Matrix3::zeros(), Matrix3::zeros());
        let (mut step, mut weights) = (Vector3::zeros(), 0.0);
        for (point, observations) in self.observations.iter().enumerate() {
            let mut of_feature = Vector3::zeros();
            for observation in observations {
                let pose = &poses[observation.pose];
                let position = &state.points[point];
                let Some(l) = residual::linearise(&state.intrinsics, pose, position, &observation.pixel)
                else {
                    continue;
                };
                let precision = observation.precision;
                let share = self.options.loss.weight(precision * l.residual.norm_squared());
                let weight = precision * share;
                weights += share;
                let mut influence = Vector3::zeros();
                for (k, column) in columns.iter().enumerate() {
                    let moved = l.by_pose() * column.cameras.fixed_rows::<POSE>(POSE * observation.pose)
                        + l.by_point(pose) * column.points[point]
                        + l.by_lens(&state.intrinsics).columns(0, free) * column.cameras.rows(lens, free);
                    influence[k] = -weight * moved.dot(&l.residual);
                }
                of_feature += influence;
                of_frames[observation.pose] += influence;
                singles += influence * influence.transpose();
            }
            step += of_feature;
            features += of_feature * of_feature.transpose();
        }
        // Residuals are smaller than the errors, as the unknowns were fitted to them.
        let unknowns = (6 * state.poses.len() + 3 * state.points.len()) as f64;
        let freedom = 2.0 * weights - unknowns;
        if freedom <= 0.0 {
            return None;
        }
        let frames: Matrix3<f64> = of_frames.iter().map(|s| s * s.transpose()).sum();
        let both = features + frames - singles;
        let is_covariance = |m: &Matrix3<f64>| m.view((0, 0), (free, free)).into_owned().cholesky().is_some();
        // The difference may not be positive definite where either kind of cluster has nearly independent errors.
        let covariance = [both, features, singles].into_iter().find(is_covariance)?;
        Some(LensEvidence { step, covariance: covariance * (2.0 * weights / freedom) })
    }

    /// The lens's columns of the inverse of the whole matrix. `None` where the lens is fixed or nothing is determined.
    fn lens_columns(&self, state: &BundleState) -> Option<Vec<SchurStep>> {
        if self.options.lens == LensFreedom::Fixed {
            return None;
        }
        let equations = self.linearise(state);
        let factored = equations.factor(DAMPING)?;
        let (lens, free) = (POSE * state.poses.len(), self.options.lens.count());
        let points = vec![Vector3::zeros(); state.points.len()];
        let column = |k: usize| {
            let mut cameras = DVector::zeros(lens + free);
            cameras[lens + k] = 1.0;
            factored.solve(&SchurStep { cameras, points: points.clone() })
        };
        Some((0..free).map(column).collect())
    }
}
