//! Cameras and geometry of other programs: COLMAP's sparse models and nerfstudio's `transforms.json` in and out, and single
//! cameras from the files of `calib`.
//!
//! Both count pixels from the top-left pixel's corner, so their principal points are half a pixel larger than ours. The
//! way from their worlds to the room's is in [`placement`] and [`alignment`].

pub mod alignment;
pub mod calib_files;
pub mod colmap;
pub mod nerfstudio;
mod pictures;
pub mod placement;
pub mod references;
mod selection;
#[cfg(test)]
pub(crate) mod test_room;

use std::path::{Path, PathBuf};

use nalgebra::Similarity3;

use crate::Result;
use crate::room::RoomCamera;

pub use pictures::Pictures;
pub use selection::Selection;

/// Options of the reading of a model.
#[derive(Debug, Clone, Default)]
pub struct ModelOptions {
    /// Pictures that become cameras.
    pub selection: Selection,
    /// Folders of the pictures, from which sizes are read that the model does not state.
    pub pictures: Pictures,
    /// Whether what nerfstudio did to the world (`applied_transform`, `applied_scale`) is undone.
    pub undo_applied: bool,
}

/// A model of another program.
#[derive(Debug, Clone)]
pub struct Model {
    /// The chosen cameras, in the model's world.
    pub cameras: Vec<PicturedCamera>,
    /// Geometry that belongs to the model.
    pub geometry: ModelGeometry,
}

/// A camera of a model, and the picture it is made from.
#[derive(Debug, Clone)]
pub struct PicturedCamera {
    /// The picture as the model names it.
    pub picture: String,
    /// The camera, in the model's world.
    pub entry: RoomCamera,
}

/// Geometry of a model.
#[derive(Debug, Clone)]
pub enum ModelGeometry {
    /// None.
    None,
    /// The sparse points of a COLMAP model in this folder.
    Points(PathBuf),
    /// A file that the model names.
    File {
        /// The file.
        path: PathBuf,
        /// Way to the model's world as it is read.
        model_from_file: Similarity3<f64>,
    },
}

/// Reads another program's file or folder: nerfstudio's `.json`, or else a COLMAP model.
///
/// # Errors
/// As [`nerfstudio::read`] and [`colmap::read`].
pub fn model(path: &Path, options: &ModelOptions) -> Result<Model> {
    let is_nerfstudio = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    if is_nerfstudio { nerfstudio::read(path, options) } else { colmap::read(path, options) }
}

/// Name of a camera's picture in other programs' files.
fn picture_name(camera: &RoomCamera) -> String {
    let extension =
        camera.reference.as_ref().and_then(|r| r.extension()).map(|e| e.to_string_lossy().into_owned());
    format!("{}.{}", camera.name, extension.unwrap_or_else(|| "jpg".into()))
}

/// Offset from pixels counted from a pixel's centre to pixels counted from its corner.
const CORNER_PX: f64 = 0.5;
