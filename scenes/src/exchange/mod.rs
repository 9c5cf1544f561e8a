//! Cameras (and points) of other programs: COLMAP's sparse models and nerfstudio's `transforms.json` in and out, and
//! single cameras from the files of `calib`.
//!
//! Both count pixels from the top-left pixel's corner, so their principal points are half a pixel larger than ours.

pub mod calib_files;
pub mod colmap;
pub mod nerfstudio;
#[cfg(test)]
mod test_room;

use std::path::Path;

use glam::{DVec3, Vec3};

use crate::Result;
use crate::geometry::Geometry;
use crate::room::RoomCamera;

/// Cameras of another program's file or folder: nerfstudio's `.json`, or else a COLMAP model.
///
/// # Errors
/// As [`nerfstudio::read`] and [`colmap::read`].
pub fn cameras(path: &Path) -> Result<Vec<RoomCamera>> {
    if is_nerfstudio(path) { nerfstudio::read(path) } else { colmap::read(path) }
}

/// Points of a COLMAP model, as [`colmap::read_points`]; `None` for nerfstudio, whose `ply_file_path` is not read.
///
/// # Errors
/// As [`colmap::read_points`].
pub fn points(path: &Path, viewpoints: &[Vec3], shift_m: DVec3) -> Result<Option<Geometry>> {
    if is_nerfstudio(path) { Ok(None) } else { colmap::read_points(path, viewpoints, shift_m) }
}

fn is_nerfstudio(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"))
}

/// Name of a camera made from its picture's name in another program: without folder separators and the `=` of
/// command-line arguments.
fn camera_name(picture: &str) -> String {
    Path::new(picture).with_extension("").to_string_lossy().replace(['/', '\\', '='], "_")
}

/// Name of a camera's picture in other programs' files.
fn picture_name(camera: &RoomCamera) -> String {
    let extension =
        camera.reference.as_ref().and_then(|r| r.extension()).map(|e| e.to_string_lossy().into_owned());
    format!("{}.{}", camera.name, extension.unwrap_or_else(|| "jpg".into()))
}

/// Offset from pixels counted from a pixel's centre to pixels counted from its corner.
const CORNER_PX: f64 = 0.5;
