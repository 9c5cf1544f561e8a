//! Parameters of the joint refinement: the cameras' similarities and the picked points.

use calib::least_squares::moved_similarity;
use nalgebra::{Point3, SMatrix, Similarity3};

use crate::schur::SchurStep;

/// Number of parameters of a camera.
pub(super) const POSE: usize = 7;

/// Derivatives of a residual by a pose: a row for each component.
pub(super) type ByCamera = SMatrix<f64, 2, POSE>;
/// Derivatives of a residual by a point.
pub(super) type ByPoint = SMatrix<f64, 2, 3>;

/// Present cameras and points.
#[derive(Clone)]
pub(super) struct RefinementState {
    /// Similarities from each camera's own frame into the common one; the first is fixed.
    pub(super) poses: Vec<Similarity3<f64>>,
    /// Points in the common frame; `None` for a point that was left out.
    pub(super) points: Vec<Option<Point3<f64>>>,
}

impl RefinementState {
    /// State after a step of all parameters.
    pub(super) fn moved(&self, by: &SchurStep) -> Self {
        let steps = by.cameras.as_slice().chunks_exact(POSE);
        let moved = |(i, (pose, step)): (usize, (&Similarity3<f64>, &[f64]))| match i {
            0 => *pose,
            _ => moved_similarity(pose, step),
        };
        Self {
            poses: self.poses.iter().zip(steps).enumerate().map(moved).collect(),
            points: self.points.iter().zip(&by.points).map(|(point, step)| point.map(|p| p + step)).collect(),
        }
    }
}
