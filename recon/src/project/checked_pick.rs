//! A camera and a pixel as a table of `room.toml` names them.

use std::path::Path;

use nalgebra::Point2;

use super::ProjectCamera;
use crate::{Error, Result};

/// Index of the camera with this name.
///
/// # Errors
/// Names the place, and the cameras that there are.
pub(super) fn camera_called(
    path: &Path,
    place: &str,
    name: &str,
    cameras: &[ProjectCamera],
) -> Result<usize> {
    cameras.iter().position(|c| c.name == name).ok_or_else(|| {
        let known = cameras.iter().map(|c| format!("`{}`", c.name)).collect::<Vec<_>>().join(", ");
        Error::content(path, place, format!("no camera is called `{name}`; there are {known}"))
    })
}

/// A pixel, if both its numbers are finite.
///
/// # Errors
/// Names the place.
pub(super) fn finite(path: &Path, place: &str, [x, y]: [f64; 2]) -> Result<Point2<f64>> {
    if x.is_finite() && y.is_finite() {
        return Ok(Point2::new(x, y));
    }
    Err(Error::content(path, place, format!("[{x}, {y}] is not a pixel")))
}
