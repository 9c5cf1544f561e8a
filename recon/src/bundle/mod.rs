//! Bundle adjustment: Levenberg–Marquardt over poses, points and, if asked, the lens, with the points eliminated.
//!
//! B. Triggs, P. `McLauchlan`, R. Hartley, A. Fitzgibbon, "Bundle adjustment — a modern synthesis" (2000), section 6.1;
//! the damping follows H. B. Nielsen (1999). With cameras `c`, the shared lens `k` and points `p`, a step solves
//!
//! ```text
//! ┌             ┐ ┌    ┐   ┌    ┐      U: one 6×6 block a camera, and the lens's border
//! │ U     W     │ │ δc │   │ gc │      V: one 3×3 block a point
//! │    ·        │ │ δk │ = │ gk │      W: one 6×3 block an observation
//! │ Wᵀ    V     │ │ δp │   │ gp │
//! └             ┘ └    ┘   └    ┘
//!
//! (U − W V⁻¹ Wᵀ) (δc, δk) = (gc, gk) − W V⁻¹ gp        the reduced system, [`schur`]
//! δp = V⁻¹ (gp − Wᵀ (δc, δk))
//! ```
//!
//! Made for one capture: up to a few hundred frames and some ten thousand points. The reduced matrix is dense. All
//! sums run in a fixed order, so the result does not depend on the number of threads.

mod lens_evidence;
mod loss;
mod residual;
mod schur;

use calib::Intrinsics;
use nalgebra::{Isometry3, Point2, Point3};
use rayon::prelude::*;

pub use lens_evidence::{LensEvidence, lens_evidence};
pub use loss::Loss;
use residual::PoseMatrix;
use schur::NormalEquations;

/// Squared residual, in pixels, of an observation behind its camera, and the largest of any.
const SQUARED_BEHIND_CAMERA: f64 = 1e6;

/// Observation of one point by one camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Index into [`BundleProblem::poses`].
    pub pose: usize,
    /// Pixel (distorted, as in the image).
    pub pixel: Point2<f64>,
}

/// Unknowns and observations of an adjustment.
#[derive(Debug, Clone)]
pub struct BundleProblem {
    /// Intrinsics shared by all poses.
    pub intrinsics: Intrinsics,
    /// Poses (`camera_from_world`).
    pub poses: Vec<Isometry3<f64>>,
    /// World points.
    pub points: Vec<Point3<f64>>,
    /// The observations of each point, in the same order as `points`.
    pub observations: Vec<Vec<Observation>>,
}

/// Free parameters of the lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LensFreedom {
    /// Calibrated: none is free.
    #[default]
    Fixed,
    /// Focal lengths, in their ratio.
    Focal,
    /// Focal lengths and the radial coefficients k1 and k2.
    FocalRadial,
}

impl LensFreedom {
    /// Number of free parameters.
    fn count(self) -> usize {
        match self {
            Self::Fixed => 0,
            Self::Focal => 1,
            Self::FocalRadial => 3,
        }
    }
}

/// Options of an adjustment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BundleOptions {
    /// Robust loss of the residual in pixels.
    pub loss: Loss,
    /// Index of the pose that is held fixed.
    pub fixed_pose: usize,
    /// Free parameters of the lens.
    pub lens: LensFreedom,
    /// Largest number of steps.
    pub max_steps: usize,
    /// Relative decrease of the cost below which the adjustment ends.
    pub cost_end: f64,
}

impl Default for BundleOptions {
    fn default() -> Self {
        Self {
            loss: Loss::Cauchy(1.0),
            fixed_pose: 0,
            lens: LensFreedom::Fixed,
            max_steps: 40,
            cost_end: 1e-6,
        }
    }
}

/// Report of an adjustment.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BundleReport {
    /// Steps taken or tried.
    pub steps: usize,
    /// Σ ρ before the adjustment.
    pub initial_cost: f64,
    /// Σ ρ after the adjustment.
    pub final_cost: f64,
    /// Root mean square residual after the adjustment (a pixel distance), outliers included.
    pub rms_px: f64,
}

impl BundleProblem {
    /// Number of observations.
    pub fn observation_count(&self) -> usize {
        self.observations.iter().map(Vec::len).sum()
    }

    /// Distance between projected and measured pixel; infinite behind the camera.
    pub fn error_px(&self, point: usize, observation: &Observation) -> f64 {
        let pose = PoseMatrix::new(&self.poses[observation.pose]);
        residual::residual(&self.intrinsics, &pose, &self.points[point], &observation.pixel)
            .map_or(f64::INFINITY, |r| r.norm())
    }

    fn pose_matrices(&self) -> Vec<PoseMatrix> {
        self.poses.iter().map(PoseMatrix::new).collect()
    }

    /// Squared distance between projected and measured pixel.
    fn squared_error(&self, poses: &[PoseMatrix], point: usize, observation: &Observation) -> f64 {
        let pose = &poses[observation.pose];
        residual::residual(&self.intrinsics, pose, &self.points[point], &observation.pixel)
            .map_or(SQUARED_BEHIND_CAMERA, |r| r.norm_squared().min(SQUARED_BEHIND_CAMERA))
    }

    /// Σ ρ over all observations, in a fixed order.
    fn cost(&self, loss: Loss) -> f64 {
        let poses = self.pose_matrices();
        let each: Vec<f64> = (0..self.points.len())
            .into_par_iter()
            .with_min_len(64)
            .map(|point| {
                let of = |o: &Observation| loss.cost(self.squared_error(&poses, point, o));
                self.observations[point].iter().map(of).sum()
            })
            .collect();
        each.iter().sum()
    }

    fn moved(&self, camera_step: &[f64], point_steps: &[nalgebra::Vector3<f64>], lens: LensFreedom) -> Self {
        let poses = self.poses.iter().zip(camera_step.chunks_exact(6));
        let mut lens_step = [0.0; 3];
        lens_step[..lens.count()].copy_from_slice(&camera_step[6 * self.poses.len()..]);
        Self {
            intrinsics: residual::moved_lens(&self.intrinsics, &lens_step),
            poses: poses.map(|(pose, step)| residual::moved_pose(pose, step)).collect(),
            points: self.points.iter().zip(point_steps).map(|(p, s)| p + s).collect(),
            observations: Vec::new(),
        }
    }
}

/// Adjusts the problem in place; its cost never increases.
///
/// A problem that does not determine its unknowns is damped, not refused; the overall scale is such an unknown.
pub fn adjust(problem: &mut BundleProblem, options: &BundleOptions) -> BundleReport {
    let mut report = BundleReport::default();
    let mut cost = problem.cost(options.loss);
    report.initial_cost = cost;
    let (mut damping, mut growth) = (1e-4, 2.0);
    let mut equations = NormalEquations::build(problem, options);
    while report.steps < options.max_steps && cost > 0.0 {
        report.steps += 1;
        let Some(step) = equations.solve(damping, options.fixed_pose) else {
            damping *= growth;
            growth *= 2.0;
            if damping > 1e12 {
                break;
            }
            continue;
        };
        let mut moved = problem.moved(&step.cameras, &step.points, options.lens);
        std::mem::swap(&mut moved.observations, &mut problem.observations);
        let new_cost = moved.cost(options.loss);
        let valid = new_cost.is_finite() && moved.intrinsics.validate().is_ok();
        let gain = (cost - new_cost) / step.predicted_gain.max(f64::MIN_POSITIVE);
        if valid && new_cost < cost {
            let fell = (cost - new_cost) / cost;
            *problem = moved;
            cost = new_cost;
            damping *= (1.0 - (2.0 * gain - 1.0).powi(3)).clamp(1.0 / 3.0, 2.0);
            damping = damping.max(1e-12);
            growth = 2.0;
            if fell < options.cost_end {
                break;
            }
            equations = NormalEquations::build(problem, options);
        } else {
            std::mem::swap(&mut moved.observations, &mut problem.observations);
            if step.predicted_gain < options.cost_end * 1e-2 * cost {
                break;
            }
            damping *= growth;
            growth *= 2.0;
            if damping > 1e12 {
                break;
            }
        }
    }
    // Many small rotations accumulate rounding errors.
    for pose in &mut problem.poses {
        pose.rotation.renormalize();
    }
    report.final_cost = cost;
    let poses = problem.pose_matrices();
    let squares: f64 = (0..problem.points.len())
        .flat_map(|p| problem.observations[p].iter().map(move |o| (p, o)))
        .map(|(p, o)| problem.squared_error(&poses, p, o))
        .sum();
    report.rms_px = (squares / problem.observation_count().max(1) as f64).sqrt();
    report
}

#[cfg(test)]
mod tests;
