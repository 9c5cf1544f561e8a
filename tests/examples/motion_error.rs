//! Prints the error of `recon`'s camera motion against the true poses: office and, where available, hololens.
//!
//! `cargo run --release -p tests --example motion_error [SET/CAMERA…] [--seed N | --seeds COUNT] [--no-intrinsics | --refine]
//! [--lens barrel|fisheye]`
//!
//! With `--seeds`, the worst of that many is printed too; with `--lens`, the pictures are bent as such a lens would have filmed them.

use std::path::Path;
use std::time::Instant;

use recon::capture::{Capture, ReferenceFrame};
use recon::motion::{self, MotionOptions};
use tests::accuracy::{self, MotionError};
use tests::filmed_lens::{self, FilmedLens};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |name: &str| -> Option<u64> {
        arguments.iter().position(|a| a == name).and_then(|at| arguments.get(at + 1)?.parse().ok())
    };
    let first = number("--seed").unwrap_or(MotionOptions::default().seed);
    let seeds = first..first + number("--seeds").unwrap_or(1);
    let without_lens = arguments.iter().any(|a| a == "--no-intrinsics");
    let bent = arguments.iter().position(|a| a == "--lens").and_then(|at| arguments.get(at + 1));
    let bent = bent.map(|name| (name, filmed_lens::distortion(name)));
    if let Some((name, None)) = bent {
        return println!("--lens {name}: it is pinhole, barrel or fisheye");
    }
    let bent = bent.and_then(|(_, distortion)| distortion);
    let refine_lens = arguments.iter().any(|a| a == "--refine");
    let asked: Vec<&String> = arguments.iter().filter(|a| a.contains('/')).collect();
    // "shipped" is the office as compact video, beside this crate.
    for (set, camera, intrinsics) in [
        ("shipped", "cam0", "cam0.toml"),
        ("shipped", "cam1", "cam1.toml"),
        ("office", "cam0", "cam0.toml"),
        ("office", "cam1", "cam1.toml"),
        ("hololens", "a", "intrinsics.toml"),
        ("hololens", "b", "intrinsics.toml"),
    ] {
        let name = format!("{set}/{camera}");
        if !asked.is_empty() && !asked.contains(&&name) {
            continue;
        }
        let folder = if set == "shipped" { Some(tests::data::office()) } else { tests::data::shared(set) };
        let Some(folder) = folder else { continue };
        let mut worst = (0.0_f64, 0.0_f64);
        for seed in seeds.clone() {
            print!("{name:13} ");
            let options = MotionOptions { seed, refine_lens, ..MotionOptions::default() };
            match measure(&folder, camera, intrinsics, &options, (without_lens, bent)) {
                Ok(error) => {
                    worst = (worst.0.max(error.position_rms_cm), worst.1.max(error.rotation_rms_deg));
                }
                Err(problem) => {
                    println!("{problem}");
                    worst = (f64::INFINITY, f64::INFINITY);
                }
            }
        }
        if seeds.end - seeds.start > 1 {
            println!("{name:13} worst of {}: {:.3} cm {:.3}°", seeds.end - seeds.start, worst.0, worst.1);
        }
    }
}

fn measure(
    folder: &Path,
    camera: &str,
    intrinsics: &str,
    options: &MotionOptions,
    (without_lens, bent): (bool, Option<calib::Distortion>),
) -> Result<MotionError, Box<dyn std::error::Error>> {
    let mut lens = calib::files::read_intrinsics(&folder.join(intrinsics))?;
    let film = folder.join("capture").join(camera).with_extension("mp4");
    let source = if film.is_file() { film } else { folder.join("capture").join(camera) };
    let mut capture = Capture::load(camera, &source, ReferenceFrame::Last, None)?;
    if let Some(distortion) = bent {
        let filmed = FilmedLens::new(&lens, distortion);
        capture.frames = capture.frames.iter().map(|frame| filmed.picture(frame)).collect();
        lens = filmed.lens;
    }
    let true_focal = lens.fx;
    capture.intrinsics = (!without_lens).then_some(lens);
    let started = Instant::now();
    let (motion, report) = motion::estimate(&capture, options)?;
    let seconds = started.elapsed().as_secs_f64();
    let truth = accuracy::capture_truth(&folder.join("truth.json"), camera).ok_or("no truth")?;
    let error = accuracy::motion(&motion.camera_from_world, &truth).ok_or("too few frames")?;
    println!(
        "{:6.3} cm {:6.3}° {:2}/{} frames, {:.0} % stand still, {} points, {} observations, rms {:.3} px, parallax {:.1}°, f {:.1} ({:+.2} %), k {:.3?}, readout {:.2}, {seconds:.1} s; starts: factorization {:.4}, two views {:.4} px",
        error.position_rms_cm,
        error.rotation_rms_deg,
        error.frames,
        capture.frames.len(),
        100.0 * report.explained_share,
        report.points,
        report.observations,
        report.rms_px,
        report.parallax_deg,
        motion.intrinsics.fx,
        100.0 * (motion.intrinsics.fx / true_focal - 1.0),
        motion.intrinsics.distortion.leading(),
        report.readout,
        report.starts.factorization_px,
        report.starts.two_views_px,
    );
    if let Some(sigma) = report.focal_sigma {
        println!(
            "              focal length {:.2} ± {:.2} px",
            motion.intrinsics.fx,
            sigma * motion.intrinsics.fx
        );
    }
    Ok(error)
}
