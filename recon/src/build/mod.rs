//! `recon build`: a capture project → a room directory, whole or not at all.
//!
//! Each camera's capture becomes motion, depth and a surface on its own; then one room is assembled, written beside
//! its target with its previews and a report, and only then takes the target's name.

mod output;
mod preview;
mod report;

use std::path::{Path, PathBuf};
use std::time::Instant;

use calib::Intrinsics;
use image::RgbImage;
use nalgebra::Point3;
use scenes::room::{Room, Zone};

use crate::assemble::{self, AssembleOptions};
use crate::capture::Capture;
use crate::dense::{self, DenseOptions, PosedCapture};
use crate::motion::{self, MotionOptions};
use crate::planes::{self, PlaneOptions};
use crate::project::Project;
use crate::surface::Surface;
use crate::{Error, Result};
pub use report::{BuildReport, CameraReport};

/// How a room is built.
#[derive(Debug, Clone, Default)]
pub struct BuildOptions {
    /// Zones for the new room; without them those of the room that is replaced are kept, if there is one.
    pub zones: Option<PathBuf>,
    /// Seed of everything random; the room is the same for the same seed, whatever the number of threads.
    pub seed: u64,
    /// Camera motion.
    pub motion: MotionOptions,
    /// Dense stereo.
    pub dense: DenseOptions,
    /// Planes found and filled.
    pub planes: PlaneOptions,
    /// Joining cameras, floor, discs.
    pub assemble: AssembleOptions,
}

/// What is being done, for a progress bar.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Step {
    /// Number of this step, from 0; the last report has `number == of`.
    pub number: usize,
    /// Steps in all.
    pub of: usize,
    /// For people.
    pub what: String,
}

/// Steps a camera, and steps for the whole room.
const STEPS_A_CAMERA: usize = 3;
const STEPS_A_ROOM: usize = 2;

/// Builds the room of `project_file` into the directory `out`.
///
/// # Errors
/// The first thing that is wrong, with its place. `out` is then as it was before.
pub fn build(
    project_file: &Path,
    out: &Path,
    options: &BuildOptions,
    progress: &mut dyn FnMut(&Step),
) -> Result<BuildReport> {
    let project = Project::read(project_file)?;
    let zones = options.zones.as_deref().map(scenes::room::read_zones).transpose()?;
    let before = output::check_target(out)?;
    let of = project.cameras.len() * STEPS_A_CAMERA + STEPS_A_ROOM;
    let mut number = 0;
    let mut step = |what: String| {
        progress(&Step { number, of, what });
        number += 1;
    };

    let mut cameras = Vec::with_capacity(project.cameras.len());
    for camera in &project.cameras {
        step(format!("{}: reading the capture", camera.name));
        cameras.push(Capture::load(
            &camera.name,
            &camera.capture,
            camera.reference,
            camera.intrinsics.clone(),
        )?);
    }
    let sizes: Vec<(u32, u32)> = cameras.iter().map(|c| c.frames[c.reference].dimensions()).collect();
    project.check_pixels(&sizes)?;

    let mut seen = Vec::with_capacity(cameras.len());
    let mut report = BuildReport::default();
    for capture in cameras {
        let (camera, camera_report) = see(capture, options, &mut step)?;
        report.cameras.push(camera_report);
        seen.push(camera);
    }
    step("the room: cameras, floor, metres".into());
    let start = Instant::now();
    let surfaces: Vec<Surface> = seen.iter().map(|s| s.surface.clone()).collect();
    let lenses: Vec<Intrinsics> = seen.iter().map(|s| s.lens.clone()).collect();
    let (mut room, assembled) = assemble::assemble(&project, &surfaces, &lenses, &options.assemble)?;
    report.assembled(&project, &assembled, start.elapsed());
    take_over(&mut room, before, zones);

    step("writing the room and its previews".into());
    let start = Instant::now();
    let references: Vec<(&str, &RgbImage)> = seen.iter().map(|s| (s.name.as_str(), &s.reference)).collect();
    output::write(out, &mut room, &references, &mut |dir, room| {
        preview::write(dir, room, &references)?;
        report.seconds.writing = start.elapsed().as_secs_f64();
        report.write(dir)
    })?;
    step("done".into());
    Ok(report)
}

/// A camera once its capture has been worked through.
struct Seen {
    name: String,
    /// The reference image as filmed.
    reference: RgbImage,
    lens: Intrinsics,
    surface: Surface,
}

fn see(
    mut capture: Capture,
    options: &BuildOptions,
    step: &mut dyn FnMut(String),
) -> Result<(Seen, CameraReport)> {
    let name = capture.name.clone();
    step(format!("{name}: camera motion"));
    let start = Instant::now();
    let motion_options = MotionOptions { seed: options.seed, ..options.motion.clone() };
    let (motion, motion_report) = motion::estimate(&capture, &motion_options)?;
    let motion_time = start.elapsed();

    step(format!("{name}: depth"));
    let start = Instant::now();
    let points: Vec<Point3<f64>> = motion.points.iter().map(|p| p.position).collect();
    let posed = PosedCapture {
        name: &name,
        frames: &capture.frames,
        reference: capture.reference,
        intrinsics: &motion.intrinsics,
        camera_from_world: &motion.camera_from_world,
        points: &points,
    };
    let dense_options = DenseOptions { seed: options.seed, ..options.dense.clone() };
    let (views, dense_report) = dense::reconstruct(&posed, &dense_options)?;
    let plane_options = PlaneOptions { seed: options.seed, ..options.planes.clone() };
    let (surface, plane_report) = planes::complete(&views, &plane_options)
        .ok_or_else(|| Error::capture(&name, "no view was reconstructed"))?;
    tracing::info!("{name}: {plane_report:?}");
    let report =
        CameraReport::new(&capture, &motion_report, &dense_report, &surface, (motion_time, start.elapsed()));
    let reference = capture.frames.swap_remove(capture.reference);
    Ok((Seen { name, reference, lens: motion.intrinsics, surface }, report))
}

/// What people have drawn into a room outlives its rebuilding: its coordinates stay.
fn take_over(room: &mut Room, before: Option<Room>, zones: Option<Vec<Zone>>) {
    if let Some(before) = before {
        room.walkable = before.walkable;
        room.zones = before.zones;
    }
    if let Some(zones) = zones {
        room.zones = zones;
    }
}
