//! Writes a rendered, unseen office as files: a room with its geometry and depths (the reference of `room_error`), a
//! folder of pictures a camera, the true positions of the people, and a capture project of `FRAMES` frames a camera.
//! Runs of `recon build` and `tracker run` on several seeds show whether figures of the available rooms generalise.
//!
//! `cargo run --release -p tests --example rendered -- DIR [SEED] [PEOPLE] [CAMERAS] [FRAMES] [LENS]`; LENS is `pinhole`, `barrel`
//! (k1 = −0.35, k2 = 0.12) or `fisheye` (equidistant, 140° across).
#![forbid(unsafe_code)]

use std::fmt::Write as _;
use std::path::Path;

use calib::{Distortion, Fisheye};
use scenes::raycast::RayScene;
use synthetic::{RoomOptions, SequenceOptions, WalkerOptions};
use tests::chain::StepResult;
use tests::data::folder_to_write;

const RATE_HZ: f64 = 12.0;
const SECONDS: f64 = 30.0;

/// Horizontal field of view that a lens's matrix would have without its distortion, degrees, and the distortion.
fn filmed_through(lens: &str) -> StepResult<(f64, Distortion)> {
    match lens {
        "pinhole" => Ok((RoomOptions::default().field_of_view_deg, Distortion::NONE)),
        "barrel" => Ok((RoomOptions::default().field_of_view_deg, [-0.35, 0.12, 0.0, 0.0, 0.0].into())),
        "fisheye" => {
            // Half the width is the focal length times 70°.
            let half_width = 70.0_f64.to_radians();
            Ok((2.0 * half_width.atan().to_degrees(), Fisheye::from([0.0; 4]).into()))
        }
        _ => Err(format!("{lens}: `pinhole`, `barrel` or `fisheye`")),
    }
}

fn main() -> StepResult<()> {
    let mut given = std::env::args().skip(1);
    let folder = folder_to_write(given.next())?;
    let mut number = |what: &str, default: u64| match given.next() {
        None => Ok(default),
        Some(text) => text.parse().map_err(|e| format!("{what} {text}: {e}")),
    };
    let (seed, people, cameras) = (number("SEED", 1)?, number("PEOPLE", 4)?, number("CAMERAS", 2)?);
    let frames = number("FRAMES", 50)?;
    let lens = given.next().unwrap_or_else(|| "pinhole".into());
    let (field_of_view_deg, distortion) = filmed_through(&lens)?;
    let folder = Path::new(&folder);
    let room = RoomOptions {
        seed,
        cameras: cameras as usize,
        image_px: [640, 480],
        field_of_view_deg,
        distortion,
        ..RoomOptions::default()
    }
    .build()
    .map_err(|e| e.to_string())?;
    room.room.write(&folder.join("room")).map_err(|e| e.to_string())?;
    tests::project::write(&folder.join("project"), &room, frames as usize)?;
    let geometry = room.room.geometry.as_ref().ok_or("the room has no geometry")?;
    let scene = RayScene::new(geometry).map_err(|e| e.to_string())?;
    for camera in &room.room.cameras {
        let depth = folder.join("room").join(format!("depth_{}.png", camera.name));
        scenes::depth::png::write(&depth, &scenes::depth::render(&scene, &camera.camera))
            .map_err(|e| e.to_string())?;
        let path = folder.join("video").join(&camera.name);
        std::fs::create_dir_all(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    let walkers = WalkerOptions { seed, people: people as usize, ..WalkerOptions::default() };
    let options = SequenceOptions {
        seed,
        rate_hz: RATE_HZ,
        frames: (RATE_HZ * SECONDS) as u32,
        ..SequenceOptions::default()
    };
    let mut truth = String::new();
    for frame in room.sequence(room.walkers(&walkers), options).frames() {
        for (camera, seen) in room.room.cameras.iter().zip(&frame.cameras) {
            if let Some(image) = &seen.image {
                let path = folder.join("video").join(&camera.name).join(format!("{:04}.jpg", frame.frame));
                image.save(&path).map_err(|e| format!("{}: {e}", path.display()))?;
            }
        }
        for person in frame.people.iter().filter(|p| p.inside) {
            let place = &person.place;
            let _ = writeln!(
                truth,
                "{},{},-1,-1,-1,-1,1,{:.4},{:.4},0",
                frame.frame, person.id, place.x, place.y
            );
        }
    }
    let path = folder.join("truth.txt");
    std::fs::write(&path, truth).map_err(|e| format!("{}: {e}", path.display()))
}
