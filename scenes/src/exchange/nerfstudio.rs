//! nerfstudio's `transforms.json`: cameras as OpenGL has them (x right, y up, z backwards), world from camera
//! (<https://docs.nerf.studio/quickstart/data_conventions.html>).

#[cfg(test)]
mod tests;

use std::collections::BTreeSet;
use std::path::Path;

use calib::{Camera, Intrinsics};
use nalgebra::{Isometry3, Matrix3, Matrix4, Similarity3, Translation3, Vector3};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value as Json};

use super::selection::{Chosen, NamedAfter, camera_names};
use super::{
    CORNER_PX, Model, ModelGeometry, ModelOptions, PicturedCamera, Pictures, picture_name, placement,
};
use crate::room::{Room, RoomCamera};
use crate::{Error, Result};

/// Camera models that ours covers; distortion that a model does not have is zero in the file.
const MODELS: [&str; 5] = ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"];

#[derive(Serialize)]
struct Transforms {
    camera_model: &'static str,
    frames: Vec<FrameOutput>,
}

#[derive(Serialize)]
struct FrameOutput {
    file_path: String,
    w: u32,
    h: u32,
    fl_x: f64,
    fl_y: f64,
    cx: f64,
    cy: f64,
    k1: f64,
    k2: f64,
    p1: f64,
    p2: f64,
    k3: f64,
    /// Row by row.
    transform_matrix: [[f64; 4]; 4],
}

/// Writes the room's cameras.
///
/// # Errors
/// [`Error::Calib`] when the file cannot be written.
pub fn write(path: &Path, room: &Room) -> Result<()> {
    let frames = room
        .cameras
        .iter()
        .map(|entry| {
            let k = &entry.camera.intrinsics;
            let [k1, k2, p1, p2, k3]: [f64; 5] = k.distortion.into();
            // The y axis turns from down to up, the z axis from forwards to backwards.
            let flip = Matrix4::from_diagonal(&nalgebra::Vector4::new(1.0, -1.0, -1.0, 1.0));
            let world_from_camera = entry.camera.camera_from_world.inverse().to_homogeneous() * flip;
            let file_path = entry.reference.as_ref().map(|r| r.to_string_lossy().into_owned());
            FrameOutput {
                file_path: file_path.unwrap_or_else(|| picture_name(entry)),
                w: k.width,
                h: k.height,
                fl_x: k.fx,
                fl_y: k.fy,
                cx: k.cx + CORNER_PX,
                cy: k.cy + CORNER_PX,
                k1,
                k2,
                p1,
                p2,
                k3,
                transform_matrix: std::array::from_fn(|r| std::array::from_fn(|c| world_from_camera[(r, c)])),
            }
        })
        .collect();
    let text = serde_json::to_string_pretty(&Transforms { camera_model: "OPENCV", frames })
        .map_err(|e| Error::content(path, "transforms", e.to_string()))?;
    Ok(calib::files::write_atomic(path, format!("{text}\n").as_bytes())?)
}

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

#[derive(Deserialize, Clone)]
struct LensInput {
    camera_model: Option<String>,
    /// k1, k2, k3, k4, p1 and p2, which nerfstudio prefers to the single numbers.
    distortion_params: Option<Vec<f64>>,
    w: Option<f64>,
    h: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    /// Angle of view across the picture, radians, in place of `fl_x`…
    camera_angle_x: Option<f64>,
    /// …and down it.
    camera_angle_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
}

impl LensInput {
    /// Fills missing numbers with those given for all frames.
    fn or(self, all: Self) -> Self {
        // A frame's own coefficients outweigh the parameters for all frames.
        let states_distortion =
            self.distortion_params.is_some() || self.distortion().iter().any(Option::is_some);
        // So does a frame's own focal length the angle for all frames, and the other way round.
        let states_focal = [self.fl_x, self.camera_angle_x].iter().any(Option::is_some);
        let shared = |value: Option<f64>| value.filter(|_| !states_focal);
        Self {
            camera_model: self.camera_model.or(all.camera_model),
            distortion_params: if states_distortion { self.distortion_params } else { all.distortion_params },
            w: self.w.or(all.w),
            h: self.h.or(all.h),
            fl_x: self.fl_x.or(shared(all.fl_x)),
            fl_y: self.fl_y.or(shared(all.fl_y)),
            camera_angle_x: self.camera_angle_x.or(shared(all.camera_angle_x)),
            camera_angle_y: self.camera_angle_y.or(shared(all.camera_angle_y)),
            cx: self.cx.or(all.cx),
            cy: self.cy.or(all.cy),
            k1: self.k1.or(all.k1),
            k2: self.k2.or(all.k2),
            p1: self.p1.or(all.p1),
            p2: self.p2.or(all.p2),
            k3: self.k3.or(all.k3),
            k4: self.k4.or(all.k4),
        }
    }

    /// k1, k2, k3, k4, p1 and p2, where they stand on their own.
    fn distortion(&self) -> [Option<f64>; 6] {
        [self.k1, self.k2, self.k3, self.k4, self.p1, self.p2]
    }

    /// Width and height, from the file or else from the picture itself.
    fn size(&self, picture: &str, pictures: &Pictures) -> std::result::Result<(u32, u32), String> {
        let side = |pixels: f64, key: &str| {
            let is_whole = pixels >= 1.0 && pixels <= f64::from(u32::MAX) && pixels.fract() == 0.0;
            if is_whole { Ok(pixels as u32) } else { Err(format!("`{key}` is {pixels}, no image's side")) }
        };
        match (self.w, self.h) {
            (Some(w), Some(h)) => Ok((side(w, "w")?, side(h, "h")?)),
            (w, _) => {
                let missing = if w.is_none() { "w" } else { "h" };
                let file = pictures.find(picture).ok_or_else(|| {
                    format!(
                        "`{missing}` is missing, and there is no picture to measure; name the pictures' folder with --images"
                    )
                })?;
                calib::picture::size(&file).map_err(|e| format!("`{missing}` is missing, and {e}"))
            }
        }
    }

    /// Focal lengths, pixels, as such or as angles of view.
    fn focal_lengths(&self, width: u32, height: u32) -> std::result::Result<(f64, f64), String> {
        let of_angle = |angle: Option<f64>, side: u32, key: &str| match angle {
            Some(rad) if rad > 0.0 && rad < std::f64::consts::PI => {
                Ok(Some(0.5 * f64::from(side) / (0.5 * rad).tan()))
            }
            Some(rad) => Err(format!("`{key}` is {rad}; it is an angle of view in radians, from 0 to 3.14")),
            None => Ok(None),
        };
        if let Some(fx) = self.fl_x {
            return Ok((fx, self.fl_y.unwrap_or(fx)));
        }
        let across = of_angle(self.camera_angle_x, width, "camera_angle_x")?;
        let down = of_angle(self.camera_angle_y, height, "camera_angle_y")?;
        match (across, self.fl_y.or(down)) {
            (Some(fx), fy) => Ok((fx, fy.unwrap_or(fx))),
            (None, _) => Err("`fl_x` is missing, and so is `camera_angle_x`".into()),
        }
    }

    fn intrinsics(self, picture: &str, pictures: &Pictures) -> std::result::Result<Intrinsics, String> {
        if let Some(model) = self.camera_model.as_deref().filter(|m| !MODELS.contains(m)) {
            return Err(format!("the `camera_model` {model} is not known here; undistort the pictures"));
        }
        let [k1, k2, k3, k4, p1, p2] = match self.distortion_params.as_deref() {
            Some(params) => <[f64; 6]>::try_from(params).map_err(|_| {
                format!(
                    "`distortion_params` holds {} numbers; they are k1, k2, k3, k4, p1 and p2",
                    params.len()
                )
            })?,
            None => self.distortion().map(|k| k.unwrap_or(0.0)),
        };
        if k4 != 0.0 {
            return Err("`k4` is not known here; undistort the pictures".into());
        }
        let (width, height) = self.size(picture, pictures)?;
        let (fx, fy) = self.focal_lengths(width, height)?;
        // Files with an angle of view need no principal point: it is the middle.
        let center = |value: Option<f64>, side: u32, key: &str| match value {
            Some(pixels) => Ok(pixels),
            None if self.fl_x.is_none() => Ok(0.5 * f64::from(side)),
            None => Err(format!("`{key}` is missing")),
        };
        let (cx, cy) = (center(self.cx, width, "cx")?, center(self.cy, height, "cy")?);
        let distortion = [k1, k2, p1, p2, k3].into();
        let intrinsics =
            Intrinsics { width, height, fx, fy, cx: cx - CORNER_PX, cy: cy - CORNER_PX, distortion };
        intrinsics.validate().map_err(|e| e.to_string())?;
        Ok(intrinsics)
    }
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
/// [`Error::Calib`] when the file cannot be read, [`Error::Content`] naming the frame and its problem.
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
    if let Some(scale) = input.applied_scale.filter(|scale| *scale != 1.0 && !options.undo_applied) {
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
