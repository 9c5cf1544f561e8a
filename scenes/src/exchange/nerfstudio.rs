//! nerfstudio's `transforms.json`: cameras as OpenGL has them (x right, y up, z backwards), world from camera
//! (<https://docs.nerf.studio/quickstart/data_conventions.html>).

mod lens;
#[cfg(test)]
mod tests;
mod write;

use std::collections::BTreeSet;
use std::path::Path;

use calib::Camera;
use lens::LensInput;
use nalgebra::{Isometry3, Matrix3, Similarity3, Translation3, Vector3};
use serde::Deserialize;
use serde_json::{Map, Value as Json};

use super::selection::{Chosen, NamedAfter, camera_names};
use super::{Model, ModelGeometry, ModelOptions, PicturedCamera, placement};
use crate::room::RoomCamera;
use crate::{Error, Result};

pub use write::write;

/// Content of an input file: a lens stands in each frame or once for all; unsupported lens parameters must be zero.
#[derive(Deserialize)]
struct TransformsInput {
    #[serde(flatten)]
    lens: LensInput,
    frames: Vec<FrameInput>,
    ply_file_path: Option<String>,
    applied_transform: Option<Vec<Vec<f64>>>,
    applied_scale: Option<f64>,
    #[serde(flatten)]
    other: Map<String, Json>,
}

#[derive(Deserialize)]
struct FrameInput {
    file_path: String,
    #[serde(flatten)]
    lens: LensInput,
    transform_matrix: Vec<Vec<f64>>,
    #[serde(flatten)]
    other: Map<String, Json>,
}

impl FrameInput {
    fn pose(&self) -> std::result::Result<Isometry3<f64>, String> {
        /// Largest deviation of the last row from 0 0 0 1.
        const TOLERANCE: f64 = 1e-6;
        let m = &self.transform_matrix;
        if m.len() < 3 || m.len() > 4 || m.iter().any(|row| row.len() != 4) {
            return Err("`transform_matrix` has not 4 rows of 4 numbers".into());
        }
        if m.iter().flatten().any(|x| !x.is_finite())
            || m.get(3).is_some_and(|row| {
                row.iter().zip([0.0, 0.0, 0.0, 1.0]).any(|(x, e)| (x - e).abs() > TOLERANCE)
            })
        {
            return Err("`transform_matrix` does not end in 0 0 0 1".into());
        }
        // OpenGL's axes up and backwards become down and forwards.
        let rotation = Matrix3::from_fn(|r, c| if c == 0 { m[r][c] } else { -m[r][c] });
        let rotation =
            calib::rotation::from_matrix(&rotation).map_err(|e| format!("`transform_matrix`: {e}"))?;
        let translation = Translation3::new(m[0][3], m[1][3], m[2][3]);
        Ok(Isometry3::from_parts(translation, rotation).inverse())
    }
}

impl TransformsInput {
    /// Way from the file's world to the one before `applied_transform` and `applied_scale`.
    ///
    /// # Errors
    /// The key, and the problem with it.
    fn original_from_file(&self) -> std::result::Result<Similarity3<f64>, (&'static str, String)> {
        let scale = self.applied_scale.unwrap_or(1.0);
        if !(scale > 0.0 && scale.is_finite()) {
            return Err(("applied_scale", format!("{scale} is no scale; correct or remove it")));
        }
        let Some(rows) = &self.applied_transform else {
            return Ok(Similarity3::from_scaling(1.0 / scale));
        };
        let wrong = |problem: String| ("applied_transform", problem);
        if rows.len() < 3 || rows.len() > 4 || rows.iter().any(|row| row.len() != 4) {
            return Err(wrong("it has not 3 rows of 4 numbers".into()));
        }
        let rotation = calib::rotation::from_matrix(&Matrix3::from_fn(|r, c| rows[r][c]))
            .map_err(|e| wrong(e.to_string()))?;
        let translation = Vector3::from_fn(|r, _| rows[r][3]);
        if !translation.iter().all(|t| t.is_finite()) {
            return Err(wrong("a number is not finite".into()));
        }
        // The file's points are applied_scale · (applied_transform · original).
        let back = rotation.inverse();
        Ok(Similarity3::from_parts((-(back * translation)).into(), back, 1.0 / scale))
    }

    /// Geometry that the file names, unless it is not there.
    fn geometry(&self, path: &Path, model_from_file: Similarity3<f64>) -> ModelGeometry {
        let Some(named) = &self.ply_file_path else { return ModelGeometry::None };
        let file = path.with_file_name("").join(named);
        if file.is_file() {
            return ModelGeometry::File { path: file, model_from_file };
        }
        tracing::warn!(
            "{}: `ply_file_path`: there is no file {}, so the room gets no geometry; name one with --geometry",
            path.display(),
            file.display()
        );
        ModelGeometry::None
    }
}

/// Reads a `transforms.json`: its cameras, named after their pictures, and the geometry that it names.
///
/// # Errors
/// [`Error::Calib`] when the file cannot be read, [`Error::File`] naming the frame and its problem.
pub fn read(path: &Path, options: &ModelOptions) -> Result<Model> {
    let text = calib::files::read_text(path)?;
    let input: TransformsInput = serde_json::from_str(&text).map_err(|e| {
        let place = if e.line() > 0 {
            format!("line {}, column {}", e.line(), e.column())
        } else {
            "whole file".into()
        };
        let said = e.to_string();
        let problem = said.split(" at line ").next().unwrap_or_default();
        Error::content(path, place, format!("this is no transforms.json: {problem}"))
    })?;
    let mut unread = BTreeSet::new();
    sort_out(&input.other, &mut unread).map_err(|(key, problem)| Error::content(path, key, problem))?;
    if input.frames.is_empty() {
        return Err(Error::content(path, "frames", "there is none; no camera was placed"));
    }
    let model_from_file = if options.undo_applied {
        input.original_from_file().map_err(|(key, problem)| Error::content(path, key, problem))?
    } else {
        Similarity3::identity()
    };
    let names: Vec<String> = input.frames.iter().map(|frame| frame.file_path.clone()).collect();
    let chosen = options.selection.choose(path, &names, camera_names(&names, NamedAfter::File))?;
    // Paths count from the file's folder; a folder of pictures that the user names comes first.
    let mut pictures = options.pictures.clone();
    pictures.folders.push(path.with_file_name(""));
    let cameras: Result<Vec<PicturedCamera>> = chosen
        .into_iter()
        .map(|Chosen { index, name }| {
            let frame = &input.frames[index];
            let place = format!("frame {} (`{}`)", index + 1, frame.file_path);
            let wrong = |problem| Error::content(path, place.as_str(), problem);
            sort_out(&frame.other, &mut unread).map_err(|(_, problem)| wrong(problem))?;
            let lens = frame.lens.clone().or(input.lens.clone());
            let intrinsics = lens.intrinsics(&frame.file_path, &pictures).map_err(wrong)?;
            let camera = Camera { intrinsics, camera_from_world: frame.pose().map_err(wrong)? };
            let camera = placement::placed(&camera, &model_from_file);
            let entry = RoomCamera { name, camera, reference: None };
            Ok(PicturedCamera { picture: frame.file_path.clone(), entry })
        })
        .collect();
    let cameras = cameras?;
    if !unread.is_empty() {
        let keys: Vec<String> = unread.into_iter().map(|key| format!("`{key}`")).collect();
        tracing::warn!("{}: not read: {}", path.display(), keys.join(", "));
    }
    if let Some(scale) =
        input.applied_scale.filter(|scale| (scale - 1.0).abs() > 0.0 && !options.undo_applied)
    {
        tracing::warn!(
            "{}: `applied_scale` is {scale}: the file's unit is no longer that of its source; --undo-applied brings it back",
            path.display()
        );
    }
    Ok(Model { cameras, geometry: input.geometry(path, model_from_file) })
}

/// Keys that do not change where a frame's points are seen.
const HARMLESS: [&str; 19] = [
    "aabb_scale",
    "centroid",
    "colmap_im_id",
    "depth_file_path",
    "depth_path",
    "from_na",
    "integer_depth_scale",
    "mask_path",
    "n_extra_learnable_dims",
    "name",
    "offset",
    "orientation_override",
    "scale",
    "sharpness",
    "test_filenames",
    "timestamp",
    "train_filenames",
    "up",
    "val_filenames",
];

/// Sorts out the keys that are not read: those that would change the lens are refused unless they say nothing (0, false),
/// the rest is collected for a warning.
///
/// # Errors
/// The key, and the problem with it.
fn sort_out(
    other: &Map<String, Json>,
    unread: &mut BTreeSet<String>,
) -> std::result::Result<(), (String, String)> {
    for (key, value) in other {
        if is_of_lens(key) && !says_nothing(value) {
            let problem = format!("`{key}` changes the lens and is not known here; undistort the pictures");
            return Err((key.clone(), problem));
        }
        if !HARMLESS.contains(&key.as_str()) && !is_of_lens(key) {
            unread.insert(key.chars().filter(|c| !c.is_control()).take(60).collect());
        }
    }
    Ok(())
}

/// Whether a key belongs to a lens: a numbered coefficient, one of instant-ngp's other projections, a shutter.
fn is_of_lens(key: &str) -> bool {
    let is_numbered = |letter: char| {
        key.strip_prefix(letter).is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()))
    };
    let words = [
        "fisheye",
        "ftheta",
        "latlong",
        "equirect",
        "panoram",
        "spherical",
        "ortho",
        "distort",
        "rolling_shutter",
        "lens",
    ];
    ['k', 'p', 's'].into_iter().any(is_numbered) || words.iter().any(|word| key.to_lowercase().contains(word))
}

/// Whether a value is one that leaves the lens as it is.
fn says_nothing(value: &Json) -> bool {
    match value {
        Json::Null | Json::Bool(false) => true,
        Json::Number(number) => number.as_f64() == Some(0.0),
        Json::Array(values) => values.iter().all(says_nothing),
        _ => false,
    }
}
