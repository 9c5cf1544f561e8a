//! Cameras (and points) of other programs: COLMAP's sparse models and nerfstudio's `transforms.json` in and out, and
//! cameras given one by one, as `calib` writes them.
//!
//! Both count pixels from the top-left pixel's corner, so their principal points are half a pixel larger than ours.

pub mod colmap;
pub mod given;
pub mod nerfstudio;
#[cfg(test)]
mod test_room;

use std::path::Path;

use glam::Vec3;

use crate::Result;
use crate::geometry::Geometry;
use crate::room::RoomCamera;

/// The cameras of another program's file or folder: nerfstudio's `.json`, or else a COLMAP model.
///
/// # Errors
/// As [`nerfstudio::read`] and [`colmap::read`].
pub fn cameras(path: &Path) -> Result<Vec<RoomCamera>> {
    if is_nerfstudio(path) { nerfstudio::read(path) } else { colmap::read(path) }
}

/// The points of another program's model, as [`colmap::read_points`]; nerfstudio's file has none.
///
/// # Errors
/// As [`colmap::read_points`].
pub fn points(path: &Path, viewpoints: &[Vec3]) -> Result<Option<Geometry>> {
    if is_nerfstudio(path) { Ok(None) } else { colmap::read_points(path, viewpoints) }
}

fn is_nerfstudio(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"))
}

/// What a camera is called after its picture's name in another program: no folder separators, nothing that a command
/// line would take apart.
fn camera_name(picture: &str) -> String {
    Path::new(picture).with_extension("").to_string_lossy().replace(['/', '\\', '='], "_")
}

/// The name of a camera's picture in other programs' files.
fn picture_name(camera: &RoomCamera) -> String {
    let extension =
        camera.reference.as_ref().and_then(|r| r.extension()).map(|e| e.to_string_lossy().into_owned());
    format!("{}.{}", camera.name, extension.unwrap_or_else(|| "jpg".into()))
}

/// From our pixels, counted from a pixel's centre, to pixels counted from its corner.
const CORNER_PX: f64 = 0.5;
