//! Levenberg–Marquardt on the reprojection error (Hartley & Zisserman, *Multiple View Geometry*, 2nd ed., appendix
//! 6.2): of the pose alone, or of the pose and the lens.

use nalgebra::{Cholesky, Isometry3, Point2, SMatrix, SVector, Translation3, UnitQuaternion};

use super::Pick;
use crate::{Camera, Intrinsics};

/// Limit of the steps; a dozen suffice from a linear start.
const MAX_STEPS: usize = 100;

/// `JᵀJ` and `Jᵀr`, r the residuals.
type PoseEquations<const N: usize> = (SMatrix<f64, N, N>, SVector<f64, N>);

/// The pose of least reprojection error near `start`.
pub(super) fn pose(intrinsics: &Intrinsics, picks: &[Pick], start: Isometry3<f64>) -> Isometry3<f64> {
    let camera = |pose: &Isometry3<f64>| Camera { intrinsics: intrinsics.clone(), camera_from_world: *pose };
    descend(
        start,
        |pose| squared_error(&camera(pose), picks),
        |pose| normal_equations(&camera(pose), picks, |_, by_pose: SMatrix<f64, 2, 6>| by_pose),
        |pose, step: &SVector<f64, 6>| moved(pose, step),
    )
}

/// The camera of least reprojection error near `start`: its pose, focal lengths and principal point; and the normal
/// equations' matrix there, in the order fx, fy, cx, cy, turn, shift.
pub(super) fn camera(picks: &[Pick], start: Camera) -> (Camera, SMatrix<f64, 10, 10>) {
    let equations = |camera: &Camera| {
        normal_equations(camera, picks, |seen, by_pose| {
            let k = &camera.intrinsics;
            let mut j = SMatrix::<f64, 2, 10>::zeros();
            (j[(0, 0)], j[(1, 1)]) = ((seen.x - k.cx) / k.fx, (seen.y - k.cy) / k.fy);
            (j[(0, 2)], j[(1, 3)]) = (1.0, 1.0);
            j.fixed_columns_mut::<6>(4).copy_from(&by_pose);
            j
        })
    };
    let found = descend(
        start,
        |camera| squared_error(camera, picks),
        equations,
        |camera, step: &SVector<f64, 10>| {
            let k = &camera.intrinsics;
            let intrinsics = Intrinsics {
                fx: k.fx + step[0],
                fy: k.fy + step[1],
                cx: k.cx + step[2],
                cy: k.cy + step[3],
                ..k.clone()
            };
            let camera_from_world = moved(&camera.camera_from_world, &step.fixed_rows::<6>(4).into_owned());
            Camera { intrinsics, camera_from_world }
        },
    );
    let (hessian, _) = equations(&found);
    (found, hessian)
}

/// The pose disturbed on the left, `exp(ω, v) · camera_from_world`, so that ∂(R X + t) = ω × (R X + t) + v.
fn moved(pose: &Isometry3<f64>, step: &SVector<f64, 6>) -> Isometry3<f64> {
    let [turn, shift] = [0, 3].map(|first| step.fixed_rows::<3>(first).into_owned());
    Isometry3::from_parts(Translation3::from(shift), UnitQuaternion::from_scaled_axis(turn)) * pose
}

/// Sum of squared residuals, pixels²; infinite where a point is behind the camera, or the camera is invalid.
fn squared_error(camera: &Camera, picks: &[Pick]) -> f64 {
    if camera.intrinsics.validate().is_err() {
        return f64::INFINITY;
    }
    let error =
        |p: &Pick| camera.project(&p.world).map_or(f64::INFINITY, |seen| (seen - p.pixel).norm_squared());
    picks.iter().map(error).sum()
}

/// Normal equations of the picks; `extended` makes a pick's whole Jacobian from its pixel and the part of the pose.
fn normal_equations<const N: usize>(
    camera: &Camera,
    picks: &[Pick],
    extended: impl Fn(&Point2<f64>, SMatrix<f64, 2, 6>) -> SMatrix<f64, 2, N>,
) -> PoseEquations<N> {
    let (mut hessian, mut gradient) = (SMatrix::zeros(), SVector::zeros());
    for pick in picks {
        let x = camera.camera_from_world * pick.world;
        let Some(seen) = camera.intrinsics.project(&x) else { continue };
        let by_point = camera.intrinsics.project_jacobian(&x);
        let mut by_pose = SMatrix::<f64, 2, 6>::zeros();
        by_pose.fixed_columns_mut::<3>(0).copy_from(&(-by_point * x.coords.cross_matrix()));
        by_pose.fixed_columns_mut::<3>(3).copy_from(&by_point);
        let j = extended(&seen, by_pose);
        hessian += j.transpose() * j;
        gradient += j.transpose() * (seen - pick.pixel);
    }
    (hessian, gradient)
}

fn descend<S, const N: usize>(
    start: S,
    cost: impl Fn(&S) -> f64,
    equations: impl Fn(&S) -> PoseEquations<N>,
    moved: impl Fn(&S, &SVector<f64, N>) -> S,
) -> S {
    let (mut state, mut damping) = (start, 1e-3);
    let mut error = cost(&state);
    for _ in 0..MAX_STEPS {
        let (hessian, gradient) = equations(&state);
        let damped = hessian + SMatrix::from_diagonal(&(hessian.diagonal() * damping));
        let Some(step) = Cholesky::new(damped).map(|c| c.solve(&-gradient)) else { break };
        let candidate = moved(&state, &step);
        let candidate_error = cost(&candidate);
        if candidate_error < error || !error.is_finite() {
            let converged = step.norm() < 1e-12;
            (state, error, damping) = (candidate, candidate_error, damping * 0.1);
            if converged {
                break;
            }
        } else {
            damping *= 10.0;
            if damping > 1e12 {
                break;
            }
        }
    }
    state
}
