//! Uncertainty of a calibrated camera's rays over its picture, by propagation of the corners' errors.
//!
//! The normal equations of all views (those of the lens, and 6 of each board's pose) are reduced to the lens by the
//! Schur complement; its inverse, times the variance of a corner, is the lens's covariance Σ. A change δ of the lens moves
//! the pixel of a ray by J δ. A part of that is a rotation of the camera, which no picture shows and every pose takes up:
//! it is removed by the rotation that fits best where corners were seen. What remains, (J − R M) Σ (J − R M)ᵀ, is small
//! where boards were and grows where the model only extrapolates.

use nalgebra::{DMatrix, Matrix3, Matrix3xX, Point2, Point3, SMatrix, Vector3};

use crate::Intrinsics;
pub use crate::board_adjustment::BoardView;
use crate::board_adjustment::{ViewBlocks, lens_jacobian};

/// Uncertainty of the rays of a calibrated camera.
#[derive(Debug, Clone)]
pub struct RayUncertainty {
    intrinsics: Intrinsics,
    /// Of fx, fy, cx, cy and the coefficients of the distortion.
    covariance: DMatrix<f64>,
    /// Rotation that compensates a change of the lens, radians.
    rotation_of_lens: Matrix3xX<f64>,
}

impl RayUncertainty {
    /// Propagates the errors of the corners, of the residuals' size but at least `least_sigma_px`. `None` where the views
    /// do not determine the lens.
    pub fn of(intrinsics: &Intrinsics, views: &[BoardView], least_sigma_px: f64) -> Option<Self> {
        let size = 4 + intrinsics.distortion.model().coefficient_names().len();
        let mut reduced = DMatrix::<f64>::zeros(size, size);
        let (mut rotations, mut mixed) = (Matrix3::zeros(), Matrix3xX::<f64>::zeros(size));
        let (mut squares, mut corners) = (0.0, 0usize);
        for view in views {
            let blocks = ViewBlocks::of(intrinsics, view)?;
            for (corner, _) in &view.corners {
                let at = view.camera_from_board * corner;
                let by_turn = turn_jacobian(intrinsics, &at);
                rotations += by_turn.transpose() * by_turn;
                mixed += by_turn.transpose() * lens_jacobian(intrinsics, &at);
            }
            squares += view.mean_square_px2(intrinsics)? * view.corners.len() as f64;
            corners += view.corners.len();
            let between = &blocks.between;
            reduced += &blocks.of_lens - between.transpose() * blocks.of_pose.try_inverse()? * between;
        }
        // Pixels and coefficients differ by orders of magnitude: scaled to a unit diagonal first.
        let scale = reduced.diagonal().map(|d| 1.0 / d.sqrt());
        let scaled = DMatrix::from_fn(size, size, |r, c| reduced[(r, c)] * scale[r] * scale[c]);
        let inverse = scaled.cholesky()?.inverse();
        let beyond_need = (2 * corners).checked_sub(size + 6 * views.len()).filter(|n| *n > 0)?;
        let variance = (squares / beyond_need as f64).max(least_sigma_px * least_sigma_px);
        let covariance =
            DMatrix::from_fn(size, size, |r, c| variance * inverse[(r, c)] * scale[r] * scale[c]);
        let rotation_of_lens = rotations.try_inverse()? * mixed;
        Some(Self { intrinsics: intrinsics.clone(), covariance, rotation_of_lens })
    }

    /// Standard deviations of fx, fy, cx and cy, pixels.
    pub fn sigma_of_matrix_px(&self) -> [f64; 4] {
        std::array::from_fn(|i| self.covariance[(i, i)].max(0.0).sqrt())
    }

    /// Standard deviation of the pixel of the ray that is seen at `pixel`, pixels; `None` where the lens model has no ray.
    pub fn sigma_px(&self, pixel: &Point2<f64>) -> Option<f64> {
        let ray: Vector3<f64> = self.intrinsics.unproject(pixel)?;
        let at = Point3::from(ray);
        let moved = lens_jacobian(&self.intrinsics, &at)
            - turn_jacobian(&self.intrinsics, &at) * &self.rotation_of_lens;
        Some((&moved * &self.covariance * moved.transpose()).trace().max(0.0).sqrt())
    }

    /// Standard deviations on an even grid over the picture, corners included, row by row: the pixel, and its deviation.
    pub fn over_picture(&self, columns: u32, rows: u32) -> Vec<(Point2<f64>, Option<f64>)> {
        let k = &self.intrinsics;
        let place = |i: u32, count: u32, side: u32| {
            f64::from(i) / f64::from(count.max(2) - 1) * (f64::from(side) - 1.0)
        };
        let pixels = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        let pixel = |(row, column)| Point2::new(place(column, columns, k.width), place(row, rows, k.height));
        pixels.map(pixel).map(|pixel| (pixel, self.sigma_px(&pixel))).collect()
    }
}

/// Derivative of a point's pixel with respect to a rotation of the point about the camera's centre.
fn turn_jacobian(k: &Intrinsics, at: &Point3<f64>) -> SMatrix<f64, 2, 3> {
    k.project_jacobian(at) * -at.coords.cross_matrix()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::least_squares::by_pose;
    use crate::{Distortion, Fisheye, Rational};
    use nalgebra::{Isometry3, Vector2};
    use proptest::prelude::*;

    /// Number of parameters of the lens of these tests.
    const LENS: usize = 9;

    fn lens() -> Intrinsics {
        let mut k = Intrinsics::from_horizontal_fov(640, 480, 70.0);
        k.distortion = [-0.15, 0.04, 0.001, -0.0005, 0.002].into();
        k
    }

    /// Boards of 9 × 6 corners at half a metre, tilted, their middles within `reach` of the picture's half sides.
    fn views(reach: f64) -> Vec<BoardView> {
        let k = lens();
        let view = |i: usize| {
            let part = |step: f64| 2.0 * (i as f64 * step + 0.4).fract() - 1.0;
            let pixel = Point2::new(k.cx + reach * 300.0 * part(0.618), k.cy + reach * 220.0 * part(0.414));
            let middle = k.unproject(&pixel).unwrap() * 0.6;
            let turn = Vector3::new(0.6 * part(0.29), 0.6 * part(0.73), 0.3 * part(0.91));
            let pose = Isometry3::new(middle, turn);
            let on_board =
                (0..54).map(|c| Point3::new(f64::from(c % 9) - 4.0, f64::from(c / 9) - 2.5, 0.0) * 0.02);
            let corners = on_board
                .map(|corner| (corner, k.project(&(pose * corner))))
                .filter_map(|(c, p)| Some((c, p?)));
            BoardView { camera_from_board: pose, corners: corners.collect() }
        };
        (0..14).map(view).collect()
    }

    #[test]
    fn boards_in_the_middle_leave_the_corners_uncertain() {
        let at = |reach: f64, pixel: Point2<f64>| {
            RayUncertainty::of(&lens(), &views(reach), 0.1).unwrap().sigma_px(&pixel).unwrap()
        };
        let (middle, corner) = (Point2::new(320.0, 240.0), Point2::new(2.0, 2.0));
        assert!(at(0.9, corner) < 3.0 && at(0.9, middle) < 0.2, "{} {}", at(0.9, corner), at(0.9, middle));
        assert!(
            at(0.15, corner) > 5.0 && at(0.15, middle) < 0.2,
            "{} {}",
            at(0.15, corner),
            at(0.15, middle)
        );
    }

    proptest! {
        #[test]
        fn the_lens_jacobian_matches_finite_differences(
            x in -0.7..0.7, y in -0.5..0.5, z in 0.4..5.0, which in 0..3usize,
        ) {
            let lenses: [Distortion; 3] = [
                lens().distortion,
                Rational::from([0.1, 0.04, 0.001, -0.002, 0.01, 0.3, 0.05, 0.01]).into(),
                Fisheye::from([-0.02, 0.004, -0.001, 0.0003]).into(),
            ];
            let k = Intrinsics { distortion: lenses[which], ..lens() };
            let at = Point3::new(x * z, y * z, z);
            let analytic = lens_jacobian(&k, &at);
            for parameter in 0..analytic.ncols() {
                let step = if parameter < 4 { 1e-4 } else { 1e-6 };
                let moved = |by: f64| {
                    let mut k = k.clone();
                    let mut coefficients = k.distortion.coefficients();
                    let numbers = [&mut k.fx, &mut k.fy, &mut k.cx, &mut k.cy].into_iter();
                    *numbers.chain(&mut coefficients).nth(parameter).unwrap() += by;
                    k.distortion = Distortion::new(k.distortion.model(), &coefficients).unwrap();
                    k.project(&at).unwrap()
                };
                let numeric: Vector2<f64> = (moved(step) - moved(-step)) / (2.0 * step);
                let difference = (analytic.column(parameter) - numeric).norm();
                prop_assert!(difference < 1e-4 * (1.0 + numeric.norm()), "{parameter}: {difference}");
            }
        }
    }

    /// Calibrations from corners with random errors scatter as much as is propagated: held to 60 of them, each by one
    /// Gauss–Newton step, which is exact to first order.
    #[test]
    fn the_propagated_deviation_is_the_scatter_of_calibrations() {
        let (k, views) = (lens(), views(0.5));
        let told = RayUncertainty::of(&k, &views, 0.1).unwrap();
        let mut state = 7u64;
        let mut error = || {
            // The sum of twelve uniform numbers has variance 1.
            let mut sum = -6.0;
            for _ in 0..12 {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                sum += (state >> 11) as f64 / (1u64 << 53) as f64;
            }
            0.1 * sum
        };
        let size = LENS + 6 * views.len();
        let mut changes = Vec::new();
        for _ in 0..60 {
            let mut matrix = DMatrix::<f64>::zeros(size, size);
            let mut right = nalgebra::DVector::<f64>::zeros(size);
            for (v, view) in views.iter().enumerate() {
                for (corner, _) in &view.corners {
                    let at = view.camera_from_board * corner;
                    let mut row = DMatrix::<f64>::zeros(2, size);
                    row.view_mut((0, 0), (2, LENS)).copy_from(&lens_jacobian(&k, &at));
                    row.view_mut((0, LENS + 6 * v), (2, 6))
                        .copy_from(&(k.project_jacobian(&at) * by_pose(&at)));
                    matrix += row.transpose() * &row;
                    right += row.transpose() * Vector2::new(error(), error());
                }
            }
            let step = matrix.cholesky().unwrap().solve(&right);
            changes.push(SMatrix::<f64, LENS, 1>::from_iterator(step.iter().take(LENS).copied()));
        }
        for pixel in [Point2::new(20.0, 20.0), Point2::new(320.0, 240.0), Point2::new(600.0, 240.0)] {
            let at = Point3::from(k.unproject(&pixel).unwrap());
            let moved = lens_jacobian(&k, &at) - turn_jacobian(&k, &at) * &told.rotation_of_lens;
            let squares: f64 = changes.iter().map(|change| (&moved * change).norm_squared()).sum();
            let (scatter, sigma) = ((squares / 60.0).sqrt(), told.sigma_px(&pixel).unwrap());
            assert!((scatter / sigma - 1.0).abs() < 0.35, "{pixel}: scatter {scatter}, told {sigma}");
        }
    }
}
