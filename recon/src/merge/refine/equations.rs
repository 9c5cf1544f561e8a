//! Normal equations of observations: each adds its derivatives by a camera and a point.

use nalgebra::{DMatrix, DVector, SVector, Vector2};

use super::state::{POSE, RefinementState};
use super::term::LinearisedTerm;
use crate::schur::{Factored, PointBlock, SchurEquations};

/// Normal equations of weighted observations at a state.
pub(super) fn equations<'a>(
    state: &RefinementState,
    rows: impl IntoIterator<Item = (&'a LinearisedTerm, f64)>,
) -> SchurEquations<POSE> {
    let size = POSE * state.poses.len();
    let (mut u, mut right) = (DMatrix::zeros(size, size), DVector::zeros(size));
    let mut points: Vec<PointBlock<POSE>> = state.points.iter().map(|_| PointBlock::default()).collect();
    for (row, weight) in rows {
        let residual = Vector2::from(row.residual);
        if let Some((camera, by)) = &row.camera {
            let weighted = by.transpose() * weight;
            let mut of_camera = right.fixed_rows_mut::<POSE>(POSE * camera);
            of_camera -= weighted * residual;
            let mut block = u.fixed_view_mut::<POSE, POSE>(POSE * camera, POSE * camera);
            block += weighted * by;
            if let Some((point, by_point)) = &row.point {
                points[*point].edges.push((*camera, weighted * by_point));
            }
        }
        if let Some((point, by)) = &row.point {
            let weighted = by.transpose() * weight;
            points[*point].right -= weighted * residual;
            points[*point].v += weighted * by;
        }
    }
    SchurEquations::new(state.poses.len(), u, right, points)
}

/// Variance of one component of an observation.
pub(super) fn variance(factored: &Factored<'_, POSE>, row: &LinearisedTerm, side: usize) -> f64 {
    let by_cameras = row.camera.iter().map(|(camera, by)| (*camera, SVector::from(by.row(side).transpose())));
    factored.variance(by_cameras, row.point.map(|(point, by)| (point, by.row(side).transpose())))
}
