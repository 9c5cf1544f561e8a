//! Serialised form of `room.toml`, table by table. Unknown keys are an error: most are misspelt known ones.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::checked_pick::{camera_called, finite};
use super::metres::{self, ControlPoint, ControlTable, KnownLength, ScaleTable};
use super::{PickedPoint, ProjectCamera};
use crate::capture::ReferenceFrame;
use crate::{Error, Result};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ProjectFile {
    #[serde(default)]
    camera: Vec<ProjectCameraTable>,
    #[serde(default)]
    pub(super) point: Vec<BTreeMap<String, [f64; 2]>>,
    #[serde(default, deserialize_with = "metres::one_or_several")]
    pub(super) scale: Vec<ScaleTable>,
    #[serde(default)]
    pub(super) control: Vec<ControlTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProjectCameraTable {
    name: String,
    capture: PathBuf,
    #[serde(default)]
    reference: ReferenceValue,
    intrinsics: Option<PathBuf>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum ReferenceValue {
    Word(String),
    Number(i64),
}

impl Default for ReferenceValue {
    fn default() -> Self {
        Self::Word("last".into())
    }
}

impl ProjectFile {
    /// Cameras, with the intrinsics files they name; captures need only exist.
    pub(super) fn cameras(&self, path: &Path) -> Result<Vec<ProjectCamera>> {
        if self.camera.is_empty() {
            return Err(Error::content(path, "[[camera]]", "no camera; add a [[camera]] table for each"));
        }
        let mut cameras: Vec<ProjectCamera> = Vec::with_capacity(self.camera.len());
        for (i, table) in self.camera.iter().enumerate() {
            let camera = camera(path, i + 1, table)?;
            if cameras.iter().any(|c| c.name == camera.name) {
                let place = format!("[[camera]] {}, name", i + 1);
                let problem = format!("`{}` is already taken; names must differ", camera.name);
                return Err(Error::content(path, place, problem));
            }
            cameras.push(camera);
        }
        Ok(cameras)
    }

    /// The picked points.
    pub(super) fn points(&self, path: &Path, cameras: &[ProjectCamera]) -> Result<Vec<PickedPoint>> {
        self.point.iter().enumerate().map(|(i, table)| point(path, i + 1, table, cameras)).collect()
    }

    /// Captures and intrinsics that the cameras name.
    pub(super) fn inputs(&self, path: &Path) -> Vec<PathBuf> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let named =
            self.camera.iter().flat_map(|camera| std::iter::once(&camera.capture).chain(&camera.intrinsics));
        let path_of = |file: &PathBuf| {
            let file = folder.join(file);
            // The files of a pattern are in its folder.
            let is_pattern = file.to_string_lossy().contains('%') && !file.exists();
            file.parent().filter(|_| is_pattern).map_or(file.clone(), Path::to_owned)
        };
        named.map(path_of).collect()
    }

    /// Lengths that are known in metres. None only where control points are.
    pub(super) fn lengths(&self, path: &Path, cameras: &[ProjectCamera]) -> Result<Vec<KnownLength>> {
        if self.scale.is_empty() && self.control.is_empty() {
            let problem = "missing; a known distance, a camera's height, a calibration board or control points ([[control]]) fix \
                           the metres";
            return Err(Error::content(path, "[scale]", problem));
        }
        metres::lengths(path, &self.scale, cameras)
    }

    /// Points with known coordinates.
    pub(super) fn control_points(&self, path: &Path, cameras: &[ProjectCamera]) -> Result<Vec<ControlPoint>> {
        metres::control_points(path, &self.control, cameras)
    }
}

fn camera(path: &Path, number: usize, table: &ProjectCameraTable) -> Result<ProjectCamera> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let place = |key: &str| format!("[[camera]] {number}, {key}");
    let fits = |c: char| c.is_alphanumeric() || ['-', '_', '.', ' '].contains(&c);
    if table.name.trim().is_empty() || !table.name.chars().all(fits) || table.name.starts_with('.') {
        let problem = format!("`{}` cannot become a file name; use letters, digits, `-`, `_`", table.name);
        return Err(Error::content(path, place("name"), problem));
    }
    let capture = folder.join(&table.capture);
    if !capture.exists() && !capture.to_string_lossy().contains('%') {
        let problem = format!("`{}` is neither a folder of images nor a video file", capture.display());
        return Err(Error::content(path, place("capture"), problem));
    }
    let text = match &table.reference {
        ReferenceValue::Word(word) => word.clone(),
        ReferenceValue::Number(number) => number.to_string(),
    };
    let reference: ReferenceFrame = text.parse().map_err(|_| {
        let problem = format!(
            "`{text}` is none of \"first\", \"last\", a frame counted from 1 or the file name of an image"
        );
        Error::content(path, place("reference"), problem)
    })?;
    let lens = table.intrinsics.as_ref().map(|file| calib::files::read_intrinsics(&folder.join(file)));
    Ok(ProjectCamera { name: table.name.clone(), capture, reference, intrinsics: lens.transpose()? })
}

fn point(
    path: &Path,
    number: usize,
    table: &BTreeMap<String, [f64; 2]>,
    cameras: &[ProjectCamera],
) -> Result<PickedPoint> {
    let mut picks = Vec::with_capacity(table.len());
    for (name, pixel) in table {
        let place = format!("[[point]] {number}, {name}");
        let camera = camera_called(path, &place, name, cameras)?;
        picks.push((camera, finite(path, &place, *pixel)?));
    }
    if picks.len() < 2 {
        let problem = "a point must be picked in two or more cameras to join them";
        return Err(Error::content(path, format!("[[point]] {number}"), problem));
    }
    picks.sort_by_key(|(camera, _)| *camera);
    Ok(PickedPoint { picks })
}
