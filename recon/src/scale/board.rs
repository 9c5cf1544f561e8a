//! A calibration board in a capture: the side of its squares in the capture's own unit.
//!
//! The board lies still while the camera moves. Its corners are found in every frame and triangulated, and the board's
//! pose and the side of its squares are the maximum-likelihood estimate of all observations: a similarity, seven
//! parameters, from two equations a corner and frame.

use std::fmt;

use calib::absolute_orientation;
use calib::least_squares::{
    Loss, NormalEquations, Options, Problem, by_similarity, minimise, moved_similarity,
};
use calib::vision::chessboard::Chessboard;
use nalgebra::{Isometry3, Point2, Point3, SVector, Similarity3, Vector3};
use rayon::prelude::*;

use crate::motion::triangulation::{TriangulationLimits, triangulate};
use crate::ray_depth::PosedFilm;

/// Standard deviation of detected corners, pixels; a smaller residual does not mean a better estimate.
const CORNER_SIGMA_PX: f64 = 0.1;
/// Largest residual of a board that is still, flat and as described.
const LARGEST_RMS_PX: f64 = 2.0;
/// Largest relative standard deviation of a side from which metres are taken.
const LARGEST_SIGMA: f64 = 0.03;
const SOLVER: Options = Options { max_iterations: 30, cost_tolerance: 1e-9, initial_damping: 1e-4 };

/// The side of a board's squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Square {
    /// Side in the capture's unit.
    pub side: f64,
    /// Relative standard deviation.
    pub sigma: f64,
    /// Number of frames in which the whole board was detected.
    pub frames: usize,
    /// Root mean square reprojection error of the corners, pixels.
    pub rms_px: f64,
}

impl fmt::Display for Square {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { sigma, frames, rms_px, .. } = self;
        write!(f, "{frames} frames, its corners to {rms_px:.2} px, its size to {:.1} %", 100.0 * sigma)
    }
}

/// Estimates the side of the board's squares.
///
/// # Errors
/// Advice on what to film instead, for a board that is wholly visible in fewer than two frames, moves, is bent, or
/// whose distance the camera's motion does not determine.
pub fn square(film: &PosedFilm<'_>, board: Chessboard) -> Result<Square, String> {
    let find = |(frame, pose): (&image::RgbImage, &Option<Isometry3<f64>>)| {
        // A frame that OpenCV refuses counts as one without a board.
        let corners = board.find(&image::imageops::grayscale(frame)).ok().flatten();
        pose.zip(corners)
    };
    let views: Vec<BoardView> = film.frames.par_iter().zip(film.camera_from_world).filter_map(find).collect();
    fitted(film.intrinsics, board, views)
}

/// A frame's pose, camera from world, and the board's corners in it, row by row from any of its corners.
type BoardView = (Isometry3<f64>, Vec<Point2<f64>>);

fn fitted(lens: &calib::Intrinsics, board: Chessboard, mut views: Vec<BoardView>) -> Result<Square, String> {
    if views.len() < 2 {
        return Err(format!(
            "the {board} board is seen whole in {} frames of the capture; lay it where the camera sees it from several places",
            views.len()
        ));
    }
    same_order(lens, board, &mut views);
    let on_board: Vec<Point3<f64>> = (0..board.rows)
        .flat_map(|row| (0..board.columns).map(move |column| (f64::from(column), f64::from(row))))
        .map(|(column, row)| Point3::new(column, row, 0.0))
        .collect();
    let start = triangulated(lens, &on_board, &views).ok_or_else(|| {
        format!(
            "the {board} board's distance is not told by the {} frames that see it whole; film it from places further \
             apart, and let it lie still",
            views.len()
        )
    })?;
    let square = polished(lens, &on_board, &views, start);
    match square {
        Some(square) if square.rms_px > LARGEST_RMS_PX => Err(format!(
            "the {board} board's corners are {:.1} pixels from where they belong; let it lie still and flat, and count \
             its inner corners",
            square.rms_px
        )),
        Some(square) if square.sigma <= LARGEST_SIGMA => Ok(square),
        _ => Err(format!(
            "the {board} board tells the metres to no better than {:.0} %; film it from nearer, and from places \
             further apart",
            100.0 * square.map_or(1.0, |s| s.sigma.min(1.0))
        )),
    }
}

/// Brings the corners of all views into the order of the first: the detector may start at any corner. A board looks the
/// same rotated by half a turn, square ones by a quarter; a camera that moves by hand turns by less.
fn same_order(lens: &calib::Intrinsics, board: Chessboard, views: &mut [BoardView]) {
    // Directions in the world relative to the board's middle: parallax moves all alike.
    let shape = |(pose, corners): &BoardView| -> Vec<Vector3<f64>> {
        let rays: Vec<Vector3<f64>> = corners
            .iter()
            .map(|c| {
                lens.unproject(c).map_or_else(Vector3::zeros, |ray| pose.rotation.inverse() * ray.normalize())
            })
            .collect();
        let middle = rays.iter().sum::<Vector3<f64>>() / rays.len().max(1) as f64;
        rays.into_iter().map(|ray| ray - middle).collect()
    };
    let Some((first, others)) = views.split_first_mut() else { return };
    let expected = shape(first);
    for view in others {
        let found = shape(view);
        let miss = |order: &Vec<usize>| -> f64 {
            order.iter().zip(&expected).map(|(i, e)| (found[*i] - e).norm_squared()).sum()
        };
        if let Some(order) = orders(board).into_iter().min_by(|a, b| miss(a).total_cmp(&miss(b))) {
            view.1 = order.iter().map(|i| view.1[*i]).collect();
        }
    }
}

/// Orders in which a detector may list a board's corners.
fn orders(board: Chessboard) -> Vec<Vec<usize>> {
    let (columns, rows) = (board.columns as usize, board.rows as usize);
    let count = columns * rows;
    let mut orders = vec![(0..count).collect(), (0..count).rev().collect()];
    if columns == rows {
        let quarter: Vec<usize> =
            (0..count).map(|i| (i % columns) * columns + columns - 1 - i / columns).collect();
        orders.push(quarter.iter().rev().copied().collect());
        orders.push(quarter);
    }
    orders
}

/// Initial board from triangulated corners.
fn triangulated(
    lens: &calib::Intrinsics,
    on_board: &[Point3<f64>],
    views: &[BoardView],
) -> Option<Similarity3<f64>> {
    const ACCEPT: TriangulationLimits =
        TriangulationLimits { max_error_px: 3.0, min_angle: 0.003, min_sightings: 2 };
    let point = |(i, corner): (usize, &Point3<f64>)| {
        let sightings: Vec<_> = views.iter().map(|(pose, corners)| (pose, corners[i])).collect();
        Some((*corner, triangulate(lens, &sightings, &ACCEPT)?))
    };
    let (corners, points): (Vec<_>, Vec<_>) = on_board.iter().enumerate().filter_map(point).unzip();
    absolute_orientation::similarity(&corners, &points).ok()
}

/// Reprojection of a board, whose squares have side 1 in its own frame, into all its views.
struct Reprojection<'a> {
    lens: &'a calib::Intrinsics,
    on_board: &'a [Point3<f64>],
    views: &'a [BoardView],
    loss: Loss,
}

impl Reprojection<'_> {
    fn sightings(&self) -> impl Iterator<Item = (&Isometry3<f64>, &Point3<f64>, &Point2<f64>)> {
        self.views.iter().flat_map(|(pose, seen)| {
            self.on_board.iter().zip(seen).map(move |(corner, pixel)| (pose, corner, pixel))
        })
    }

    /// Squared residual of each sighting; `behind` where the corner is behind the camera.
    fn squares(&self, board: &Similarity3<f64>, behind: f64) -> impl Iterator<Item = f64> {
        self.sightings().map(move |(pose, corner, pixel)| {
            self.lens.project(&(pose * (board * corner))).map_or(behind, |seen| (seen - pixel).norm_squared())
        })
    }
}

impl Problem for Reprojection<'_> {
    type State = Similarity3<f64>;
    type Equations = NormalEquations<7>;

    fn cost(&self, board: &Similarity3<f64>) -> f64 {
        self.squares(board, 1e6).map(|squared| self.loss.cost(squared)).sum()
    }

    fn linearise(&self, board: &Similarity3<f64>) -> NormalEquations<7> {
        let mut equations = NormalEquations::default();
        for (pose, corner, pixel) in self.sightings() {
            let point = board * corner;
            let Some(seen) = self.lens.project(&(pose * point)) else { continue };
            let by_point =
                self.lens.project_jacobian(&(pose * point)) * pose.rotation.to_rotation_matrix().matrix();
            let off = seen - pixel;
            equations.add(&(by_point * by_similarity(&point)), &off, self.loss.weight(off.norm_squared()));
        }
        equations
    }

    fn moved(&self, board: &Similarity3<f64>, step: &SVector<f64, 7>) -> Similarity3<f64> {
        moved_similarity(board, step.as_slice())
    }
}

/// Maximum-likelihood board from all observations, and the precision of its size.
fn polished(
    lens: &calib::Intrinsics,
    on_board: &[Point3<f64>],
    views: &[BoardView],
    mut board: Similarity3<f64>,
) -> Option<Square> {
    let problem = Reprojection { lens, on_board, views, loss: Loss::Cauchy(1.0) };
    minimise(&problem, &mut board, &SOLVER);
    let squares: f64 = problem.squares(&board, f64::INFINITY).sum();
    let rms_px = (squares / problem.sightings().count().max(1) as f64).sqrt();
    // Corner errors in a blurred or bent board are correlated, so a frame counts as one observation.
    let noise_px = rms_px.max(CORNER_SIGMA_PX) * (on_board.len() as f64).sqrt();
    let variance = problem.linearise(&board).matrix.try_inverse()?[(6, 6)];
    Some(Square { side: board.scaling(), sigma: noise_px * variance.sqrt(), frames: views.len(), rms_px })
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::Intrinsics;
    use nalgebra::Vector2;
    use rand::RngExt;

    const SIDE: f64 = 0.06;

    /// Board of squares of 0.06 units, 1.5 units away, seen by a camera that moves `step` aside from frame to frame.
    fn views(lens: &Intrinsics, board: Chessboard, step: f64, noise_px: f64) -> Vec<BoardView> {
        let truth = Similarity3::new(Vector3::new(-0.25, -0.1, 1.5), Vector3::new(0.5, -0.3, 0.2), SIDE);
        let mut rng = rand_pcg::Pcg64Mcg::new(7);
        let mut near = |p: Point2<f64>| {
            p + Vector2::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0)) * noise_px
        };
        let mut view = |i: u32| {
            let along = f64::from(i) * step;
            let pose = Isometry3::new(
                Vector3::new(along, -0.3 * along, 0.1 * along),
                Vector3::new(0.0, 0.02 * f64::from(i), 0.0),
            );
            let corner =
                |k: u32| Point3::new(f64::from(k % board.columns), f64::from(k / board.columns), 0.0);
            let corners = (0..board.columns * board.rows)
                .map(|k| near(lens.project(&(pose * (truth * corner(k)))).unwrap()));
            (pose, corners.collect())
        };
        (0..8).map(&mut view).collect()
    }

    fn lens() -> Intrinsics {
        let mut lens = Intrinsics::from_horizontal_fov(640, 480, 60.0);
        lens.distortion = [-0.1, 0.02, 0.001, -0.001, 0.0].into();
        lens
    }

    #[test]
    fn a_square_is_as_long_as_it_was_made() {
        let board = Chessboard { columns: 9, rows: 6 };
        let exact = fitted(&lens(), board, views(&lens(), board, 0.05, 0.0)).unwrap();
        assert!((exact.side / SIDE - 1.0).abs() < 1e-6 && exact.frames == 8, "{exact:?}");
        let noisy = fitted(&lens(), board, views(&lens(), board, 0.05, 0.3)).unwrap();
        let off = (noisy.side / SIDE - 1.0).abs();
        assert!(off < 0.004 && off < 4.0 * noisy.sigma && noisy.sigma < 0.03, "{noisy:?}");
    }

    #[test]
    fn the_detectors_first_corner_does_not_matter() {
        for (columns, rows) in [(9, 6), (5, 5)] {
            let board = Chessboard { columns, rows };
            let mut views = views(&lens(), board, 0.05, 0.1);
            let orders = orders(board);
            for (view, order) in views.iter_mut().skip(1).zip(orders.iter().cycle().skip(1)) {
                view.1 = order.iter().map(|i| view.1[*i]).collect();
            }
            let found = fitted(&lens(), board, views).unwrap();
            assert!((found.side / SIDE - 1.0).abs() < 0.004, "{found:?}");
        }
    }

    #[test]
    fn boards_that_give_no_metres_are_refused_with_advice() {
        let board = Chessboard { columns: 9, rows: 6 };
        let said = |views: Vec<BoardView>| fitted(&lens(), board, views).unwrap_err();
        assert!(said(Vec::new()).contains("seen whole in 0 frames"));
        assert!(said(views(&lens(), board, 0.05, 0.0)[..1].to_vec()).contains("seen whole in 1 frames"));
        assert!(said(views(&lens(), board, 0.0, 0.1)).contains("further apart"));
        // The board is moved: it is in one place for the first four frames, then elsewhere.
        let mut carried = views(&lens(), board, 0.05, 0.1);
        for (i, (_, corners)) in carried.iter_mut().enumerate() {
            for corner in corners {
                *corner += Vector2::new(0.0, 12.0) * i as f64;
            }
        }
        let heard = said(carried);
        assert!(heard.contains("still"), "{heard}");
    }
}
