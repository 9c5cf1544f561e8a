//! Prints the error of the motion of rendered captures of 1,280 × 720 pixels that are worked on at 640 × 360, without refinement in
//! the filmed pictures and with it.
//!
//! `cargo run --release -p tests --example filmed_size -- DIR FIRST_SEED COUNT [FRAMES]`; the pictures are rendered into DIR once.

use std::path::Path;
use std::time::Instant;

use recon::capture::{CaptureFile, ReferenceFrame};
use recon::motion::{self, MotionOptions};
use synthetic::{CaptureOptions, RoomOptions};
use tests::accuracy;
use tests::chain::StepResult;

fn main() -> StepResult<()> {
    let mut given = std::env::args().skip(1);
    let folder = given.next().ok_or("give a folder")?;
    let mut number = |what: &str, default: u64| match given.next() {
        None => Ok(default),
        Some(text) => text.parse().map_err(|e| format!("{what} {text}: {e}")),
    };
    let (first, count, frames) = (number("FIRST_SEED", 1)?, number("COUNT", 1)?, number("FRAMES", 16)?);
    for seed in first..first + count {
        let room = RoomOptions { seed, image_px: [1280, 720], ..RoomOptions::default() }.build();
        let room = room.map_err(|e| e.to_string())?;
        let camera = &room.room.cameras[0].camera;
        let options = CaptureOptions { seed, frames: frames as usize, ..CaptureOptions::default() };
        let pictures = Path::new(&folder).join(format!("{seed}"));
        if !pictures.is_dir() {
            std::fs::create_dir_all(&pictures).map_err(|e| e.to_string())?;
            for (index, picture) in room.capture(camera, &options).0.iter().enumerate() {
                picture.save(pictures.join(format!("{index:02}.png"))).map_err(|e| e.to_string())?;
            }
        }
        let truth = room.hand_held(camera, &options);
        let lens = Some(camera.intrinsics.clone());
        let file = CaptureFile::open("cam", &pictures, ReferenceFrame::Last, lens);
        let file = file.map_err(|e| e.to_string())?.worked_up_to(640);
        let mut capture = file.read().map_err(|e| e.to_string())?;
        let larger = capture.larger.take();
        for (name, larger) in [("working size", None), ("filmed size", larger)] {
            capture.larger = larger;
            let started = Instant::now();
            let (motion, report) =
                motion::estimate(&capture, &MotionOptions::default()).map_err(|e| e.to_string())?;
            let error = accuracy::motion(&motion.camera_from_world, &truth).ok_or("too few frames")?;
            println!(
                "{seed} {name:12} {:.4} cm {:.4}° {} frames, {} points, {} observations, rms {:.4} px, {:.1} s",
                error.position_rms_cm,
                error.rotation_rms_deg,
                error.frames,
                report.points,
                report.observations,
                report.rms_px,
                started.elapsed().as_secs_f64()
            );
        }
    }
    Ok(())
}
