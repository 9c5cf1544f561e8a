//! COLMAP's sparse model: a folder of `cameras`, `images` and `points3D`, as text or binary
//! (<https://colmap.github.io/format.html>).

mod binary;
mod model;
mod rigs;
#[cfg(test)]
mod tests;
mod text;
mod write;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use calib::Camera;
use glam::DVec3;
use model::{Defect, ModelPoint};
use nalgebra::Isometry3;

use super::selection::{Chosen, NamedAfter, camera_names};
use super::{Model, ModelGeometry, ModelOptions, PicturedCamera};
use crate::geometry::Geometry;
use crate::geometry::scan::{Placing, Scan};
use crate::geometry::scan_vertex::ScanVertex;
use crate::room::RoomCamera;
use crate::{Error, Result};
pub use write::{SparseModel, SparsePicture, SparsePoint, write};

/// Reads a model: its cameras, in the order of its pictures or of the selection, named after them, and that it has points.
///
/// # Errors
/// [`Error::File`] naming the file, the place in it and the problem.
pub fn read(dir: &Path, options: &ModelOptions) -> Result<Model> {
    let form = Form::of(dir)?;
    let (lens_file, picture_file) = (form.file(dir, "cameras"), form.file(dir, "images"));
    let cameras = form.read(&lens_file, binary::cameras, text::cameras)?;
    let pictures = form.read(&picture_file, binary::pictures, text::pictures)?;
    if pictures.is_empty() {
        return Err(Error::content(&picture_file, "whole file", "it holds no image; no camera was placed"));
    }
    let by_frames = form.poses_by_frames(dir)?;
    let names: Vec<String> = pictures.iter().map(|picture| picture.name.clone()).collect();
    let chosen = options.selection.choose(&picture_file, &names, camera_names(&names, NamedAfter::Path))?;
    let cameras: Result<Vec<PicturedCamera>> = chosen
        .into_iter()
        .map(|Chosen { index, name }| {
            let picture = &pictures[index];
            let place = format!("image `{}`", picture.name);
            let wrong = |problem: String| Error::content(&picture_file, place.as_str(), problem);
            let camera = cameras.iter().find(|camera| camera.id == picture.camera);
            let camera = camera.ok_or_else(|| wrong(format!("there is no camera {}", picture.camera)))?;
            let intrinsics = camera
                .intrinsics()
                .map_err(|problem| Error::content(&lens_file, format!("camera {}", camera.id), problem))?;
            let camera_from_world = match by_frames.get(&picture.id) {
                Some(pose) => *pose,
                None => picture.pose.isometry().map_err(wrong)?,
            };
            let camera = Camera { intrinsics, camera_from_world };
            let entry = RoomCamera { name, camera, reference: None };
            Ok(PicturedCamera { picture: picture.name.clone(), entry })
        })
        .collect();
    Ok(Model { cameras: cameras?, geometry: ModelGeometry::Points(dir.to_owned()) })
}

/// Form of a model's files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    Binary,
    Text,
}

impl Form {
    fn of(dir: &Path) -> Result<Self> {
        let forms = [Self::Binary, Self::Text];
        forms.into_iter().find(|form| form.file(dir, "cameras").is_file()).ok_or_else(|| {
            let problem =
                "it holds no cameras.txt or cameras.bin, so it is no COLMAP model; name its folder `sparse/0`";
            Error::content(dir, "folder", problem)
        })
    }

    fn file(self, dir: &Path, name: &str) -> PathBuf {
        dir.join(format!("{name}.{}", if self == Self::Binary { "bin" } else { "txt" }))
    }

    fn read<T>(
        self,
        file: &Path,
        binary: fn(&[u8]) -> std::result::Result<T, Defect>,
        text: fn(&str) -> std::result::Result<T, Defect>,
    ) -> Result<T> {
        let parsed = match self {
            Self::Binary => binary(&bytes_of(file)?),
            Self::Text => text(&calib::files::read_text(file)?),
        };
        parsed.map_err(|(place, problem)| Error::content(file, place, problem))
    }

    /// Poses of pictures by the frames that they belong to; none where the model has no rigs and frames.
    fn poses_by_frames(self, dir: &Path) -> Result<HashMap<u64, Isometry3<f64>>> {
        let (rig_file, frame_file) = (self.file(dir, "rigs"), self.file(dir, "frames"));
        if !(rig_file.is_file() && frame_file.is_file()) {
            return Ok(HashMap::new());
        }
        let rigs = self.read(&rig_file, binary::rigs, text::rigs)?;
        let frames = self.read(&frame_file, binary::frames, text::frames)?;
        rigs::poses(&rigs, &frames).map_err(|(place, problem)| Error::content(&frame_file, place, problem))
    }
}

/// The model's points as discs that face the cameras; `None` without any.
///
/// # Errors
/// [`Error::File`] naming the file, the place in it and the problem.
pub fn geometry(dir: &Path, placing: &Placing<'_>) -> Result<Option<Geometry>> {
    let placed = |scan: Scan| {
        scan.into_geometry(placing)
            .map_err(|(place, problem)| Error::content(dir, format!("points3D, {place}"), problem))
    };
    read_points(dir)?.map(placed).transpose()
}

/// The model's points as a scan in the model's world; `None` without any. They are as sparse as the model: surfaces
/// between them hide nobody.
///
/// # Errors
/// As [`read`]; for a point that is not finite, too.
fn read_points(dir: &Path) -> Result<Option<Scan>> {
    let form = Form::of(dir)?;
    let file = form.file(dir, "points3D");
    if !file.is_file() {
        return Ok(None);
    }
    let points = form.read(&file, binary::points, text::points)?;
    let is_wild = |p: &ModelPoint| !DVec3::from(p.place).as_vec3().is_finite();
    if let Some(i) = points.iter().position(is_wild) {
        let problem = "a coordinate is not finite; remove the point";
        return Err(Error::content(&file, format!("point {} of {}", i + 1, points.len()), problem));
    }
    let vertices = points
        .iter()
        .map(|p| ScanVertex { position: p.place, color: p.color.map(f32::from), ..ScanVertex::default() })
        .collect::<Vec<_>>();
    Ok((!vertices.is_empty()).then_some(Scan { vertices, ..Scan::default() }))
}

fn bytes_of(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(Error::io(path))
}
