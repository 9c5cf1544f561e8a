//! Writing of `transforms.json`.

use std::path::Path;

use nalgebra::Matrix4;
use serde::Serialize;

use crate::exchange::{CORNER_PX, picture_name};
use crate::room::Room;
use crate::{Error, Result};

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
