//! One observation's residual and its analytic Jacobians.
//!
//! A pose has the parameters of [`calib::least_squares`]. The shared intrinsics are `(ln f, k1, k2)`: the focal lengths
//! keep their ratio.

use calib::Intrinsics;
use calib::least_squares::by_pose;
use nalgebra::{Isometry3, Matrix2x3, Matrix3, Point2, Point3, SMatrix, Vector2, Vector3};

/// Least depth with which a point has an image, in the scene's unit.
const MIN_DEPTH: f64 = 1e-6;

/// Derivative of a pixel by the pose's six parameters.
pub(super) type PoseJacobian = SMatrix<f64, 2, 6>;
/// Derivative of a pixel by `(ln f, k1, k2)`.
pub(super) type LensJacobian = SMatrix<f64, 2, 3>;

/// A pose as a matrix, for the multiplication of many points.
pub(super) struct PoseMatrix {
    pub(super) rotation: Matrix3<f64>,
    translation: Vector3<f64>,
}

impl PoseMatrix {
    pub(super) fn new(pose: &Isometry3<f64>) -> Self {
        Self {
            rotation: pose.rotation.to_rotation_matrix().into_inner(),
            translation: pose.translation.vector,
        }
    }

    /// World point in the camera's coordinates; `None` behind the camera.
    fn before(&self, point: &Point3<f64>) -> Option<Point3<f64>> {
        let p = self.rotation * point.coords + self.translation;
        (p.z >= MIN_DEPTH).then_some(Point3::from(p))
    }
}

/// A residual with the factors of the derivatives of the projected pixel.
pub(super) struct Linearised {
    pub(super) residual: Vector2<f64>,
    /// `X_c`.
    pub(super) camera_point: Point3<f64>,
    /// Derivative of the pixel by `X_c`.
    pub(super) by_camera_point: Matrix2x3<f64>,
}

impl Linearised {
    /// Derivative by the pose.
    pub(super) fn by_pose(&self) -> PoseJacobian {
        self.by_camera_point * by_pose(&self.camera_point)
    }

    /// Derivative by the world point.
    pub(super) fn by_point(&self, pose: &PoseMatrix) -> Matrix2x3<f64> {
        self.by_camera_point * pose.rotation
    }

    /// Derivative by the lens.
    pub(super) fn by_lens(&self, lens: &Intrinsics) -> LensJacobian {
        let p = &self.camera_point;
        let n = Vector2::new(p.x / p.z, p.y / p.z);
        let (d, [a, b]) = (lens.distortion.distort(n), lens.distortion.leading_factors(n));
        LensJacobian::new(
            lens.fx * d.x,
            lens.fx * n.x * a,
            lens.fx * n.x * a * b,
            lens.fy * d.y,
            lens.fy * n.y * a,
            lens.fy * n.y * a * b,
        )
    }
}

/// Projected minus measured pixel; `None` behind the camera.
pub(super) fn residual(
    lens: &Intrinsics,
    pose: &PoseMatrix,
    point: &Point3<f64>,
    pixel: &Point2<f64>,
) -> Option<Vector2<f64>> {
    Some(off(lens, &pose.before(point)?, pixel))
}

/// [`residual`] with its derivatives.
pub(super) fn linearise(
    lens: &Intrinsics,
    pose: &PoseMatrix,
    point: &Point3<f64>,
    pixel: &Point2<f64>,
) -> Option<Linearised> {
    let camera_point = pose.before(point)?;
    let by_camera_point = lens.project_jacobian(&camera_point);
    Some(Linearised { residual: off(lens, &camera_point, pixel), camera_point, by_camera_point })
}

fn off(lens: &Intrinsics, p: &Point3<f64>, pixel: &Point2<f64>) -> Vector2<f64> {
    let d = lens.distortion.distort(Vector2::new(p.x / p.z, p.y / p.z));
    Vector2::new(lens.fx * d.x + lens.cx - pixel.x, lens.fy * d.y + lens.cy - pixel.y)
}

/// Camera after a step of `(ln f, k1, k2)`.
pub(super) fn moved_lens(lens: &Intrinsics, step: &[f64]) -> Intrinsics {
    let mut moved = lens.clone();
    moved.fx *= step[0].exp();
    moved.fy *= step[0].exp();
    moved.distortion = moved.distortion.bent([step[1], step[2]]);
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::least_squares::moved_pose;
    use calib::{Distortion, Fisheye, Rational};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn jacobians_match_finite_differences(
            x in -1.0..1.0, y in -1.0..1.0, z in 2.0..6.0,
            turn in prop::array::uniform3(-0.4..0.4), shift in prop::array::uniform3(-0.5..0.5), which in 0..3usize,
        ) {
            let mut lens = Intrinsics::from_horizontal_fov(640, 480, 70.0);
            let models: [Distortion; 3] = [
                [-0.1, 0.03, 0.001, -0.002, 0.0].into(),
                Rational::from([0.2, 0.05, 0.001, -0.002, 0.01, 0.4, 0.1, 0.01]).into(),
                Fisheye::from([-0.02, 0.005, -0.001, 0.0002]).into(),
            ];
            lens.distortion = models[which];
            let pose = Isometry3::new(Vector3::from(shift), Vector3::from(turn));
            let (point, pixel) = (Point3::new(x, y, z), Point2::new(200.0, 300.0));
            let matrix = PoseMatrix::new(&pose);
            let analytic = linearise(&lens, &matrix, &point, &pixel).unwrap();
            let h = 1e-6;
            let check = |column: Vector2<f64>, at: &dyn Fn(f64) -> Vector2<f64>| {
                let numeric = (at(h) - at(-h)) / (2.0 * h);
                (numeric - column).norm() < 1e-4 * (1.0 + numeric.norm())
            };
            for k in 0..6 {
                let at = |s: f64| {
                    let mut step = [0.0; 6];
                    step[k] = s;
                    residual(&lens, &PoseMatrix::new(&moved_pose(&pose, &step)), &point, &pixel).unwrap()
                };
                prop_assert!(check(analytic.by_pose().column(k).into(), &at), "pose {k}");
            }
            for k in 0..3 {
                let by_point = |s: f64| {
                    let mut p = point;
                    p[k] += s;
                    residual(&lens, &matrix, &p, &pixel).unwrap()
                };
                prop_assert!(check(analytic.by_point(&matrix).column(k).into(), &by_point), "point {k}");
                let by_lens = |s: f64| {
                    let mut step = [0.0; 3];
                    step[k] = s;
                    residual(&moved_lens(&lens, &step), &matrix, &point, &pixel).unwrap()
                };
                prop_assert!(check(analytic.by_lens(&lens).column(k).into(), &by_lens), "lens {k}");
            }
        }
    }
}
