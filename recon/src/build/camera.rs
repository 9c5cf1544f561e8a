//! One camera's part of a build: its capture becomes motion, depth and a surface.

use std::time::Instant;

use calib::Intrinsics;
use image::RgbImage;
use nalgebra::Point3;

use super::{BuildOptions, CameraReport};
use crate::capture::Capture;
use crate::dense::{self, DenseOptions, PosedCapture};
use crate::motion::{self, MotionOptions};
use crate::planes::{self, PlaneOptions};
use crate::surface::Surface;
use crate::{Error, Result};

/// A camera once its capture has been worked through.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    /// As filmed.
    pub(super) lens: Intrinsics,
    pub(super) surface: Surface,
    pub(super) report: CameraReport,
}

/// A camera's reference image and what was made of its capture.
pub(super) struct Camera {
    pub(super) name: String,
    /// The reference image as filmed.
    pub(super) reference: RgbImage,
    pub(super) seen: Seen,
}

/// Works through a capture; `step` is told what is being done.
pub(super) fn see(capture: &Capture, options: &BuildOptions, step: &mut dyn FnMut(String)) -> Result<Seen> {
    let name = &capture.name;
    step(format!("{name}: camera motion"));
    let start = Instant::now();
    let motion_options = MotionOptions { seed: options.seed, ..options.motion.clone() };
    let (motion, motion_report) = motion::estimate(capture, &motion_options)?;
    let motion_time = start.elapsed();

    step(format!("{name}: depth"));
    let start = Instant::now();
    let points: Vec<Point3<f64>> = motion.points.iter().map(|p| p.position).collect();
    let posed = PosedCapture {
        name,
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
        .ok_or_else(|| Error::capture(name, "no view was reconstructed"))?;
    tracing::info!("{name}: {plane_report:?}");
    let times = (motion_time, start.elapsed());
    let report = CameraReport::new(capture, &motion_report, &dense_report, &surface, times);
    Ok(Seen { lens: motion.intrinsics, surface, report })
}
