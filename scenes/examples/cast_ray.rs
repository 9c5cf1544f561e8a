//! Reads a room and asks what its first camera sees in the middle of the picture.
//!
//! `cargo run --example cast_ray -p scenes -- tests/office/room`
#![forbid(unsafe_code)]

use std::path::PathBuf;

use calib::Camera;
use nalgebra::Point2;
use scenes::geometry::{vec3_from_point, vec3_from_vector};
use scenes::raycast::RayScene;
use scenes::room::Room;

fn main() -> anyhow::Result<()> {
    let directory = std::env::args().nth(1).map_or_else(|| PathBuf::from("tests/office/room"), PathBuf::from);
    let room = Room::read(&directory)?;
    println!("{}: {} cameras, {} zones", directory.display(), room.cameras.len(), room.zones.len());

    let (Some(geometry), Some(entry)) = (&room.geometry, room.cameras.first()) else {
        anyhow::bail!("{}: the room has no camera or no geometry to look at", directory.display());
    };
    let scene = RayScene::new(geometry)?;
    let camera: &Camera = &entry.camera;
    let k = &camera.intrinsics;
    let middle = Point2::new(0.5 * (f64::from(k.width) - 1.0), 0.5 * (f64::from(k.height) - 1.0));

    // Directions are unit vectors in the world, so distances are metres.
    let Some(direction) = camera.ray(&middle) else {
        anyhow::bail!("{}: the lens of {} maps no ray to its middle", directory.display(), entry.name);
    };
    match scene.cast(vec3_from_point(&camera.center()), vec3_from_vector(&direction)) {
        Some(hit) => {
            println!("{} sees a surface {:.2} m away, normal {:.2}", entry.name, hit.distance, hit.normal);
        }
        None => println!("{} sees no surface in the middle of its picture", entry.name),
    }
    Ok(())
}
