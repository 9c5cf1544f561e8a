//! Refinement on the reprojection error (Hartley & Zisserman, *Multiple View Geometry*, 2nd ed., appendix 6.2): of the
//! pose alone, or of the pose and the lens.

use nalgebra::{Isometry3, SMatrix, SVector};

use super::Pick;
use crate::least_squares::{self, Loss, NormalEquations, Options, Problem, by_pose, minimise};
use crate::{Camera, Intrinsics};

/// Squared residual of a point behind the camera, pixels².
const SQUARED_BEHIND_CAMERA: f64 = 1e8;
/// Number of parameters of a pose.
const POSE: usize = 6;
/// Number of parameters of a pose and a lens: the pose's, then fx, fy, cx, cy.
const POSE_AND_LENS: usize = 10;

/// Reprojection of picks by a camera of which the first `N` parameters are free.
struct Reprojection<'a, const N: usize> {
    picks: &'a [Pick],
    loss: Loss,
}

/// Refines a pose from `start`: the least robust reprojection error near it.
pub fn refine_pose(
    intrinsics: &Intrinsics,
    picks: &[Pick],
    start: &Isometry3<f64>,
    loss: Loss,
    options: &Options,
) -> Isometry3<f64> {
    let mut camera = Camera { intrinsics: intrinsics.clone(), camera_from_world: *start };
    minimise(&Reprojection::<POSE> { picks, loss }, &mut camera, options);
    camera.camera_from_world
}

/// The camera of least reprojection error near `start`: its pose, focal lengths and principal point; and the normal
/// equations' matrix there, in the order rotation, translation, fx, fy, cx, cy.
pub(super) fn refine_camera(
    picks: &[Pick],
    mut camera: Camera,
) -> (Camera, SMatrix<f64, POSE_AND_LENS, POSE_AND_LENS>) {
    let problem = Reprojection { picks, loss: Loss::Squares };
    minimise(&problem, &mut camera, &Options::default());
    let matrix = problem.linearise(&camera).matrix;
    (camera, matrix)
}

impl<const N: usize> Problem for Reprojection<'_, N> {
    type State = Camera;
    type Equations = NormalEquations<N>;

    fn cost(&self, camera: &Camera) -> f64 {
        if camera.intrinsics.validate().is_err() {
            return f64::INFINITY;
        }
        let squared = |p: &Pick| {
            camera.project(&p.world).map_or(SQUARED_BEHIND_CAMERA, |seen| (seen - p.pixel).norm_squared())
        };
        self.picks.iter().map(|pick| self.loss.cost(squared(pick))).sum()
    }

    fn linearise(&self, camera: &Camera) -> NormalEquations<N> {
        let k = &camera.intrinsics;
        let mut equations = NormalEquations::default();
        for pick in self.picks {
            let x = camera.camera_from_world * pick.world;
            let Some(seen) = k.project(&x) else { continue };
            let mut jacobian = SMatrix::<f64, 2, N>::zeros();
            jacobian.columns_mut(0, POSE).copy_from(&(k.project_jacobian(&x) * by_pose(&x)));
            if N == POSE_AND_LENS {
                jacobian[(0, 6)] = (seen.x - k.cx) / k.fx;
                jacobian[(1, 7)] = (seen.y - k.cy) / k.fy;
                (jacobian[(0, 8)], jacobian[(1, 9)]) = (1.0, 1.0);
            }
            let residual = seen - pick.pixel;
            equations.add(&jacobian, &residual, self.loss.weight(residual.norm_squared()));
        }
        equations
    }

    fn moved(&self, camera: &Camera, step: &SVector<f64, N>) -> Camera {
        let step = step.as_slice();
        let mut intrinsics = camera.intrinsics.clone();
        if let [fx, fy, cx, cy] = step[POSE..] {
            intrinsics.fx += fx;
            intrinsics.fy += fy;
            intrinsics.cx += cx;
            intrinsics.cy += cy;
        }
        let camera_from_world = least_squares::moved_pose(&camera.camera_from_world, &step[..POSE]);
        Camera { intrinsics, camera_from_world }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point2, Point3, Vector3};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn jacobians_match_finite_differences(
            world in prop::array::uniform3(-1.0..1.0), turn in prop::array::uniform3(-0.5..0.5),
        ) {
            let mut intrinsics = Intrinsics::from_horizontal_fov(640, 480, 70.0);
            intrinsics.distortion = [-0.1, 0.03, 0.001, -0.002, 0.0].into();
            let camera = Camera {
                intrinsics,
                camera_from_world: Isometry3::new(Vector3::new(0.2, -0.1, 4.0), Vector3::from(turn)),
            };
            let picks = [Pick { world: Point3::from(world), pixel: Point2::new(300.0, 200.0) }];
            let problem = Reprojection::<POSE_AND_LENS> { picks: &picks, loss: Loss::Cauchy(50.0) };
            // g is half the cost's descent.
            let right = problem.linearise(&camera).right;
            for k in 0..POSE_AND_LENS {
                let h = if k < POSE { 1e-6 } else { 1e-4 };
                let at = |by: f64| {
                    let step = SVector::from_fn(|i, _| if i == k { by } else { 0.0 });
                    problem.cost(&problem.moved(&camera, &step))
                };
                let descent = -0.5 * (at(h) - at(-h)) / (2.0 * h);
                prop_assert!((right[k] - descent).abs() < 1e-5 * (1.0 + descent.abs()), "{k}: {} {descent}", right[k]);
            }
        }
    }
}
