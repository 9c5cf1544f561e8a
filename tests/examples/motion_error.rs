//! Prints the error of `recon`'s camera motion against the true poses: office and, where at hand, hololens.
//!
//! `cargo run --release -p tests --example motion_error [SET/CAMERA…] [--seed N]`

use std::path::PathBuf;
use std::time::Instant;

use recon::capture::{Capture, ReferenceFrame};
use recon::motion::{self, MotionOptions};
use tests::accuracy;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mut options = MotionOptions::default();
    if let Some(at) = arguments.iter().position(|a| a == "--seed") {
        options.seed = arguments.get(at + 1).and_then(|s| s.parse().ok()).unwrap_or(options.seed);
    }
    let without_lens = arguments.iter().any(|a| a == "--no-intrinsics");
    for (set, camera, intrinsics) in [
        ("office", "cam0", "cam0.toml"),
        ("office", "cam1", "cam1.toml"),
        ("hololens", "a", "intrinsics.toml"),
        ("hololens", "b", "intrinsics.toml"),
    ] {
        let name = format!("{set}/{camera}");
        let asked: Vec<&String> = arguments.iter().filter(|a| a.contains('/')).collect();
        if !asked.is_empty() && !asked.contains(&&name) {
            continue;
        }
        let Some(folder) = tests::data::shared(set) else { continue };
        if let Err(problem) = measure(&folder, camera, intrinsics, &options, without_lens) {
            println!("{name:12} {problem}");
        }
    }
}

fn measure(
    folder: &PathBuf,
    camera: &str,
    intrinsics: &str,
    options: &MotionOptions,
    without_lens: bool,
) -> Result<(), Box<dyn std::error::Error>> {
    let lens = calib::files::read_intrinsics(&folder.join(intrinsics))?;
    let capture = Capture::load(
        camera,
        &folder.join("capture").join(camera),
        ReferenceFrame::Last,
        (!without_lens).then_some(lens),
    )?;
    let started = Instant::now();
    let (motion, report) = motion::estimate(&capture, options)?;
    let seconds = started.elapsed().as_secs_f64();
    let truth = accuracy::capture_truth(&folder.join("truth.json"), camera).ok_or("no truth")?;
    let error = accuracy::motion(&motion.camera_from_world, &truth).ok_or("too few frames")?;
    println!(
        "{camera:5} {:6.3} cm {:6.3}° {:2}/{} frames, {} points, {} observations, rms {:.3} px, parallax {:.1}°, f {:.1}, {seconds:.1} s; starts: factorization {:.4}, two views {:.4} px",
        error.position_rms_cm,
        error.rotation_rms_deg,
        error.frames,
        capture.frames.len(),
        report.points,
        report.observations,
        report.rms_px,
        report.parallax_deg,
        motion.intrinsics.fx,
        report.starts.factorization_px,
        report.starts.two_views_px,
    );
    Ok(())
}
