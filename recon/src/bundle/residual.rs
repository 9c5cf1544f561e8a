//! One observation's residual and its analytic Jacobians.
//!
//! The pose moves as `X_c ← exp(ω) X_c + τ` (left perturbation), so `∂X_c/∂(τ, ω) = [I, −[X_c]×]`. The shared
//! intrinsics are `(ln f, k1, k2)`: the focal lengths keep their ratio.

use calib::Intrinsics;
use nalgebra::{Isometry3, Matrix2x3, Point2, Point3, SMatrix, Vector2};

/// Points nearer to the camera plane than this (in the scene's unit) have no image.
const MIN_DEPTH: f64 = 1e-6;

/// Derivative of a pixel by the pose's six parameters: translation first.
pub(super) type PoseJacobian = SMatrix<f64, 2, 6>;
/// Derivative of a pixel by `(ln f, k1, k2)`.
pub(super) type LensJacobian = SMatrix<f64, 2, 3>;

/// A residual with the derivatives of the projected pixel.
pub(super) struct Linearised {
    pub(super) residual: Vector2<f64>,
    pub(super) pose: PoseJacobian,
    pub(super) point: Matrix2x3<f64>,
    pub(super) lens: LensJacobian,
}

/// Projected minus measured pixel; `None` behind the camera.
pub(super) fn residual(
    lens: &Intrinsics,
    pose: &Isometry3<f64>,
    point: &Point3<f64>,
    pixel: &Point2<f64>,
) -> Option<Vector2<f64>> {
    let p = pose * point;
    if p.z.is_nan() || p.z < MIN_DEPTH {
        return None;
    }
    let d = lens.distortion.distort(Vector2::new(p.x / p.z, p.y / p.z));
    Some(Vector2::new(lens.fx * d.x + lens.cx - pixel.x, lens.fy * d.y + lens.cy - pixel.y))
}

/// [`residual`] with its derivatives.
pub(super) fn linearise(
    lens: &Intrinsics,
    pose: &Isometry3<f64>,
    point: &Point3<f64>,
    pixel: &Point2<f64>,
) -> Option<Linearised> {
    let residual = residual(lens, pose, point, pixel)?;
    let p = pose * point;
    let n = Vector2::new(p.x / p.z, p.y / p.z);
    let by_camera_point = lens.project_jacobian(&p);
    let mut by_pose = PoseJacobian::zeros();
    by_pose.fixed_columns_mut::<3>(0).copy_from(&by_camera_point);
    by_pose.fixed_columns_mut::<3>(3).copy_from(&(-by_camera_point * p.coords.cross_matrix()));
    let by_point = by_camera_point * pose.rotation.to_rotation_matrix().matrix();
    let d = lens.distortion.distort(n);
    let r2 = n.norm_squared();
    let by_lens = LensJacobian::new(
        lens.fx * d.x,
        lens.fx * n.x * r2,
        lens.fx * n.x * r2 * r2,
        lens.fy * d.y,
        lens.fy * n.y * r2,
        lens.fy * n.y * r2 * r2,
    );
    Some(Linearised { residual, pose: by_pose, point: by_point, lens: by_lens })
}

/// The pose after a step of its six parameters.
pub(super) fn moved_pose(pose: &Isometry3<f64>, step: &[f64]) -> Isometry3<f64> {
    let turn = Isometry3::rotation(nalgebra::Vector3::new(step[3], step[4], step[5]));
    let mut moved = turn * pose;
    moved.translation.vector += nalgebra::Vector3::new(step[0], step[1], step[2]);
    moved
}

/// The camera after a step of `(ln f, k1, k2)`.
pub(super) fn moved_lens(lens: &Intrinsics, step: &[f64]) -> Intrinsics {
    let mut moved = lens.clone();
    moved.fx *= step[0].exp();
    moved.fy *= step[0].exp();
    moved.distortion.k1 += step[1];
    moved.distortion.k2 += step[2];
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::Distortion;
    use nalgebra::Vector3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn jacobians_match_finite_differences(
            x in -1.0..1.0, y in -1.0..1.0, z in 2.0..6.0,
            turn in prop::array::uniform3(-0.4..0.4), shift in prop::array::uniform3(-0.5..0.5),
        ) {
            let mut lens = Intrinsics::from_horizontal_fov(640, 480, 70.0);
            lens.distortion = Distortion { k1: -0.1, k2: 0.03, p1: 0.001, p2: -0.002, k3: 0.0 };
            let pose = Isometry3::new(Vector3::from(shift), Vector3::from(turn));
            let (point, pixel) = (Point3::new(x, y, z), Point2::new(200.0, 300.0));
            let analytic = linearise(&lens, &pose, &point, &pixel).unwrap();
            let h = 1e-6;
            let check = |column: Vector2<f64>, at: &dyn Fn(f64) -> Vector2<f64>| {
                let numeric = (at(h) - at(-h)) / (2.0 * h);
                (numeric - column).norm() < 1e-4 * (1.0 + numeric.norm())
            };
            for k in 0..6 {
                let at = |s: f64| {
                    let mut step = [0.0; 6];
                    step[k] = s;
                    residual(&lens, &moved_pose(&pose, &step), &point, &pixel).unwrap()
                };
                prop_assert!(check(analytic.pose.column(k).into(), &at), "pose {k}");
            }
            for k in 0..3 {
                let by_point = |s: f64| {
                    let mut p = point;
                    p[k] += s;
                    residual(&lens, &pose, &p, &pixel).unwrap()
                };
                prop_assert!(check(analytic.point.column(k).into(), &by_point), "point {k}");
                let by_lens = |s: f64| {
                    let mut step = [0.0; 3];
                    step[k] = s;
                    residual(&moved_lens(&lens, &step), &pose, &point, &pixel).unwrap()
                };
                prop_assert!(check(analytic.lens.column(k).into(), &by_lens), "lens {k}");
            }
        }
    }
}
