//! A capture project of a synthetic room, as a person would make it: films of moved cameras, lenses, picks, the height
//! of a camera.

use std::fmt::Write as _;
use std::path::Path;

use calib::Camera;
use glam::Vec3;
use nalgebra::{Isometry3, Point2, Point3, Vector2};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use scenes::raycast::RayScene;
use synthetic::{CaptureOptions, SyntheticRoom};

use crate::chain::StepResult;

/// Number of points picked in the pictures of two cameras.
const PICKS: usize = 14;
/// Least distance of picks from the image's border, as a share of its width.
const MARGIN: f64 = 1.0 / 16.0;

/// Films a room's cameras, moved by hand, and writes `room.toml` with picks in the pictures of each two cameras that follow each
/// other, as exact as their pixels. Beside it are `truth.json`, the true poses as in the data sets, and `zones.toml` in the frame of
/// the room that will be built.
///
/// # Errors
/// A room of fewer than two cameras or without geometry; a file that cannot be written.
pub fn write(folder: &Path, room: &SyntheticRoom, frames: usize) -> StepResult<()> {
    write_with_noise(folder, room, frames, 0.0)
}

/// The same with picks by a hand that errs by `pick_sigma_px` in both coordinates.
///
/// # Errors
/// As [`write()`].
pub fn write_with_noise(
    folder: &Path,
    room: &SyntheticRoom,
    frames: usize,
    pick_sigma_px: f64,
) -> StepResult<()> {
    let cameras = &room.room.cameras;
    let [first, _, ..] = cameras.as_slice() else { return Err("one camera alone".into()) };
    let (mut text, mut truth) = (String::new(), serde_json::Map::new());
    for (seed, entry) in (1..).zip(cameras) {
        let name = &entry.name;
        let options = CaptureOptions { seed, frames, ..CaptureOptions::default() };
        let capture = folder.join(name);
        std::fs::create_dir_all(&capture).map_err(|e| e.to_string())?;
        let (pictures, poses) = room.capture(&entry.camera, &options);
        for (i, frame) in pictures.iter().enumerate() {
            frame.save(capture.join(format!("{i:02}.png"))).map_err(|e| e.to_string())?;
        }
        calib::files::write_intrinsics(&folder.join(format!("{name}.toml")), &entry.camera.intrinsics)
            .map_err(|e| e.to_string())?;
        let _ = writeln!(
            text,
            "[[camera]]\nname = \"{name}\"\ncapture = \"{name}\"\nintrinsics = \"{name}.toml\""
        );
        let mut of_camera = pose(&entry.camera.camera_from_world);
        of_camera["capture"] = poses.iter().map(pose).collect();
        truth.insert(name.clone(), of_camera);
    }
    let mut rng = Pcg64Mcg::seed_from_u64(2);
    let mut by_hand = |pixel: Point2<f64>| {
        pixel + Vector2::from_fn(|_, _| pick_sigma_px * rng.sample::<f64, _>(StandardNormal))
    };
    for pair in cameras.windows(2) {
        for pixels in picks(room, [&pair[0].camera, &pair[1].camera], PICKS, 1)? {
            let [a, b] = pixels.map(&mut by_hand);
            let (one, other) = (&pair[0].name, &pair[1].name);
            let _ = writeln!(text, "[[point]]\n{one} = [{}, {}]\n{other} = [{}, {}]", a.x, a.y, b.x, b.y);
        }
    }
    let _ = writeln!(text, "[scale]\ncamera = \"{}\"\nheight = {}", first.name, first.camera.center().z);
    let save = |name: &str, text: &str| std::fs::write(folder.join(name), text).map_err(|e| e.to_string());
    save("room.toml", &text)?;
    save("truth.json", &serde_json::json!({ "cameras": truth }).to_string())?;
    save("zones.toml", &zones(room, &first.camera))
}

/// A pose (`camera_from_world`) as `R`, row by row, and `t`.
fn pose(pose: &Isometry3<f64>) -> serde_json::Value {
    let rotation = pose.rotation.to_rotation_matrix();
    let rows: Vec<Vec<f64>> = rotation.matrix().row_iter().map(|row| row.iter().copied().collect()).collect();
    serde_json::json!({ "R": rows, "t": pose.translation.vector.as_slice() })
}

/// Pixels of `count` places visible to both cameras, well inside both images.
///
/// # Errors
/// A room without geometry.
pub fn picks(
    room: &SyntheticRoom,
    [a, b]: [&Camera; 2],
    count: usize,
    seed: u64,
) -> StepResult<Vec<[Point2<f64>; 2]>> {
    let geometry = room.room.geometry.as_ref().ok_or("the room has no geometry")?;
    let scene = RayScene::new(geometry).map_err(|e| e.to_string())?;
    let single = |p: Point3<f64>| Vec3::new(p.x as f32, p.y as f32, p.z as f32);
    let [width, height] = [a.intrinsics.width, a.intrinsics.height].map(f64::from);
    let margin = MARGIN * width;
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut picks = Vec::new();
    while picks.len() < count {
        let pixel =
            Point2::new(rng.random_range(margin..width - margin), rng.random_range(margin..height - margin));
        let Some(direction) = a.intrinsics.unproject(&pixel) else { continue };
        let ray = a.camera_from_world.rotation.inverse() * direction;
        let Some(hit) = scene.cast(single(a.center()), single(Point3::from(ray))) else { continue };
        let place = a.center() + ray * f64::from(hit.distance);
        let inside = |p: &Point2<f64>| {
            (margin..width - margin).contains(&p.x) && (margin..height - margin).contains(&p.y)
        };
        let Some(other) = b.project(&place).filter(inside) else { continue };
        if !scene.is_blocked(single(b.center()), single(place)) {
            picks.push([pixel, other]);
        }
    }
    Ok(picks)
}

/// The room's zones below `camera`: the built room's origin is there, its x axis the camera's viewing direction.
fn zones(room: &SyntheticRoom, camera: &Camera) -> String {
    let view = camera.camera_from_world.rotation.inverse() * nalgebra::Vector3::z();
    let (x, below) = (view.xy().normalize(), camera.center().xy());
    let y = Vector2::new(-x.y, x.x);
    let mut text = String::new();
    for zone in &room.room.zones {
        let corner = |p: &Point2<f64>| format!("[{}, {}]", (p - below).dot(&x), (p - below).dot(&y));
        let corners: Vec<String> = zone.polygon.0.iter().map(corner).collect();
        let _ = writeln!(text, "[[zone]]\nname = \"{}\"\npolygon = [{}]", zone.name, corners.join(", "));
    }
    text
}
