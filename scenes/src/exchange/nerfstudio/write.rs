//! Writing of `transforms.json`.

use std::path::Path;

use calib::{BrownConrady, Distortion};
use nalgebra::Matrix4;
use serde::Serialize;

use super::lens::FISHEYE;
use crate::exchange::{CORNER_PX, picture_name};
use crate::room::Room;
use crate::{Error, Result};

/// nerfstudio's model of ordinary lenses.
const OPENCV: &str = "OPENCV";

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
    /// Lens model of the frame, if it is another one than that of the whole file.
    #[serde(skip_serializing_if = "Option::is_none")]
    camera_model: Option<&'static str>,
    k1: f64,
    k2: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    p1: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    p2: Option<f64>,
    k3: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    k4: Option<f64>,
    /// Row by row.
    transform_matrix: [[f64; 4]; 4],
}

/// A lens as nerfstudio has it.
struct WrittenLens {
    camera_model: &'static str,
    /// k1, k2, k3.
    radial: [f64; 3],
    k4: Option<f64>,
    tangential: Option<[f64; 2]>,
}

impl WrittenLens {
    /// `None` for a lens that nerfstudio does not have.
    fn of(distortion: &Distortion) -> Option<Self> {
        match *distortion {
            Distortion::BrownConrady(BrownConrady { k1, k2, p1, p2, k3 }) => Some(Self {
                camera_model: OPENCV,
                radial: [k1, k2, k3],
                k4: None,
                tangential: Some([p1, p2]),
            }),
            Distortion::Fisheye(fisheye) => {
                let [k1, k2, k3, k4] = fisheye.coefficients();
                let radial = [k1, k2, k3];
                Some(Self { camera_model: FISHEYE, radial, k4: Some(k4), tangential: None })
            }
            Distortion::Rational(_) => None,
        }
    }
}

/// Writes the room's cameras.
///
/// # Errors
/// [`Error::Room`] for a lens that nerfstudio does not have; [`Error::Calib`] when the file cannot be written.
pub fn write(path: &Path, room: &Room) -> Result<()> {
    let lenses = room.cameras.iter().map(|entry| {
        let lens = WrittenLens::of(&entry.camera.intrinsics.distortion);
        lens.ok_or_else(|| Error::Room {
            place: format!("camera `{}`", entry.name),
            problem: "nerfstudio has no rational lens; export a COLMAP model".into(),
        })
    });
    let lenses = lenses.collect::<Result<Vec<_>>>()?;
    // nerfstudio's own reader takes the model of all frames.
    let camera_model = lenses.first().map_or(OPENCV, |lens| lens.camera_model);
    let frames = room
        .cameras
        .iter()
        .zip(lenses)
        .map(|(entry, lens)| {
            let k = &entry.camera.intrinsics;
            let [k1, k2, k3] = lens.radial;
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
                camera_model: (lens.camera_model != camera_model).then_some(lens.camera_model),
                k1,
                k2,
                p1: lens.tangential.map(|p| p[0]),
                p2: lens.tangential.map(|p| p[1]),
                k3,
                k4: lens.k4,
                transform_matrix: std::array::from_fn(|r| std::array::from_fn(|c| world_from_camera[(r, c)])),
            }
        })
        .collect();
    let text = serde_json::to_string_pretty(&Transforms { camera_model, frames })
        .map_err(|e| Error::content(path, "transforms", e.to_string()))?;
    Ok(calib::files::write_atomic(path, format!("{text}\n").as_bytes())?)
}
