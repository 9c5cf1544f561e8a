//! nerfstudio's `transforms.json`: cameras as OpenGL has them (x right, y up, z backwards), world from camera
//! (<https://docs.nerf.studio/quickstart/data_conventions.html>).

#[cfg(test)]
mod tests;

use std::collections::BTreeSet;
use std::path::Path;

use calib::{Camera, Intrinsics};
use nalgebra::{Isometry3, Matrix3, Matrix4, Translation3};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value as Json};

use super::{CORNER_PX, camera_name, picture_name};
use crate::room::{Room, RoomCamera};
use crate::{Error, Result};

/// Camera models that ours covers; distortion that a model does not have is zero in the file.
const MODELS: [&str; 3] = ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE"];

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
        Self {
            camera_model: self.camera_model.or(all.camera_model),
            distortion_params: if states_distortion { self.distortion_params } else { all.distortion_params },
            w: self.w.or(all.w),
            h: self.h.or(all.h),
            fl_x: self.fl_x.or(all.fl_x),
            fl_y: self.fl_y.or(all.fl_y),
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

    fn intrinsics(self) -> std::result::Result<Intrinsics, String> {
        let needed = |value: Option<f64>, key: &str| value.ok_or_else(|| format!("`{key}` is missing"));
        let side = |value: Option<f64>, key: &str| {
            let pixels = needed(value, key)?;
            let whole = pixels >= 1.0 && pixels <= f64::from(u32::MAX) && pixels.fract() == 0.0;
            if whole { Ok(pixels as u32) } else { Err(format!("`{key}` is {pixels}, no image's side")) }
        };
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
        let fx = needed(self.fl_x, "fl_x")?;
        let distortion = [k1, k2, p1, p2, k3];
        let intrinsics = Intrinsics {
            width: side(self.w, "w")?,
            height: side(self.h, "h")?,
            fx,
            fy: self.fl_y.unwrap_or(fx),
            cx: needed(self.cx, "cx")? - CORNER_PX,
            cy: needed(self.cy, "cy")? - CORNER_PX,
            distortion: distortion.into(),
        };
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

/// Reads the cameras of a `transforms.json`, in its order, named after their pictures. Its world has to be the room's:
/// metres, Z up, the floor at z = 0.
///
/// # Errors
/// [`Error::Calib`] when the file cannot be read, [`Error::Content`] naming the frame and its problem.
pub fn read(path: &Path) -> Result<Vec<RoomCamera>> {
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
    let cameras: Result<Vec<RoomCamera>> = input
        .frames
        .iter()
        .zip(1..)
        .map(|(frame, number)| {
            let wrong =
                |problem| Error::content(path, format!("frame {number} (`{}`)", frame.file_path), problem);
            sort_out(&frame.other, &mut unread).map_err(|(_, problem)| wrong(problem))?;
            let intrinsics = frame.lens.clone().or(input.lens.clone()).intrinsics().map_err(wrong)?;
            let camera = Camera { intrinsics, camera_from_world: frame.pose().map_err(wrong)? };
            let picture = Path::new(&frame.file_path).file_name().unwrap_or_default().to_string_lossy();
            Ok(RoomCamera { name: camera_name(&picture), camera, reference: None })
        })
        .collect();
    let cameras = cameras?;
    if !unread.is_empty() {
        let keys: Vec<String> = unread.into_iter().map(|key| format!("`{key}`")).collect();
        tracing::warn!("{}: not read: {}", path.display(), keys.join(", "));
    }
    Ok(cameras)
}

/// Keys that do not change where a frame's points are seen.
const HARMLESS: [&str; 24] = [
    "aabb_scale",
    "applied_scale",
    "applied_transform",
    "camera_angle_x",
    "camera_angle_y",
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
    "ply_file_path",
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
