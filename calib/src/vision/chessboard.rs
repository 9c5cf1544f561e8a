//! Chessboards in images, and intrinsics from views of one (Z. Zhang, "A flexible new technique for camera
//! calibration", PAMI 2000, as OpenCV's `calibrateCamera` implements it).

use std::fmt;
use std::str::FromStr;

use image::{GrayImage, RgbImage};
use nalgebra::{Isometry3, Point2, Point3, Vector2, Vector3};
use opencv::core::{Mat, Point2f, Point3f, Size, TermCriteria, TermCriteria_Type, Vec3d, Vector};
use opencv::prelude::*;
use opencv::{calib3d, imgproc};

use super::adapter;
use crate::board_adjustment::fit_fisheye;
use crate::ray_uncertainty::{BoardView, RayUncertainty};
use crate::{Distortion, Error, Intrinsics, LensModel, Result};

/// Numbers of inner corners on a side.
const SIDES: std::ops::RangeInclusive<u32> = 3..=500;

/// Standard deviation of detected corners; a smaller residual does not mean a better estimate.
pub const CORNER_SIGMA_PX: f64 = 0.1;
/// Largest relative standard deviation of a focal length that the views may leave.
const LARGEST_FOCAL_SIGMA: f64 = 0.05;

/// Angle within which all boards' normals count as parallel.
const LEAST_TILT_DEG: f64 = 10.0;

/// A chessboard, described by its inner corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chessboard {
    /// Inner corners along a row.
    pub columns: u32,
    /// Inner corners along a column.
    pub rows: u32,
}

impl FromStr for Chessboard {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let sides = text.split_once('x').and_then(|(c, r)| Some((c.parse().ok()?, r.parse().ok()?)));
        match sides {
            Some((columns, rows)) if SIDES.contains(&columns) && SIDES.contains(&rows) => {
                Ok(Self { columns, rows })
            }
            _ => Err(format!("`{text}` is no pattern; write its inner corners, 3 to 500 each way, like 9x6")),
        }
    }
}

impl fmt::Display for Chessboard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.columns, self.rows)
    }
}

/// Corners of a board, metres on it, with their pixels.
type BoardCorners = Vec<(Point3<f64>, Point2<f64>)>;

/// Estimate of a camera's intrinsics from views of a chessboard.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// The camera.
    pub intrinsics: Intrinsics,
    /// Standard deviations of fx, fy, cx, cy, pixels, derived from the residuals.
    pub sigma_px: [f64; 4],
    /// Root mean square reprojection error over all views, pixels.
    pub rms_px: f64,
    /// Root mean square reprojection error of each view, pixels.
    pub view_rms_px: Vec<f64>,
    /// The views: where each board stood, and its corners.
    pub views: Vec<BoardView>,
}

impl Chessboard {
    fn size(self) -> Size {
        Size::new(self.columns as i32, self.rows as i32)
    }

    /// Finds the inner corners, row by row, to a fraction of a pixel; `None` when the board is not wholly visible.
    ///
    /// # Errors
    /// [`crate::Error::OpenCv`] when OpenCV refuses the image.
    pub fn find(self, image: &GrayImage) -> Result<Option<Vec<Point2<f64>>>> {
        let finding = adapter::refused("finding a chessboard");
        let view = adapter::gray(image)?;
        let mut corners: Vector<Point2f> = Vector::new();
        let flags = calib3d::CALIB_CB_ADAPTIVE_THRESH | calib3d::CALIB_CB_NORMALIZE_IMAGE;
        if !calib3d::find_chessboard_corners(&view, self.size(), &mut corners, flags).map_err(&finding)? {
            return Ok(None);
        }
        // A window of half the squares' spacing never contains a neighbouring corner.
        let first: Vec<Vector2<f32>> = corners.iter().take(2).map(|c| Vector2::new(c.x, c.y)).collect();
        let half = (0.4 * (first[1] - first[0]).norm()).clamp(2.0, 11.0) as i32;
        let until =
            TermCriteria::new(TermCriteria_Type::COUNT as i32 | TermCriteria_Type::EPS as i32, 50, 1e-3)
                .map_err(&finding)?;
        imgproc::corner_sub_pix(&view, &mut corners, Size::new(half, half), Size::new(-1, -1), until)
            .map_err(&finding)?;
        Ok(Some(corners.iter().map(|c| Point2::new(c.x as f64, c.y as f64)).collect()))
    }

    /// Draws found corners on a picture, as OpenCV does: a rainbow, row by row.
    ///
    /// # Errors
    /// [`crate::Error::OpenCv`] when OpenCV refuses the image.
    pub fn draw(self, picture: &mut RgbImage, corners: &[Point2<f64>]) -> Result<()> {
        let points: Vector<Point2f> = corners.iter().map(|c| Point2f::new(c.x as f32, c.y as f32)).collect();
        calib3d::draw_chessboard_corners(&mut adapter::rgb_mut(picture)?, self.size(), &points, true)
            .map_err(adapter::refused("drawing a chessboard"))
    }

    /// Estimates the intrinsics of a lens of this model from the corners of several views; squares of `square_m` metres.
    ///
    /// # Errors
    /// [`Error::Degenerate`] for fewer than three views, or views that do not determine the focal length: copies of
    /// one, or boards that are all parallel (section 4 of the paper).
    pub fn calibrate(
        self,
        views: &[Vec<Point2<f64>>],
        size: (u32, u32),
        square_m: f64,
        model: LensModel,
    ) -> Result<Calibration> {
        if views.len() < 3 {
            return Err(Error::Degenerate(format!(
                "the {self} board is seen whole in {} images; film it whole in at least 3, tilted this way and that",
                views.len()
            )));
        }
        let corners: Vec<Point3<f64>> = (0..self.rows)
            .flat_map(|row| (0..self.columns).map(move |column| (row, column)))
            .map(|(row, column)| Point3::new(f64::from(column) * square_m, f64::from(row) * square_m, 0.0))
            .collect();
        let boards: Vec<BoardCorners> =
            views.iter().map(|view| corners.iter().copied().zip(view.iter().copied()).collect()).collect();
        let found = match model {
            LensModel::Fisheye => self.fisheye(&boards, size)?,
            model => Self::by_opencv(&boards, size, model)?,
        };
        // Exact corners leave no residual, however well the views determine the camera.
        let noise = (CORNER_SIGMA_PX / found.rms_px).max(1.0);
        let certain = |sigma: f64, focal: f64| noise * sigma <= LARGEST_FOCAL_SIGMA * focal;
        let (k, s) = (&found.intrinsics, &found.sigma_px);
        // The deviations come from a pseudo-inverse, which hides directions that are not determined at all.
        let tilt_deg = largest_tilt_deg(&found.views);
        if !(tilt_deg >= LEAST_TILT_DEG && certain(s[0], k.fx) && certain(s[1], k.fy)) {
            return Err(self.tells_no_focal_length(views.len()));
        }
        k.validate()?;
        Ok(found)
    }

    fn tells_no_focal_length(self, views: usize) -> Error {
        Error::Degenerate(format!(
            "{views} views of the {self} board do not tell the focal length; tilt the board by 30° in some of them, \
             each time another way, and leave out copies"
        ))
    }

    /// Calibration of a fisheye.
    fn fisheye(self, boards: &[BoardCorners], size: (u32, u32)) -> Result<Calibration> {
        let found = fit_fisheye(boards, size).ok_or_else(|| {
            Error::Degenerate(
                "no fisheye shows the boards where they were found; keep them within 85° of the lens's axis, or check \
                 --pattern"
                    .into(),
            )
        })?;
        let squares: Vec<f64> = found
            .views
            .iter()
            .map(|view| view.mean_square_px2(&found.intrinsics).unwrap_or(f64::NAN))
            .collect();
        // Every view has as many corners.
        let rms_px = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        let uncertainty = RayUncertainty::of(&found.intrinsics, &found.views, 0.0)
            .ok_or_else(|| self.tells_no_focal_length(boards.len()))?;
        Ok(Calibration {
            sigma_px: uncertainty.sigma_of_matrix_px(),
            rms_px,
            view_rms_px: squares.into_iter().map(f64::sqrt).collect(),
            intrinsics: found.intrinsics,
            views: found.views,
        })
    }

    /// Calibration of a lens with radial and tangential coefficients.
    fn by_opencv(boards: &[BoardCorners], size: (u32, u32), model: LensModel) -> Result<Calibration> {
        let calibrating = adapter::refused("calibrating");
        let of_view = |view: &BoardCorners| -> Vector<Point3f> {
            view.iter().map(|(p, _)| Point3f::new(p.x as f32, p.y as f32, p.z as f32)).collect()
        };
        let objects: Vector<Vector<Point3f>> = boards.iter().map(of_view).collect();
        let seen: Vector<Vector<Point2f>> = boards
            .iter()
            .map(|v| v.iter().map(|(_, c)| Point2f::new(c.x as f32, c.y as f32)).collect::<Vector<Point2f>>())
            .collect();
        let (mut matrix, mut distortion) = (Mat::default(), Mat::default());
        let (mut rotations, mut translations) = (Mat::default(), Mat::default());
        let (mut sigma, mut sigma_poses, mut per_view) = (Mat::default(), Mat::default(), Mat::default());
        // OpenCV's own defaults.
        let until = TermCriteria::new(
            TermCriteria_Type::COUNT as i32 | TermCriteria_Type::EPS as i32,
            30,
            f64::EPSILON,
        )
        .map_err(&calibrating)?;
        let rms_px = calib3d::calibrate_camera_extended(
            &objects,
            &seen,
            Size::new(size.0 as i32, size.1 as i32),
            &mut matrix,
            &mut distortion,
            &mut rotations,
            &mut translations,
            &mut sigma,
            &mut sigma_poses,
            &mut per_view,
            if model == LensModel::Rational { calib3d::CALIB_RATIONAL_MODEL } else { 0 },
            until,
        )
        .map_err(&calibrating)?;
        let numbers =
            |mat: &Mat| -> Result<Vec<f64>> { Ok(mat.data_typed::<f64>().map_err(&calibrating)?.to_vec()) };
        let (k, mut d, s) = (numbers(&matrix)?, numbers(&distortion)?, numbers(&sigma)?);
        // OpenCV pads the rational model with the numbers of further ones.
        d.truncate(model.coefficient_names().len());
        let intrinsics = Intrinsics {
            width: size.0,
            height: size.1,
            fx: k[0],
            fy: k[4],
            cx: k[2],
            cy: k[5],
            distortion: Distortion::new(model, &d).map_err(Error::Invalid)?,
        };
        let poses = rotations.data_typed::<Vec3d>().map_err(&calibrating)?.iter();
        let poses = poses.zip(translations.data_typed::<Vec3d>().map_err(&calibrating)?);
        let poses = poses.map(|(turn, at)| Isometry3::new(Vector3::from(at.0), Vector3::from(turn.0)));
        let views = poses
            .zip(boards)
            .map(|(camera_from_board, corners)| BoardView { camera_from_board, corners: corners.clone() });
        Ok(Calibration {
            views: views.collect(),
            intrinsics,
            sigma_px: [s[0], s[1], s[2], s[3]],
            rms_px,
            view_rms_px: numbers(&per_view)?,
        })
    }
}

/// Largest angle between the normals of two boards, degrees.
fn largest_tilt_deg(views: &[BoardView]) -> f64 {
    let normals: Vec<Vector3<f64>> =
        views.iter().map(|view| view.camera_from_board.rotation * Vector3::z()).collect();
    let angles = normals.iter().flat_map(|a| normals.iter().map(|b| a.angle(b)));
    angles.fold(0.0, f64::max).to_degrees()
}

#[cfg(test)]
mod tests;
