//! A capture project of a synthetic room, as a person would make it: films of moved cameras, lenses, picks, the height
//! of a camera.

use std::fmt::Write as _;
use std::path::Path;

use calib::Camera;
use glam::Vec3;
use nalgebra::{Point2, Point3, Vector2};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use scenes::raycast::RayScene;
use synthetic::{CaptureOptions, SyntheticRoom};

use crate::chain::StepResult;

/// Number of picks.
const PICKS: usize = 14;
/// Least distance of picks from the image's border, as a share of its width.
const MARGIN: f64 = 1.0 / 16.0;

/// Films the room's first two cameras, moved by hand, and writes `room.toml` with picks as exact as their pixels, and
/// `zones.toml` in the frame of the room that will be built.
///
/// # Errors
/// A room of fewer than two cameras or without geometry; a file that cannot be written.
pub fn write(folder: &Path, room: &SyntheticRoom, frames: usize) -> StepResult<()> {
    let [first, second, ..] = room.room.cameras.as_slice() else { return Err("one camera alone".into()) };
    let mut text = String::new();
    for (seed, entry) in (1..).zip([first, second]) {
        let name = &entry.name;
        let options = CaptureOptions { seed, frames, ..CaptureOptions::default() };
        let capture = folder.join(name);
        std::fs::create_dir_all(&capture).map_err(|e| e.to_string())?;
        for (i, frame) in room.capture(&entry.camera, &options).0.iter().enumerate() {
            frame.save(capture.join(format!("{i:02}.png"))).map_err(|e| e.to_string())?;
        }
        calib::files::write_intrinsics(&folder.join(format!("{name}.toml")), &entry.camera.intrinsics)
            .map_err(|e| e.to_string())?;
        let _ = writeln!(
            text,
            "[[camera]]\nname = \"{name}\"\ncapture = \"{name}\"\nintrinsics = \"{name}.toml\""
        );
    }
    for [a, b] in picks(room, [&first.camera, &second.camera], PICKS, 1)? {
        let (one, other) = (&first.name, &second.name);
        let _ = writeln!(text, "[[point]]\n{one} = [{}, {}]\n{other} = [{}, {}]", a.x, a.y, b.x, b.y);
    }
    let _ = writeln!(text, "[scale]\ncamera = \"{}\"\nheight = {}", first.name, first.camera.center().z);
    let save = |name: &str, text: &str| std::fs::write(folder.join(name), text).map_err(|e| e.to_string());
    save("room.toml", &text)?;
    save("zones.toml", &zones(room, &first.camera))
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
