//! Lens and boards' poses together from the boards' corners: least squares on the reprojection error of all views.
//!
//! A view adds to the normal equations a block of the lens, one of its board's pose, and one between them. The poses are
//! eliminated view by view by the Schur complement, so that the equations solved are of the lens's size alone.

use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix2xX, Matrix6, Matrix6xX, Point2, Point3, Vector2, Vector6,
};

use crate::least_squares::{
    DampedStep, Equations, Options, Problem, Report, by_pose, damp, minimise, moved_pose,
};
use crate::resection::{Pick, resect};
use crate::{Distortion, Fisheye, Intrinsics};

/// A board in one picture: where it stood, and its corners.
#[derive(Debug, Clone)]
pub struct BoardView {
    /// Pose of the board.
    pub camera_from_board: Isometry3<f64>,
    /// Corners on the board, metres, with the pixels at which they were found.
    pub corners: Vec<(Point3<f64>, Point2<f64>)>,
}

impl BoardView {
    /// Mean squared distance between the corners and their projections, pixels²; `None` where the lens shows one nowhere.
    pub fn mean_square_px2(&self, intrinsics: &Intrinsics) -> Option<f64> {
        let squared = |(corner, pixel): &(Point3<f64>, Point2<f64>)| {
            Some((intrinsics.project(&(self.camera_from_board * corner))? - pixel).norm_squared())
        };
        let sum: Option<f64> = self.corners.iter().map(squared).sum();
        Some(sum? / self.corners.len().max(1) as f64)
    }

    /// The view with the pose that a lens gives its board; `None` where the lens has no ray to a corner.
    fn posed(&self, intrinsics: &Intrinsics) -> Option<Self> {
        let picks: Vec<Pick> =
            self.corners.iter().map(|(world, pixel)| Pick { world: *world, pixel: *pixel }).collect();
        let camera_from_board = resect(intrinsics, &picks).ok()?.camera.camera_from_world;
        Some(Self { camera_from_board, corners: self.corners.clone() })
    }
}

/// Derivative of a point's pixel with respect to fx, fy, cx, cy and the coefficients of the distortion.
pub(crate) fn lens_jacobian(k: &Intrinsics, at: &Point3<f64>) -> Matrix2xX<f64> {
    let n = Vector2::new(at.x / at.z, at.y / at.z);
    let (bent, coefficients) = (k.distortion.distort(n), k.distortion.coefficient_jacobian(n));
    let mut jacobian = Matrix2xX::zeros(4 + coefficients.ncols());
    (jacobian[(0, 0)], jacobian[(1, 1)]) = (bent.x, bent.y);
    (jacobian[(0, 2)], jacobian[(1, 3)]) = (1.0, 1.0);
    for (mut column, of_coefficient) in jacobian.column_iter_mut().skip(4).zip(coefficients.column_iter()) {
        column.copy_from(&Vector2::new(k.fx * of_coefficient[0], k.fy * of_coefficient[1]));
    }
    jacobian
}

/// Part of one view in the normal equations: `H = Jᵀ J` and `g = −Jᵀ r` in blocks.
pub(crate) struct ViewBlocks {
    pub(crate) of_lens: DMatrix<f64>,
    pub(crate) of_pose: Matrix6<f64>,
    /// Rows of the pose, columns of the lens.
    pub(crate) between: Matrix6xX<f64>,
    right_of_lens: DVector<f64>,
    right_of_pose: Vector6<f64>,
}

impl ViewBlocks {
    /// The blocks of a view; `None` where the lens shows a corner nowhere.
    pub(crate) fn of(intrinsics: &Intrinsics, view: &BoardView) -> Option<Self> {
        let size = 4 + intrinsics.distortion.model().coefficient_names().len();
        let mut blocks = Self {
            of_lens: DMatrix::zeros(size, size),
            of_pose: Matrix6::zeros(),
            between: Matrix6xX::zeros(size),
            right_of_lens: DVector::zeros(size),
            right_of_pose: Vector6::zeros(),
        };
        for (corner, pixel) in &view.corners {
            let at = view.camera_from_board * corner;
            let residual = intrinsics.project(&at)? - pixel;
            let by_lens = lens_jacobian(intrinsics, &at);
            let by_board = intrinsics.project_jacobian(&at) * by_pose(&at);
            blocks.of_lens += by_lens.transpose() * &by_lens;
            blocks.of_pose += by_board.transpose() * by_board;
            blocks.between += by_board.transpose() * &by_lens;
            blocks.right_of_lens -= by_lens.transpose() * residual;
            blocks.right_of_pose -= by_board.transpose() * residual;
        }
        Some(blocks)
    }
}

/// A lens and the views of boards through it.
#[derive(Debug, Clone)]
pub(crate) struct Adjusted {
    pub(crate) intrinsics: Intrinsics,
    pub(crate) views: Vec<BoardView>,
}

/// Step of the lens's parameters, and of each board's pose.
struct Step {
    lens: DVector<f64>,
    poses: Vec<Vector6<f64>>,
}

struct BoardEquations(Vec<ViewBlocks>);

impl Equations for BoardEquations {
    type Step = Step;

    fn solve(&self, damping: f64) -> Option<DampedStep<Step>> {
        let size = self.0.first()?.right_of_lens.len();
        let (mut of_lens, mut right) = (DMatrix::zeros(size, size), DVector::zeros(size));
        for blocks in &self.0 {
            of_lens += &blocks.of_lens;
            right += &blocks.right_of_lens;
        }
        let (diagonal, gradient) = (of_lens.diagonal(), right.clone());
        let trace = diagonal.sum();
        for i in 0..size {
            of_lens[(i, i)] = damp(diagonal[i], trace, damping);
        }
        let mut eliminated = Vec::with_capacity(self.0.len());
        for blocks in &self.0 {
            let mut of_pose = blocks.of_pose;
            for i in 0..6 {
                of_pose[(i, i)] = damp(of_pose[(i, i)], blocks.of_pose.trace(), damping);
            }
            let factor = of_pose.cholesky()?;
            of_lens -= blocks.between.transpose() * factor.solve(&blocks.between);
            right -= blocks.between.transpose() * factor.solve(&blocks.right_of_pose);
            eliminated.push(factor);
        }
        let lens = of_lens.cholesky()?.solve(&right);
        let mut predicted_decrease = lens.dot(&(damping * diagonal.component_mul(&lens) + gradient));
        let mut poses = Vec::with_capacity(self.0.len());
        for (blocks, factor) in self.0.iter().zip(eliminated) {
            let pose = factor.solve(&(blocks.right_of_pose - &blocks.between * &lens));
            let damped = damping * blocks.of_pose.diagonal().component_mul(&pose);
            predicted_decrease += pose.dot(&(damped + blocks.right_of_pose));
            poses.push(pose);
        }
        Some(DampedStep { step: Step { lens, poses }, predicted_decrease })
    }
}

struct Reprojection;

impl Problem for Reprojection {
    type State = Adjusted;
    type Equations = BoardEquations;

    fn cost(&self, state: &Adjusted) -> f64 {
        let of_view =
            |view: &BoardView| Some(view.mean_square_px2(&state.intrinsics)? * view.corners.len() as f64);
        if state.intrinsics.validate().is_err() {
            return f64::INFINITY;
        }
        let sum: Option<f64> = state.views.iter().map(of_view).sum();
        sum.unwrap_or(f64::INFINITY)
    }

    fn linearise(&self, state: &Adjusted) -> BoardEquations {
        // A state with a finite cost shows every corner.
        BoardEquations(state.views.iter().filter_map(|v| ViewBlocks::of(&state.intrinsics, v)).collect())
    }

    fn moved(&self, state: &Adjusted, step: &Step) -> Adjusted {
        let k = &state.intrinsics;
        let numbers = k.distortion.coefficients();
        let moved: Vec<f64> = numbers.iter().zip(step.lens.iter().skip(4)).map(|(n, by)| n + by).collect();
        let intrinsics = Intrinsics {
            fx: k.fx + step.lens[0],
            fy: k.fy + step.lens[1],
            cx: k.cx + step.lens[2],
            cy: k.cy + step.lens[3],
            // The number of coefficients is the model's own.
            distortion: Distortion::new(k.distortion.model(), &moved).unwrap_or(k.distortion),
            ..k.clone()
        };
        let views = state.views.iter().zip(&step.poses).map(|(view, by)| BoardView {
            camera_from_board: moved_pose(&view.camera_from_board, by.as_slice()),
            corners: view.corners.clone(),
        });
        Adjusted { intrinsics, views: views.collect() }
    }
}

/// Angles from the axis at the middle of the picture's longer border, degrees, of the lenses that a fisheye's adjustment
/// starts from.
const START_HALF_ANGLES_DEG: [f64; 5] = [40.0, 52.0, 64.0, 76.0, 90.0];

/// The fisheye that shows the boards' corners where they were found, of a picture of this size: the best of adjustments
/// from several equidistant lenses. `None` where no such lens has a ray to every corner.
pub(crate) fn fit_fisheye(
    boards: &[Vec<(Point3<f64>, Point2<f64>)>],
    (width, height): (u32, u32),
) -> Option<Adjusted> {
    let views: Vec<BoardView> = boards
        .iter()
        .map(|corners| BoardView { camera_from_board: Isometry3::identity(), corners: corners.clone() })
        .collect();
    let adjusted = START_HALF_ANGLES_DEG.iter().filter_map(|half_angle_deg| {
        let focal = 0.5 * f64::from(width.max(height)) / half_angle_deg.to_radians();
        let equidistant = Intrinsics::centred(width, height, focal, Fisheye::from([0.0; 4]).into());
        let mut state = Adjusted::start(equidistant, &views)?;
        state.adjust();
        Some(state).filter(|state| state.cost().is_finite())
    });
    adjusted.min_by(|a, b| a.cost().total_cmp(&b.cost()))
}

impl Adjusted {
    /// Views with the poses that a lens gives them; `None` where it cannot show one of the boards.
    pub(crate) fn start(intrinsics: Intrinsics, views: &[BoardView]) -> Option<Self> {
        let posed: Option<Vec<BoardView>> = views.iter().map(|view| view.posed(&intrinsics)).collect();
        Some(Self { views: posed?, intrinsics })
    }

    /// Sum of the squared residuals, pixels².
    pub(crate) fn cost(&self) -> f64 {
        Reprojection.cost(self)
    }

    /// Minimises the reprojection error.
    pub(crate) fn adjust(&mut self) -> Report {
        minimise(&Reprojection, self, &Options { max_iterations: 300, ..Options::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LensModel;
    use nalgebra::Vector3;

    /// Views of a board of 9 × 6 corners, 25 mm apart, that a lens shows whole, all over its picture.
    pub(crate) fn boards(k: &Intrinsics, noise_px: f64) -> Vec<Vec<(Point3<f64>, Point2<f64>)>> {
        let mut state = 11u64;
        let mut error = || {
            // The sum of twelve uniform numbers has variance 1.
            let mut sum = -6.0;
            for _ in 0..12 {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                sum += (state >> 11) as f64 / (1u64 << 53) as f64;
            }
            noise_px * sum
        };
        let view = |i: usize| {
            let part = |step: f64| 2.0 * (i as f64 * step + 0.4).fract() - 1.0;
            let pixel = Point2::new(k.cx + 260.0 * part(0.618), k.cy + 180.0 * part(0.414));
            let middle = k.unproject(&pixel)?.normalize() * 0.35;
            let turn = Vector3::new(0.6 * part(0.29), 0.6 * part(0.73), 0.3 * part(0.91));
            // The board faces the camera, but for that turn.
            let facing = nalgebra::UnitQuaternion::rotation_between(&Vector3::z(), &middle)?;
            let pose = Isometry3::from_parts(middle.into(), facing * nalgebra::UnitQuaternion::new(turn));
            let corner =
                |c: usize| Point3::new(0.025 * ((c % 9) as f64 - 4.0), 0.025 * ((c / 9) as f64 - 2.5), 0.0);
            let seen =
                (0..54).map(corner).map(|c| Some((c, k.project(&(pose * c)).filter(|p| k.contains(p))?)));
            seen.collect::<Option<Vec<_>>>()
        };
        let mut found: Vec<_> = (0..30).filter_map(view).collect();
        found.iter_mut().flatten().for_each(|(_, pixel)| *pixel += Vector2::new(error(), error()));
        found
    }

    fn fisheye(half_angle_deg: f64, numbers: [f64; 4]) -> Intrinsics {
        Intrinsics {
            width: 640,
            height: 480,
            fx: 320.0 / half_angle_deg.to_radians(),
            fy: 318.0 / half_angle_deg.to_radians(),
            cx: 325.0,
            cy: 236.0,
            distortion: Fisheye::from(numbers).into(),
        }
    }

    #[test]
    fn a_fisheye_is_found_from_exact_corners() {
        for (half_angle_deg, numbers) in
            [(55.0, [-0.03, 0.01, -0.004, 0.0005]), (70.0, [0.05, -0.01, 0.002, -0.0003]), (80.0, [0.0; 4])]
        {
            let truth = fisheye(half_angle_deg, numbers);
            let boards = boards(&truth, 0.0);
            assert!(boards.len() >= 10, "{} boards", boards.len());
            let found = fit_fisheye(&boards, (640, 480)).unwrap();
            let (a, b) = (&found.intrinsics, &truth);
            assert_eq!(a.distortion.model(), LensModel::Fisheye);
            for (a, b) in [(a.fx, b.fx), (a.fy, b.fy), (a.cx, b.cx), (a.cy, b.cy)] {
                assert!((a - b).abs() < 1e-3, "{found:?}");
            }
            for pixel in [Point2::new(30.0, 240.0), Point2::new(320.0, 460.0), Point2::new(100.0, 80.0)] {
                let (a, b) = (a.unproject(&pixel).unwrap(), b.unproject(&pixel).unwrap());
                assert!(a.angle(&b) < 1e-5, "{pixel}: {}", a.angle(&b));
            }
        }
    }

    #[test]
    fn a_fisheye_from_corners_with_errors_is_as_good_as_they_are() {
        let truth = fisheye(70.0, [0.03, -0.008, 0.002, -0.0003]);
        let found = fit_fisheye(&boards(&truth, 0.1), (640, 480)).unwrap();
        let corners: usize = found.views.iter().map(|view| view.corners.len()).sum();
        let rms_px = (found.cost() / corners as f64).sqrt();
        // Two coordinates of 0.1 px each, a little less for what the fit takes up.
        assert!((0.11..0.145).contains(&rms_px), "{rms_px}");
        assert!((found.intrinsics.fx / truth.fx - 1.0).abs() < 2e-3, "{found:?}");
    }
}
