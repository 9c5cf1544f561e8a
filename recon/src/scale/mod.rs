//! Metric scale of the common frame, from one known length.

pub mod board;

use board::Square;
use nalgebra::{Point2, Point3};

use crate::floor::Plane;
use crate::merge::{Merged, measured_at, pinhole_pixel};
use crate::project::{Project, Scale};
use crate::ray_depth::MeasuredPixel;
use crate::surface::Surface;
use crate::{Error, Result};

/// Metres in a unit of the common frame.
///
/// # Arguments
/// `lenses`: each camera's intrinsics as filmed. `square`: the side of the project's board, in its camera's unit. `floor`: the
/// floor in the common frame, for a known height.
///
/// # Errors
/// [`Error::File`] naming the pixel without a depth, or the board that was not measured.
pub fn metres_per_unit(
    project: &Project,
    surfaces: &[Surface],
    lenses: &[calib::Intrinsics],
    measured: &[Vec<MeasuredPixel>],
    square: Option<Square>,
    merged: &Merged,
    floor: &Plane,
) -> Result<f64> {
    match &project.scale {
        Scale::Board { camera, board, square_m } => {
            let side = square.map(|s| s.side * merged.common_from_camera[*camera].scaling());
            side.map(|side| square_m / side).ok_or_else(|| {
                let problem = format!("the {board} board was not measured");
                Error::content(&project.path, "[scale], board", problem)
            })
        }
        Scale::Height { camera, height_m } => {
            let centre = merged.poses()[*camera].inverse() * Point3::origin();
            Ok(height_m / floor.height(&centre))
        }
        Scale::Distance { camera, from, to, metres } => {
            let end = |key: &str, pixel: &Point2<f64>| {
                let seen = picked(project, merged, *camera, pixel).or_else(|| {
                    let pinhole = pinhole_pixel(&lenses[*camera], pixel)?;
                    let own = measured_at(&measured[*camera], pixel).and_then(|own| {
                        let ray = surfaces[*camera].intrinsics.unproject(&pinhole)?;
                        Some(Point3::from(ray * own.depth.depth))
                    });
                    let point = own.or_else(|| surfaces[*camera].point_at(&pinhole))?;
                    Some(merged.common_from_camera[*camera] * point)
                });
                seen.ok_or_else(|| {
                    let problem = format!(
                        "there is no depth at [{}, {}] of `{}`; choose a pixel on something textured",
                        pixel.x, pixel.y, project.cameras[*camera].name
                    );
                    Error::content(&project.path, format!("[scale], {key}"), problem)
                })
            };
            let length = (end("to", to)? - end("from", from)?).norm();
            if length <= 0.0 {
                let problem = "`from` and `to` show the same point: the distance has no length";
                return Err(Error::content(&project.path, "[scale]", problem));
            }
            Ok(metres / length)
        }
    }
}

/// Position of a pixel that is also a picked point: several cameras determine it better than a depth alone.
fn picked(project: &Project, merged: &Merged, camera: usize, pixel: &Point2<f64>) -> Option<Point3<f64>> {
    /// Largest distance between identical pixels.
    const SAME_PX: f64 = 1.0;
    let close = |p: Point2<f64>| (p - pixel).norm() <= SAME_PX;
    let point = project.points.iter().position(|p| p.pixel(camera).is_some_and(close))?;
    merged.points.get(point).copied().flatten()
}
