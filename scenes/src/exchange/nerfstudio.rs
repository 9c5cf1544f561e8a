//! nerfstudio's `transforms.json`: cameras as OpenGL has them (x right, y up, z backwards), world from camera
//! (<https://docs.nerf.studio/quickstart/data_conventions.html>).

use std::path::Path;

use nalgebra::Matrix4;
use serde::Serialize;

use super::CORNER_PX;
use super::colmap::picture_name;
use crate::room::Room;
use crate::{Error, Result};

#[derive(Serialize)]
struct Transforms {
    camera_model: &'static str,
    frames: Vec<Frame>,
}

#[derive(Serialize)]
struct Frame {
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
            // Down becomes up, forwards becomes backwards.
            let flip = Matrix4::from_diagonal(&nalgebra::Vector4::new(1.0, -1.0, -1.0, 1.0));
            let world_from_camera = entry.camera.camera_from_world.inverse().to_homogeneous() * flip;
            let file_path = entry.reference.as_ref().map(|r| r.to_string_lossy().into_owned());
            Frame {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::RoomOptions;
    use nalgebra::{Point3, Vector4};

    #[test]
    fn points_fall_where_the_room_sees_them() {
        let room = RoomOptions::default().build().unwrap().room;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("transforms.json");
        write(&path, &room).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let file: serde_json::Value = serde_json::from_str(&text).unwrap();
        let place = Point3::new(3.0, 2.5, 0.4);
        for (frame, entry) in file["frames"].as_array().unwrap().iter().zip(&room.cameras) {
            let number = |key: &str| frame[key].as_f64().unwrap();
            let rows = &frame["transform_matrix"];
            let world_from_camera = Matrix4::from_fn(|r, c| rows[r][c].as_f64().unwrap());
            let p = world_from_camera.try_inverse().unwrap() * Vector4::new(place.x, place.y, place.z, 1.0);
            // OpenGL looks along −z, with y up.
            let u = number("fl_x") * p.x / -p.z + number("cx") - 0.5;
            let v = number("fl_y") * p.y / p.z + number("cy") - 0.5;
            let expected = entry.camera.project(&place).unwrap();
            assert!((u - expected.x).abs() < 1e-6 && (v - expected.y).abs() < 1e-6, "{u} {v} {expected}");
            assert_eq!(frame["file_path"], format!("{}.jpg", entry.name));
        }
    }
}
