//! `recon build`: a capture project → a room directory, whole or not at all.
//!
//! Each camera's capture becomes motion, depth and a surface on its own ([`camera`]), which is kept until the capture
//! changes ([`kept`]); then one room is assembled, written beside its target with its previews and a report, and only
//! then takes the target's name.

mod camera;
mod kept;
mod output;
mod preview;
mod reference_view;
mod report;

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use calib::Intrinsics;
use image::RgbImage;
use rayon::prelude::*;
use scenes::room::{Room, Zone};

use crate::Result;
use crate::assemble::{self, AssembleOptions, Captures};
use crate::capture::Capture;
use crate::dense::DenseOptions;
use crate::motion::MotionOptions;
use crate::planes::PlaneOptions;
use crate::plumb;
use crate::project::{Project, ProjectCamera};
use crate::surface::Surface;
use camera::{Camera, Seen};
use kept::Kept;
pub use reference_view::{ReferenceView, reference_views};
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
    /// Draws plan and previews at half their usual size, in a quarter of the time.
    pub small_pictures: bool,
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
/// The first thing that is wrong, with its place. `out` is then as it was before; cameras that were finished are kept
/// beside it for the next time.
pub fn build(
    project_file: &Path,
    out: &Path,
    options: &BuildOptions,
    progress: &mut (dyn FnMut(&Step) + Send),
) -> Result<BuildReport> {
    let mut project = Project::read(project_file)?;
    let zones = options.zones.as_deref().map(scenes::room::read_zones).transpose()?;
    let before = output::check_target(out)?;
    let of = project.cameras.len() * STEPS_A_CAMERA + STEPS_A_ROOM;
    let mut number = 0;
    let mut step = |what: String| {
        progress(&Step { number, of, what });
        number += 1;
    };

    let captures = captures_of(&project.cameras, &mut step)?;
    let sizes: Vec<(u32, u32)> = captures.iter().map(|c| c.frames[c.reference].dimensions()).collect();
    project.check_pixels(&sizes)?;

    let kept = Kept::beside(out);
    let mut report = BuildReport::default();
    let (mut measured, mut edges) = (Vec::with_capacity(captures.len()), Vec::with_capacity(captures.len()));
    let cameras = worked_through(captures, Some(&kept), options, &mut step, &mut |index, capture, seen| {
        report.cameras.push(seen.report.clone());
        if let Some(shutter) = seen.shutter() {
            let at_once = |pixel: &_| shutter.rectified(&seen.lens, capture.reference, pixel);
            project.move_pixels(index, &|pixel| at_once(pixel).unwrap_or(*pixel));
        }
        measured.push(camera::measure(capture, seen, &project.pixels_of(index)));
        edges.push(plumb::edges::of_capture(&capture.frames, &seen.lens, &seen.camera_from_world));
        tracing::debug!("{}: depths at picks {:?}", capture.name, measured.last());
    })?;
    step("the room: cameras, floor, metres".into());
    let start = Instant::now();
    let surfaces: Vec<Surface> = cameras.iter().map(|(c, _)| c.seen.surface.clone()).collect();
    let lenses: Vec<Intrinsics> = cameras.iter().map(|(c, _)| c.seen.lens.clone()).collect();
    let captures = Captures { surfaces: &surfaces, lenses: &lenses, measured: &measured, edges: &edges };
    let (mut room, assembled) = assemble::assemble(&project, &captures, &options.assemble)?;
    report.assembled(&project, &assembled, start.elapsed());
    take_over(&mut room, before, zones);

    step("writing the room and its previews".into());
    let start = Instant::now();
    let references: Vec<(&str, &RgbImage)> =
        cameras.iter().map(|(c, _)| (c.name.as_str(), &c.reference)).collect();
    output::write(out, &mut room, &references, &mut |dir, room| {
        preview::write(dir, room, &references, options.small_pictures)?;
        for (camera, key) in &cameras {
            Kept::keep_in(dir, &camera.name, key, &camera.seen);
        }
        report.seconds.writing = start.elapsed().as_secs_f64();
        report.write(dir)
    })?;
    kept.done(cameras.iter().map(|(c, _)| c.name.as_str()));
    step("done".into());
    Ok(report)
}

/// The captures of a project's cameras.
fn captures_of(cameras: &[ProjectCamera], step: &mut dyn FnMut(String)) -> Result<Vec<Capture>> {
    let load = |camera: &ProjectCamera| {
        step(format!("{}: reading the capture", camera.name));
        Capture::load(&camera.name, &camera.capture, camera.reference, camera.intrinsics.clone())
    };
    cameras.iter().map(load).collect()
}

/// Each capture becomes motion, depth and a surface, or is found among what was kept; with the key it is kept by. Captures
/// are worked through beside each other. `each` is then told of the cameras one after the other, while their frames, as if
/// filmed at once, are still there.
///
/// # Errors
/// The first capture's that fails; what was made of others is kept.
fn worked_through(
    captures: Vec<Capture>,
    kept: Option<&Kept>,
    options: &BuildOptions,
    step: &mut (dyn FnMut(String) + Send),
    each: &mut dyn FnMut(usize, &Capture, &Seen),
) -> Result<Vec<(Camera, blake3::Hash)>> {
    let step = Mutex::new(step);
    let first_failed = AtomicUsize::new(usize::MAX);
    let work = |(index, mut capture): (usize, Capture)| {
        // Who waits to hear what is wrong with a capture need not wait for those that come after it.
        if first_failed.load(Ordering::Relaxed) < index {
            return None;
        }
        let key = kept::key(&capture, options);
        let reference = capture.frames[capture.reference].clone();
        let seen = seen(&mut capture, &key, kept, options, &step);
        if seen.is_err() {
            first_failed.fetch_min(index, Ordering::Relaxed);
        }
        Some(seen.map(|seen| {
            let name = capture.name.clone();
            (capture, Camera { name, reference, seen }, key)
        }))
    };
    let done: Vec<_> = captures.into_par_iter().enumerate().with_max_len(1).map(work).collect();
    let done: Vec<(Capture, Camera, blake3::Hash)> = done.into_iter().flatten().collect::<Result<_>>()?;
    let mut cameras = Vec::with_capacity(done.len());
    for (index, (capture, camera, key)) in done.into_iter().enumerate() {
        each(index, &capture, &camera.seen);
        cameras.push((camera, key));
    }
    Ok(cameras)
}

/// One capture, worked through now or before.
fn seen(
    capture: &mut Capture,
    key: &blake3::Hash,
    kept: Option<&Kept>,
    options: &BuildOptions,
    step: &Mutex<&mut (dyn FnMut(String) + Send)>,
) -> Result<Seen> {
    let step = |what: String| {
        // A progress bar that panicked is of no use to anybody.
        if let Ok(mut step) = step.lock() {
            step(what);
        }
    };
    if let Some(seen) = kept.and_then(|kept| kept.find(&capture.name, key)) {
        step(format!("{}: camera motion kept from before", capture.name));
        step(format!("{}: depth kept from before", capture.name));
        if let Some(shutter) = seen.shutter() {
            camera::at_once(capture, &seen.lens, &shutter);
        }
        return Ok(seen);
    }
    let seen = camera::see(capture, options, &step)?;
    if let Some(kept) = kept {
        kept.keep(&capture.name, key, &seen);
    }
    Ok(seen)
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
