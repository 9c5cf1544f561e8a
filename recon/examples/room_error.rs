//! How far a reconstructed room is from the true one: relative camera poses, floor, depth.
//!
//! `cargo run --release -p recon --example room_error -- ROOM-DIR TRUE-ROOM-DIR [TRUTH.json]`
//!
//! Camera poses come from both rooms' `scene.toml` (or, where the truth is no room, from `truth.json`); the true depth
//! is `depth_NAME.png` beside them. A room's frame is its own business: relative poses, heights and depths are
//! compared, never coordinates.

use std::path::Path;

use anyhow::{Context, Result};
use nalgebra::{Isometry3, Matrix3, Translation3, Vector3};
use scenes::depth::{self, DepthMap, png};
use scenes::raycast::RayScene;
use scenes::room::Room;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [room_dir, truth_dir, rest @ ..] = arguments.as_slice() else {
        anyhow::bail!("ROOM-DIR TRUE-ROOM-DIR [TRUTH.json]")
    };
    let room = Room::read(Path::new(room_dir))?;
    let truth = if let [file] = rest {
        poses_of_json(Path::new(file), &room)?
    } else {
        let truth = Room::read(Path::new(truth_dir))?;
        let pose = |name: &str| Ok(truth.camera(name)?.camera.camera_from_world);
        room.cameras.iter().map(|c| pose(&c.name)).collect::<Result<Vec<_>>>()?
    };
    let poses: Vec<Isometry3<f64>> = room.cameras.iter().map(|c| c.camera.camera_from_world).collect();
    for b in 1..poses.len() {
        let (estimated, actual) = (poses[0] * poses[b].inverse(), truth[0] * truth[b].inverse());
        let off = estimated.inverse() * actual;
        println!(
            "{} seen from {}: {:.2} cm, {:.3} deg (length {:.3} m of {:.3} m)",
            room.cameras[b].name,
            room.cameras[0].name,
            100.0 * (estimated.translation.vector - actual.translation.vector).norm(),
            off.rotation.angle().to_degrees(),
            estimated.translation.vector.norm(),
            actual.translation.vector.norm()
        );
    }
    let scene = RayScene::new(room.geometry.as_ref().context("the room has no geometry")?)?;
    for ((camera, pose), actual) in room.cameras.iter().zip(&poses).zip(&truth) {
        let up = |p: &Isometry3<f64>| p.rotation * Vector3::z();
        let height = |p: &Isometry3<f64>| p.inverse().translation.vector.z;
        println!(
            "{}: tilt {:.3} deg, height {:.3} m, {:+.2} cm off",
            camera.name,
            up(pose).angle(&up(actual)).to_degrees(),
            height(pose),
            100.0 * (height(pose) - height(actual))
        );
        let seen = depth::render(&scene, &camera.camera);
        let expected = png::read(&Path::new(truth_dir).join(format!("depth_{}.png", camera.name)))?;
        compare(&camera.name, &seen, &expected, Path::new(room_dir))?;
    }
    Ok(())
}

fn compare(name: &str, seen: &DepthMap, expected: &DepthMap, room_dir: &Path) -> Result<()> {
    let (mut total, mut covered, mut good, mut nearer, mut farther) = (0, 0, 0, 0, 0);
    let mut picture = image::RgbImage::new(seen.width, seen.height);
    for v in 0..seen.height {
        for u in 0..seen.width {
            let (z, truth) = (seen.at(u, v), expected.at(u, v));
            if truth <= 0.0 {
                continue;
            }
            total += 1;
            if z <= 0.0 {
                continue;
            }
            covered += 1;
            let error = z - truth;
            good += usize::from(error.abs() <= 0.05);
            // Too near hides people who are there; too far shows people who are hidden.
            nearer += usize::from(error < -0.2);
            farther += usize::from(error > 0.2);
            let shade = (255.0 * (error.abs() / 0.2).min(1.0)) as u8;
            let pixel = if error.abs() <= 0.05 {
                [0, 255 - shade, 0]
            } else if error < 0.0 {
                [shade, 0, 0]
            } else {
                [shade, shade, 0]
            };
            picture.put_pixel(u, v, image::Rgb(pixel));
        }
    }
    let percent = |n: usize| 100.0 * n as f64 / total.max(1) as f64;
    println!(
        "{name}: depth within 5 cm {:.1} %, covered {:.1} %, more than 20 cm too near {:.1} %, too far {:.1} %",
        percent(good),
        percent(covered),
        percent(nearer),
        percent(farther)
    );
    picture.save(room_dir.join(format!("preview/{name}_error.png")))?;
    Ok(())
}

fn poses_of_json(file: &Path, room: &Room) -> Result<Vec<Isometry3<f64>>> {
    let truth: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(file)?)?;
    room.cameras
        .iter()
        .map(|camera| {
            let camera = &truth["cameras"][&camera.name];
            let rows: [[f64; 3]; 3] = serde_json::from_value(camera["R"].clone())?;
            let t: [f64; 3] = serde_json::from_value(camera["t"].clone())?;
            let rotation = calib::rotation::from_matrix(&Matrix3::from_fn(|r, c| rows[r][c]))?;
            Ok(Isometry3::from_parts(Translation3::from(Vector3::from(t)), rotation))
        })
        .collect()
}
