//! Bundle adjustment: least squares over poses, points and, if asked, the lens (B. Triggs, P. `McLauchlan`, R. Hartley,
//! A. Fitzgibbon, "Bundle adjustment — a modern synthesis", 2000). The first pose is fixed; where points are known to lie on
//! the plane z = 0, its centre alone, so that its distance from the plane is the unit of length. [`crate::schur`] eliminates
//! the points, [`calib::least_squares`] has the loop.
//!
//! All sums run in a fixed order, so the result does not depend on the number of threads.

mod equations;
mod lens_evidence;
mod residual;

use calib::Intrinsics;
use calib::least_squares::{self, Loss, Options, Problem, Report, moved_pose};
use nalgebra::{Isometry3, Point2, Point3};
use rayon::prelude::*;

use crate::schur::{SchurEquations, SchurStep};
use equations::POSE;
pub use lens_evidence::LensEvidence;
use residual::PoseMatrix;

/// Squared residual, in pixels, of an observation behind its camera, and the largest of any.
const SQUARED_BEHIND_CAMERA: f64 = 1e6;

/// Observation of one point by one camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Index into [`BundleState::poses`].
    pub pose: usize,
    /// Pixel (distorted, as in the image).
    pub pixel: Point2<f64>,
    /// Inverse of its variance, in that of the most precise observations: its squared residual counts so many times.
    pub precision: f64,
}

impl Observation {
    /// Observation as precise as any other.
    pub fn new(pose: usize, pixel: Point2<f64>) -> Self {
        Self { pose, pixel, precision: 1.0 }
    }
}

/// Unknowns of an adjustment.
#[derive(Debug, Clone)]
pub struct BundleState {
    /// Intrinsics shared by all poses.
    pub intrinsics: Intrinsics,
    /// Poses (`camera_from_world`).
    pub poses: Vec<Isometry3<f64>>,
    /// World points.
    pub points: Vec<Point3<f64>>,
}

/// Observations of an adjustment, and its options.
#[derive(Debug, Clone)]
pub struct BundleProblem {
    /// The observations of each point, in the same order as [`BundleState::points`].
    pub observations: Vec<Vec<Observation>>,
    /// Inverse of the variance with which the points lie on the plane z = 0, in that of the most precise observations
    /// (pixel² a unit²): one a point, 0 for points elsewhere. Empty where there is no such plane.
    pub on_plane: Vec<f64>,
    /// Options of the adjustment.
    pub options: BundleOptions,
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
    /// The same of a lens of which nothing is known: weak prior knowledge keeps k1 and k2 near those of lenses that are made
    /// where few views do not determine them.
    Unknown,
}

/// Standard deviations of k1 and k2 over lenses that are made, none of them a fisheye.
const MADE_SIGMA: [f64; 2] = [0.25, 0.15];
/// Noise of a pixel coordinate, pixels, to which prior knowledge is compared.
const USUAL_NOISE_PX: f64 = 0.2;

impl LensFreedom {
    /// Number of free parameters.
    fn count(self) -> usize {
        match self {
            Self::Fixed => 0,
            Self::Focal => 1,
            Self::FocalRadial | Self::Unknown => 3,
        }
    }

    /// Weights of the squares of `(ln f, k1, k2)`, about a lens without distortion, beside squared residuals in pixels.
    fn prior(self) -> [f64; 3] {
        match self {
            Self::Unknown => {
                let [k1, k2] = MADE_SIGMA.map(|sigma| (USUAL_NOISE_PX / sigma).powi(2));
                [0.0, k1, k2]
            }
            _ => [0.0; 3],
        }
    }

    /// Cost of a lens by prior knowledge.
    fn prior_cost(self, lens: &Intrinsics) -> f64 {
        let ([_, a, b], [k1, k2]) = (self.prior(), lens.distortion.leading());
        a * k1 * k1 + b * k2 * k2
    }
}

/// Options of an adjustment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BundleOptions {
    /// Robust loss of the residual in pixels. Default Cauchy's from one pixel.
    pub loss: Loss,
    /// Free parameters of the lens. Default none.
    pub lens: LensFreedom,
    /// Limits of the minimisation. Default 40 iterations, to a relative decrease of the cost of 1e-6.
    pub solver: Options,
}

impl Default for BundleOptions {
    fn default() -> Self {
        let solver = Options { max_iterations: 40, cost_tolerance: 1e-6, ..Options::default() };
        Self { loss: Loss::Cauchy(1.0), lens: LensFreedom::Fixed, solver }
    }
}

impl BundleState {
    /// Distance between projected and measured pixel; infinite behind the camera.
    pub fn error_px(&self, point: usize, observation: &Observation) -> f64 {
        let pose = PoseMatrix::new(&self.poses[observation.pose]);
        residual::residual(&self.intrinsics, &pose, &self.points[point], &observation.pixel)
            .map_or(f64::INFINITY, |r| r.norm())
    }

    fn pose_matrices(&self) -> Vec<PoseMatrix> {
        self.poses.iter().map(PoseMatrix::new).collect()
    }
}

impl BundleProblem {
    /// Number of observations.
    pub fn observation_count(&self) -> usize {
        self.observations.iter().map(Vec::len).sum()
    }

    /// Squared residual of a point's height over the plane.
    fn squared_height(&self, index: usize, point: &Point3<f64>) -> f64 {
        self.on_plane.get(index).map_or(0.0, |precision| precision * point.z * point.z)
    }

    /// Adjusts the state; its cost never increases.
    ///
    /// A problem that does not determine its unknowns is damped, not refused; the overall scale is such an unknown.
    pub fn adjust(&self, state: &mut BundleState) -> Report {
        least_squares::minimise(self, state, &self.options.solver)
    }
}

impl Problem for BundleProblem {
    type State = BundleState;
    type Equations = SchurEquations<POSE>;

    /// Σ ρ over all observations, in a fixed order.
    fn cost(&self, state: &BundleState) -> f64 {
        if state.intrinsics.validate().is_err() {
            return f64::INFINITY;
        }
        let poses = state.pose_matrices();
        let cost = |point: &Point3<f64>, o: &Observation| {
            let residual = residual::residual(&state.intrinsics, &poses[o.pose], point, &o.pixel);
            let squared = residual.map_or(SQUARED_BEHIND_CAMERA, |r| o.precision * r.norm_squared());
            self.options.loss.cost(squared.min(SQUARED_BEHIND_CAMERA))
        };
        let each: Vec<f64> = state
            .points
            .par_iter()
            .zip(&self.observations)
            .enumerate()
            .with_min_len(64)
            .map(|(index, (point, observations))| {
                let height_cost = self.options.loss.cost(self.squared_height(index, point));
                observations.iter().map(|o| cost(point, o)).sum::<f64>() + height_cost
            })
            .collect();
        each.iter().sum::<f64>() + self.options.lens.prior_cost(&state.intrinsics)
    }

    fn linearise(&self, state: &BundleState) -> SchurEquations<POSE> {
        equations::equations(self, state)
    }

    fn moved(&self, state: &BundleState, step: &SchurStep) -> BundleState {
        let cameras = step.cameras.as_slice();
        let poses = state.poses.iter().zip(cameras.chunks_exact(POSE));
        let mut lens_step = [0.0; 3];
        lens_step[..self.options.lens.count()].copy_from_slice(&cameras[POSE * state.poses.len()..]);
        BundleState {
            intrinsics: residual::moved_lens(&state.intrinsics, &lens_step),
            poses: poses.map(|(pose, step)| moved_pose(pose, step)).collect(),
            points: state.points.iter().zip(&step.points).map(|(p, s)| p + s).collect(),
        }
    }
}

#[cfg(test)]
mod tests;
