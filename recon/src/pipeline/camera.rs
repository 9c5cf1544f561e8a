//! One camera's part of a build: from its capture to motion, depth and a surface.

use std::time::Instant;

use calib::Intrinsics;
use image::RgbImage;
use nalgebra::{Isometry3, Point2, Point3};
use scenes::geometry::{Disc, vector_from_vec3};
use serde::{Deserialize, Serialize};

use super::report::CameraSeconds;
use super::{BuildOptions, CameraReport};
use crate::capture::Capture;
use crate::dense::{self, DenseOptions, PosedCapture};
use crate::fusion::key_frames;
use crate::merge::CaptureMotion;
use crate::motion::{self, MotionOptions, SparsePoint};
use crate::planes::{self, Completed, PlaneOptions};
use crate::ray_depth::{self, Asked, MeasuredPixel, PosedFilm};
use crate::rolling_shutter::RollingShutter;
use crate::surface::Surface;
use crate::working_size::WorkingSize;
use crate::{Error, Result};

/// A camera with known motion.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct CameraMotion {
    /// Intrinsics as filmed, at the working size.
    pub(super) lens: Intrinsics,
    /// Pose of each frame; world = the reference frame's camera.
    pub(super) camera_from_world: Vec<Option<Isometry3<f64>>>,
    /// Sparse points.
    pub(super) points: Vec<Point3<f64>>,
    /// Frame and rectified pixel of each point's observations.
    pub(super) observations: Vec<Vec<(usize, Point2<f64>)>>,
    /// Report so far.
    pub(super) report: CameraReport,
    pub(super) seconds: CameraSeconds,
}

/// A camera whose capture is fully processed.
#[derive(Debug, Clone)]
pub(super) struct ProcessedCapture {
    /// Intrinsics as filmed.
    pub(super) lens: Intrinsics,
    pub(super) surface: Surface,
    /// Discs that only the capture's key frames saw, in the reference camera's frame and the capture's unit.
    pub(super) key_frame_discs: Vec<Disc>,
    /// Pose of each frame; world = the reference frame's camera.
    pub(super) camera_from_world: Vec<Option<Isometry3<f64>>>,
    /// Sparse points.
    pub(super) points: Vec<SparsePoint>,
    /// Smallest and largest depth of the view.
    pub(super) range: (f64, f64),
    pub(super) report: CameraReport,
    pub(super) seconds: CameraSeconds,
}

/// A camera's reference image and the results of its capture.
pub(super) struct CameraResult {
    pub(super) name: String,
    pub(super) size: WorkingSize,
    /// The reference image as filmed.
    pub(super) reference: RgbImage,
    pub(super) processed: ProcessedCapture,
}

/// Estimates the motion of a capture's camera; `step` is called with the present activity.
pub(super) fn estimate_motion(
    capture: &Capture,
    options: &BuildOptions,
    step: &dyn Fn(String),
) -> Result<CameraMotion> {
    let name = &capture.name;
    step(format!("{name}: camera motion"));
    let start = Instant::now();
    let motion_options = MotionOptions { seed: options.seed, ..options.motion.clone() };
    let (motion, told) = motion::estimate(capture, &motion_options)?;
    if told.readout != 0.0 {
        tracing::info!(
            "{name}: its rows are read one after the other, over {:.2} of the time between frames",
            told.readout
        );
    }
    let report = CameraReport::of_motion(capture, &motion.intrinsics, &told);
    let (points, observations) = motion.points.into_iter().map(|p| (p.position, p.observations)).unzip();
    Ok(CameraMotion {
        lens: motion.intrinsics,
        camera_from_world: motion.camera_from_world,
        points,
        observations,
        report,
        seconds: CameraSeconds { motion: start.elapsed().as_secs_f64(), dense: 0.0 },
    })
}

/// Computes depth and surface of a capture with known motion and rectified frames; `step` is called with the present
/// activity.
pub(super) fn reconstruct(
    capture: &Capture,
    motion: CameraMotion,
    options: &BuildOptions,
    step: &dyn Fn(String),
) -> Result<ProcessedCapture> {
    let name = &capture.name;
    step(format!("{name}: depth"));
    let start = Instant::now();
    let CameraMotion { lens, camera_from_world, points, observations, report, seconds } = motion;
    let posed = PosedCapture {
        name,
        frames: &capture.frames,
        reference: capture.reference,
        intrinsics: &lens,
        camera_from_world: &camera_from_world,
        points: &points,
    };
    let dense_options = DenseOptions { seed: options.seed, ..options.dense.clone() };
    let (views, dense_report) = dense::reconstruct(&posed, &dense_options)?;
    let plane_options = PlaneOptions { seed: options.seed, ..options.planes.clone() };
    let completed = planes::complete(&views, &plane_options)
        .ok_or_else(|| Error::capture(name, "no view was reconstructed"))?;
    let key_frame_discs = if options.dense.fuse_key_frames {
        key_frames::discs(&views, &completed, &plane_options, &options.assemble.fusion)
    } else {
        Vec::new()
    };
    let Completed { surface, report: plane_report, .. } = completed;
    tracing::info!("{name}: {plane_report:?}, {} discs seen by key frames alone", key_frame_discs.len());
    let report = report.with_depth(capture.sampled, &dense_report, &surface);
    let range = depth_range(&points);
    let seconds = CameraSeconds { dense: start.elapsed().as_secs_f64(), ..seconds };
    let points = sparse_points(points, observations);
    Ok(ProcessedCapture { lens, surface, key_frame_discs, camera_from_world, points, range, report, seconds })
}

/// Points with their observations.
pub(super) fn sparse_points(
    points: Vec<Point3<f64>>,
    observations: Vec<Vec<(usize, Point2<f64>)>>,
) -> Vec<SparsePoint> {
    points
        .into_iter()
        .zip(observations)
        .map(|(position, observations)| SparsePoint { position, observations })
        .collect()
}

impl CameraMotion {
    /// Rolling-shutter model of the capture; `None` for a global shutter.
    pub(super) fn shutter(&self) -> Option<RollingShutter> {
        shutter(&self.report, &self.camera_from_world, &self.lens)
    }
}

impl ProcessedCapture {
    /// Motion of the capture whose reference frame is `reference`.
    pub(super) fn motion(&self, reference: usize) -> CaptureMotion<'_> {
        let Self { lens, camera_from_world, points, .. } = self;
        CaptureMotion { lens, reference, camera_from_world, points }
    }

    /// Rectified positions of filmed pixels of a frame.
    pub(super) fn at_once(&self, frame: usize) -> impl Fn(&Point2<f64>) -> Point2<f64> {
        let shutter = self.shutter();
        move |pixel| {
            let rectified = shutter.as_ref().and_then(|s| s.rectified(&self.lens, frame, pixel));
            rectified.unwrap_or(*pixel)
        }
    }

    /// Rolling-shutter model of the capture; `None` for a global shutter.
    pub(super) fn shutter(&self) -> Option<RollingShutter> {
        shutter(&self.report, &self.camera_from_world, &self.lens)
    }

    /// Capture with its motion, its frames rectified.
    pub(super) fn filmed<'a>(&'a self, capture: &'a Capture) -> PosedFilm<'a> {
        PosedFilm {
            frames: &capture.frames,
            reference: capture.reference,
            intrinsics: &self.lens,
            camera_from_world: &self.camera_from_world,
        }
    }
}

fn shutter(
    report: &CameraReport,
    camera_from_world: &[Option<Isometry3<f64>>],
    lens: &Intrinsics,
) -> Option<RollingShutter> {
    let readout = report.readout;
    (readout != 0.0).then(|| RollingShutter::new(readout, camera_from_world, lens.height))
}

/// Rectifies all frames of a capture; does nothing without a shutter model.
pub(super) fn rectify_all(capture: &mut Capture, lens: &Intrinsics, shutter: Option<RollingShutter>) {
    let Some(shutter) = shutter else { return };
    for (index, frame) in capture.frames.iter_mut().enumerate() {
        *frame = shutter.frame(lens, index, frame);
    }
}

/// Range of the points' depths from the reference camera, with a margin on both sides.
fn depth_range(points: &[Point3<f64>]) -> (f64, f64) {
    let mut depths: Vec<f64> = points.iter().map(|p| p.z).filter(|z| *z > 0.0).collect();
    depths.sort_by(f64::total_cmp);
    let (few, count) = (depths.len() / 50, depths.len());
    match depths.get(few).zip(depths.get((count - few).saturating_sub(1))) {
        Some((near, far)) => (near / 1.5, far * 1.5),
        None => (0.0, 0.0),
    }
}

/// Measures the depth of single pixels of the reference image from all frames; pixels without one are left out.
pub(super) fn measure(
    capture: &Capture,
    processed: &ProcessedCapture,
    pixels: &[Point2<f64>],
) -> Vec<MeasuredPixel> {
    let film = processed.filmed(capture);
    let surface = &processed.surface;
    let normal = |pixel: &Point2<f64>| {
        surface.normal_at(&crate::merge::pinhole_pixel(&processed.lens, pixel)?).map(vector_from_vec3)
    };
    let asked: Vec<Asked> = pixels.iter().map(|p| Asked { pixel: *p, normal: normal(p) }).collect();
    let depths = ray_depth::measure(&film, &asked, processed.range);
    let known = |(pixel, measured): (&Point2<f64>, Option<_>)| {
        Some(MeasuredPixel { pixel: *pixel, measured: measured? })
    };
    pixels.iter().zip(depths).filter_map(known).collect()
}
