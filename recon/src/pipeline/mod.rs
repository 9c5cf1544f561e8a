//! `recon build`: builds a room directory from a capture project; the directory is replaced in one step.
//!
//! Each camera's capture becomes motion, depth and a surface on its own ([`camera`]), which is cached until the capture
//! changes ([`cache`]); then one room is assembled, written beside its target with its previews and a report, and only
//! then takes the target's name.

mod cache;
mod camera;
mod export;
mod lock;
mod markings;
mod options;
mod output;
mod posed_capture;
mod preview;
mod proposed;
mod reference_view;
mod report;
mod workplace;

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use calib::Intrinsics;
use image::RgbImage;
use nalgebra::Point2;
use rayon::prelude::*;
use scenes::geometry::Disc;

use crate::assemble::{self, Captures};
use crate::capture::{Capture, CaptureFile};
use crate::memory::MemoryBound;
use crate::merge::CaptureMotion;
use crate::plumb;
use crate::project::{Project, ProjectCamera, scale_place};
use crate::scale;
use crate::scale::board::Square;
use crate::surface::Surface;
use crate::verdict::Light;
use crate::working_size::WorkingSize;
use crate::{Error, Result};
use cache::{Keys, StageCache};
use camera::{CameraResult, ProcessedCapture};
pub use export::{ExportReport, export};
pub use lock::lock_room;
pub use options::BuildOptions;
pub use reference_view::{ReferenceView, reference_views};
pub use report::{BuildReport, CameraReport, CameraSeconds, Seconds, StartErrors};

/// Progress of a build, for a progress bar.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BuildStep {
    /// Number of this step, from 0; the last report has `number == of`.
    pub number: usize,
    /// Number of steps in all.
    pub of: usize,
    /// Activity, in words.
    pub what: String,
}

/// Number of steps a camera, and of steps for the whole room.
const STEPS_A_CAMERA: usize = 3;
const STEPS_A_ROOM: usize = 2;

/// Builds the room of `project_file` into the directory `out`. Where the project has no points, it proposes them to itself.
///
/// # Errors
/// The first problem, with its place. `out` is then as it was before; finished cameras are cached beside it for the
/// next time. A room whose verdict is red is no error: it is written beside `out`, which stays as it was, too.
pub fn build(
    project_file: &Path,
    out: &Path,
    options: &BuildOptions,
    progress: &mut (dyn FnMut(&BuildStep) + Send),
) -> Result<BuildReport> {
    options.check()?;
    let mut project = Project::read_to_build(project_file)?;
    let from_file = options.zones.as_deref().map(scenes::room::read_markings).transpose()?;
    let before = output::check_target(out)?;
    let of = project.cameras.len() * STEPS_A_CAMERA + STEPS_A_ROOM;
    let mut number = 0;
    let mut step = |what: String| {
        progress(&BuildStep { number, of, what });
        number += 1;
    };

    let files = files_of(&project.cameras, options.memory)?;
    let sizes: Vec<WorkingSize> = files.iter().map(CaptureFile::size).collect();
    project.check_pixels(&sizes.iter().map(|size| size.filmed).collect::<Vec<_>>())?;
    for (index, size) in sizes.iter().enumerate() {
        project.move_pixels(index, &|pixel| size.worked_pixel(pixel));
    }

    let cache = StageCache::beside(out);
    let mut report = BuildReport { options: options.clone(), ..BuildReport::default() };
    let (mut measured, mut edges) = (Vec::with_capacity(files.len()), Vec::with_capacity(files.len()));
    let picks = |index: usize, capture: &Capture, processed: &ProcessedCapture| {
        let at_once = processed.at_once(capture.reference);
        let pixels: Vec<Point2<f64>> = project.pixels_of(index).iter().map(at_once).collect();
        let measured = camera::measure(capture, processed, &pixels);
        let edges = plumb::edges::of_capture(&capture.frames, &processed.lens, &processed.camera_from_world);
        let squares: Vec<_> = project
            .boards_of(index)
            .map(|(length, board)| (length, scale::board::square(&processed.filmed(capture), board)))
            .collect();
        (capture.reference, measured, edges, squares)
    };
    let done = process_all(&files, Some(&cache), options, &mut step, &picks)?;
    let (mut cameras, mut squares) = (Vec::with_capacity(done.len()), vec![None; project.lengths.len()]);
    let mut figures = Vec::with_capacity(done.len());
    let mut reference_frames = Vec::with_capacity(done.len());
    for (index, (camera, keys, (reference, depths, lines, boards))) in done.into_iter().enumerate() {
        reference_frames.push(reference);
        report.cameras.push(camera.processed.report.clone());
        report.seconds.cameras.push(camera.processed.seconds);
        figures.push(camera.processed.report.figures(&camera.processed.lens));
        project.move_pixels(index, &camera.processed.at_once(reference));
        measured.push(depths);
        take_squares(&mut squares, &project, &camera.name, boards)?;
        edges.push(lines);
        cameras.push((camera, keys));
    }
    step("the room: cameras, floor, metres".into());
    let start = Instant::now();
    let surfaces: Vec<Surface> = cameras.iter().map(|(c, _)| c.processed.surface.clone()).collect();
    let key_frame_discs: Vec<&[Disc]> =
        cameras.iter().map(|(c, _)| c.processed.key_frame_discs.as_slice()).collect();
    let lenses: Vec<Intrinsics> = cameras.iter().map(|(c, _)| c.processed.lens.clone()).collect();
    let is_unpicked = project.points.is_empty() && surfaces.len() > 1;
    if is_unpicked {
        report.proposed_points = proposed::take(&mut project, &surfaces, &lenses, options.seed)?;
    }
    let motions: Vec<CaptureMotion<'_>> =
        cameras.iter().zip(&reference_frames).map(|((c, _), frame)| c.processed.motion(*frame)).collect();
    let captures = Captures {
        motions: &motions,
        surfaces: &surfaces,
        key_frame_discs: &key_frame_discs,
        lenses: &lenses,
        measured: &measured,
        edges: &edges,
        squares: &squares,
    };
    let (mut room, assembled) = assemble::assemble(&project, &captures, &options.assemble)?;
    report.assembled(&project, &figures, &assembled, start.elapsed());
    for (entry, size) in room.cameras.iter_mut().zip(&sizes) {
        entry.camera.intrinsics = size.filmed_lens(&entry.camera.intrinsics);
    }
    let is_surveyed = !project.control_points.is_empty();
    if let Some(note) = markings::take_over(&mut room, before, from_file, is_surveyed) {
        report.verdict.note(note);
    }

    step("writing the room and its previews".into());
    let start = Instant::now();
    let references: Vec<(&str, &RgbImage)> =
        cameras.iter().map(|(c, _)| (c.name.as_str(), &c.reference)).collect();
    // The old room stays where the new one is not to be believed, and so do the results kept for the next build.
    let is_red = report.verdict.light == Light::Red;
    report.room = if is_red { output::aside(out) } else { out.to_owned() };
    output::write(&report.room.clone(), &mut room, &references, &mut |dir, room| {
        preview::write(dir, room, &references, options.small_pictures, &report.verdict)?;
        for ((camera, keys), room_from_camera) in
            cameras.iter().zip(&assembled.world_from_camera).filter(|_| !is_red)
        {
            cache.hand_over(dir, &camera.name, keys);
            cache.keep_posed(dir, &camera.name, keys, room_from_camera);
        }
        report.seconds.writing = start.elapsed().as_secs_f64();
        report.write(dir)
    })?;
    if !is_red {
        cache.done(cameras.iter().map(|(c, _)| c.name.as_str()));
    }
    step("done".into());
    Ok(report)
}

/// Notes the sides of the boards that one camera's capture shows, each at its length's index.
fn take_squares(
    squares: &mut [Option<Square>],
    project: &Project,
    camera: &str,
    boards: Vec<(usize, std::result::Result<Square, String>)>,
) -> Result<()> {
    for (length, board) in boards {
        let place = scale_place(length + 1, project.lengths.len());
        let board =
            board.map_err(|problem| Error::content(&project.path, format!("{place}, board"), problem))?;
        tracing::info!("{camera}: the board that gives the metres is seen whole in {board}");
        squares[length] = Some(board);
    }
    Ok(())
}

/// Captures of a project's cameras, all checked before the first is processed.
fn files_of(cameras: &[ProjectCamera], memory: MemoryBound) -> Result<Vec<CaptureFile>> {
    let open = |camera: &ProjectCamera| {
        CaptureFile::open(&camera.name, &camera.capture, camera.reference.clone(), camera.intrinsics.clone())
    };
    let opened: Vec<Result<CaptureFile>> = cameras.par_iter().map(open).collect();
    // The first error in file order is reported, not the first one found.
    opened.into_iter().map(|file| Ok(file?.within(memory))).collect()
}

/// Processes each capture to motion, depth and a surface, or takes them from the cache; returns them with their cache
/// keys. As many captures as the bound on memory leaves are processed in parallel, and their frames are freed one after the
/// other: before that, `each` is called with the rectified capture.
///
/// # Errors
/// The error of the first capture that fails; results of others are cached.
fn process_all<T: Send>(
    files: &[CaptureFile],
    cache: Option<&StageCache>,
    options: &BuildOptions,
    step: &mut (dyn FnMut(String) + Send),
    each: &(dyn Fn(usize, &Capture, &ProcessedCapture) -> T + Sync),
) -> Result<Vec<(CameraResult, Keys, T)>> {
    let step = Mutex::new(step);
    let step = |what: String| {
        // A progress bar that panicked is ignored.
        if let Ok(mut step) = step.lock() {
            step(what);
        }
    };
    let first_failed = AtomicUsize::new(usize::MAX);
    let work = |(index, file): (usize, &CaptureFile)| {
        // After a failure, captures that come later in the file are skipped, so that the error is reported soon.
        if first_failed.load(Ordering::Relaxed) < index {
            return None;
        }
        let done =
            process(file, cache, options, &step, &|capture, processed| each(index, capture, processed));
        if done.is_err() {
            first_failed.fetch_min(index, Ordering::Relaxed);
        }
        Some(done)
    };
    let needs: Vec<u64> = files.iter().map(CaptureFile::memory).collect();
    let mut done = Vec::with_capacity(files.len());
    while done.len() < files.len() {
        let (from, at_a_time) = (done.len(), options.memory.at_a_time(&needs[done.len()..]));
        let next = files.par_iter().enumerate().skip(from).take(at_a_time);
        done.extend(next.with_max_len(1).map(work).collect::<Vec<_>>());
    }
    done.into_iter().flatten().collect()
}

/// Results of one capture, computed now or cached.
fn process<T>(
    file: &CaptureFile,
    cache: Option<&StageCache>,
    options: &BuildOptions,
    step: &dyn Fn(String),
    each: &dyn Fn(&Capture, &ProcessedCapture) -> T,
) -> Result<(CameraResult, Keys, T)> {
    step(reading(file));
    let mut capture = file.read()?;
    let name = capture.name.clone();
    let keys = Keys::of(&capture, options);
    let size = file.size();
    let reference = capture.reference_picture().clone();
    let before = cache.and_then(|cache| cache.surface(&name, &keys));
    let processed = if let Some(processed) = before {
        step(format!("{name}: camera motion kept from before"));
        step(format!("{name}: depth kept from before"));
        camera::rectify_all(&mut capture, &processed.lens, processed.shutter());
        processed
    } else {
        let motion = if let Some(motion) = cache.and_then(|cache| cache.motion(&name, &keys)) {
            step(format!("{name}: camera motion kept from before"));
            motion
        } else {
            let mut motion = camera::estimate_motion(&capture, options, step)?;
            motion.report = motion.report.in_filmed_pixels(size.enlargement());
            if let Some(cache) = cache {
                cache.store_motion(&name, &keys, &motion);
            }
            motion
        };
        camera::rectify_all(&mut capture, &motion.lens, motion.shutter());
        let processed = camera::reconstruct(&capture, motion, options, step)?;
        if let Some(cache) = cache {
            cache.store_surface(&name, &keys, &processed);
        }
        processed
    };
    for doubt in &processed.report.doubts {
        tracing::warn!("camera `{name}`: {doubt}");
    }
    let told = each(&capture, &processed);
    Ok((CameraResult { name, size, reference, processed }, keys, told))
}

/// Progress text of reading a capture.
fn reading(file: &CaptureFile) -> String {
    let name = file.name();
    let of = match file.stride() {
        1 => String::new(),
        stride => format!(", one in {stride} of its {} frames", file.count()),
    };
    let size = file.size();
    let at =
        if size.is_same() { String::new() } else { format!(", at {} × {}", size.worked.0, size.worked.1) };
    format!("{name}: reading the capture{of}{at}")
}
