//! Camera motion and sparse points from one capture.
//!
//! Tracks ([`crate::features`]) start two competing reconstructions ([`starts`]): by factorization, without any guess, and by two
//! views and growth ([`incremental`]). Both are adjusted ([`crate::bundle`]); the one with the smaller robust
//! reprojection error is kept. An unknown lens has starts from several fields of view, and its bends are free from the first
//! adjustment on. The reconstruction predicts the positions of lost features ([`revisit`]): links between frames that are
//! not neighbours, which limit the drift of long paths. Then the readout time of the frames is estimated ([`readout`]),
//! the reconstruction is polished by renewed triangulation and adjustment, refined in the filmed pictures where they are larger
//! than those that are worked on ([`filmed_size`]), and its estimate of the lens is combined
//! with prior knowledge ([`lens`]). A capture that determines no motion is refused with what to film instead.

mod ambiguity;
mod diagnosis;
mod filmed_size;
mod five_point;
mod incremental;
mod lens;
mod partial_reconstruction;
mod readout;
mod resection;
mod revisit;
mod starts;
pub(crate) mod triangulation;
mod two_views;

use calib::Intrinsics;
use nalgebra::{Isometry3, Point2, Point3};
use serde::{Deserialize, Serialize};

use crate::bundle::LensFreedom;
use crate::capture::Capture;
use crate::features::{self, FeatureOptions, FeatureReport};
use crate::{Error, Result};
pub use lens::LensOrigin;
use partial_reconstruction::{FINAL, PartialReconstruction};
use starts::Started;
pub use starts::Starts;

/// Options of motion estimation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotionOptions {
    /// Options of feature tracking.
    pub features: FeatureOptions,
    /// Seed of the random samples; a build takes that of [`crate::pipeline::BuildOptions`].
    #[serde(skip)]
    pub seed: u64,
    /// Number of rounds of adjustment and renewed triangulation at the end.
    pub polish_rounds: usize,
    /// Largest noise of a pixel coordinate with which the capture counts as a rigid scene seen by this lens.
    pub max_noise_px: f64,
    /// Least median angle between the rays to a point, degrees.
    pub min_parallax_deg: f64,
    /// Least share of the frames that must have a pose.
    pub min_registered: f64,
    /// Least share of the observations that must belong to a static scene.
    pub min_explained: f64,
    /// Whether given intrinsics (focal length, k1, k2) are refined where the capture contradicts them clearly.
    pub refine_lens: bool,
}

impl Default for MotionOptions {
    fn default() -> Self {
        Self {
            features: FeatureOptions::default(),
            seed: 1,
            polish_rounds: 2,
            max_noise_px: 1.5,
            min_parallax_deg: 1.0,
            min_registered: 0.5,
            min_explained: 0.6,
            refine_lens: false,
        }
    }
}

/// Camera poses and sparse points; scale arbitrary, world = the reference frame's camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Intrinsics of the capture, refined where they were not given.
    pub intrinsics: Intrinsics,
    /// Pose of each frame, at the instant of its middle row; `None` where the frame could not be placed. The reference
    /// frame's is the identity.
    pub camera_from_world: Vec<Option<Isometry3<f64>>>,
    /// Points observed by three frames or more.
    pub points: Vec<SparsePoint>,
}

/// A point and its observations.
#[derive(Debug, Clone, PartialEq)]
pub struct SparsePoint {
    /// Position in the world of [`Motion`].
    pub position: Point3<f64>,
    /// Frame (from 0) and pixel of the inlier observations; corrected for the rolling shutter
    /// ([`crate::rolling_shutter`]).
    pub observations: Vec<(usize, Point2<f64>)>,
}

/// Report of motion estimation.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionReport {
    /// Report of feature tracking.
    pub features: FeatureReport,
    /// Comparison of the two starts.
    pub starts: Starts,
    /// Number of frames with a pose.
    pub registered: usize,
    /// Number of points.
    pub points: usize,
    /// Number of inlier observations.
    pub observations: usize,
    /// Root mean square reprojection error of those, pixels.
    pub rms_px: f64,
    /// Median of the widest angle between the rays to a point, degrees.
    pub parallax_deg: f64,
    /// Share of the observations that belong to a static scene, in the reconstruction before lost features were
    /// searched.
    pub explained_share: f64,
    /// Time from a frame's first row to its last, as a share of the time between frames; 0 for a global shutter.
    pub readout: f64,
    /// Origin of the intrinsics.
    pub lens: LensOrigin,
    /// Relative standard deviation of the focal length, where it was estimated or refined and is determined.
    pub focal_sigma: Option<f64>,
    /// Doubts about the motion found, a sentence each, with what to do.
    pub doubts: Vec<String>,
}

/// Estimates the motion of a capture.
///
/// # Errors
/// [`Error::Capture`] when the capture does not determine a motion: too few features, too little translation, a scene
/// that is not rigid, frames that do not connect to the reference frame. The line names what to film instead.
pub fn estimate(capture: &Capture, options: &MotionOptions) -> Result<(Motion, MotionReport)> {
    let Some(first) = capture.frames.first() else {
        return Err(Error::capture(&capture.name, "the capture holds no frames"));
    };
    let lenses = capture.start_lenses(first.dimensions());
    let lens = if capture.intrinsics.is_some() { LensFreedom::Fixed } else { LensFreedom::Unknown };
    let (tracks, features) = features::track(&capture.frames, &lenses[0], &options.features)?;
    diagnosis::features(&capture.name, &features, capture.frames.len())?;

    let seen = starts::seen_by_frame(&tracks, capture.frames.len());
    let started = starts::best(&tracks, &lenses, &seen, lens, options.seed);
    let Some(Started { errors: starts, best: mut partial, other }) = started else {
        return Err(diagnosis::no_start(&capture.name));
    };
    let ambiguity = ambiguity::doubt(&partial, other.as_ref());
    let explained = partial.explained_share(agreement_px(&partial));
    revisit::revisit(&mut partial, &capture.frames, &options.features, lens);
    let readout = readout::settle(&mut partial, lens);
    partial.polish(lens, options.polish_rounds, FINAL);
    filmed_size::refine(&mut partial, capture, readout, lens, &options.features)?;
    let lens = lens::settle(&mut partial, capture.intrinsics.is_some(), options.refine_lens);
    finish(capture, options, &partial, Before { features, starts, ambiguity, explained, readout, lens })
}

/// Number of inlier points of each frame.
fn seen_points(points: &[SparsePoint], frames: usize) -> Vec<usize> {
    let mut seen = vec![0; frames];
    for (frame, _) in points.iter().flat_map(|p| &p.observations) {
        seen[*frame] += 1;
    }
    seen
}

/// Reports of earlier stages.
struct Before {
    features: FeatureReport,
    starts: Starts,
    ambiguity: Option<String>,
    explained: f64,
    readout: f64,
    lens: lens::Settled,
}

/// Largest distance of an inlier observation from its point, pixels.
fn agreement_px(partial: &PartialReconstruction<'_>) -> f64 {
    (6.0 * partial.noise_px()).max(1.0)
}

/// Checks the result, makes the reference camera the world, and leaves out outliers.
fn finish(
    capture: &Capture,
    options: &MotionOptions,
    partial: &PartialReconstruction<'_>,
    before: Before,
) -> Result<(Motion, MotionReport)> {
    let noise = partial.noise_px();
    let agree_px = agreement_px(partial);
    let Some(reference) = partial.poses[capture.reference] else {
        return Err(diagnosis::reference_missing(capture));
    };
    let reference_from_world = reference;
    let world_from_reference = reference.inverse();
    let mut camera_from_world: Vec<Option<Isometry3<f64>>> =
        partial.poses.iter().map(|pose| pose.map(|p| p * world_from_reference)).collect();
    // Set exactly, without rounding.
    camera_from_world[capture.reference] = Some(Isometry3::identity());

    let mut points = Vec::new();
    let (mut squares, mut count) = (0.0, 0_usize);
    let mut angles = Vec::new();
    for (track, point) in partial.tracks.iter().zip(&partial.points) {
        let Some(point) = point else { continue };
        let mut observations = Vec::new();
        for (frame, pixel) in &track.observations {
            match partial.error_px(*frame, point, pixel) {
                Some(error) if error <= agree_px => {
                    squares += error * error;
                    observations.push((*frame, *pixel));
                }
                _ => {}
            }
        }
        if observations.len() >= 3 {
            count += observations.len();
            let poses = observations.iter().filter_map(|(f, _)| partial.poses[*f].as_ref());
            angles.push(triangulation::widest_angle(poses, point).to_degrees());
            points.push(SparsePoint { position: reference_from_world * point, observations });
        }
    }
    let report = MotionReport {
        features: before.features,
        starts: before.starts,
        registered: partial.registered(),
        points: points.len(),
        observations: count,
        rms_px: (squares / count.max(1) as f64).sqrt(),
        parallax_deg: two_views::median(&angles).unwrap_or(0.0),
        explained_share: before.explained,
        readout: before.readout,
        lens: before.lens.origin,
        focal_sigma: before.lens.focal_sigma,
        doubts: before.ambiguity.into_iter().chain(before.lens.doubt).collect(),
    };
    diagnosis::motion(&capture.name, capture.frames.len(), noise, &report, options)?;
    diagnosis::reference(capture, &seen_points(&points, capture.frames.len()))?;
    Ok((Motion { intrinsics: partial.intrinsics.clone(), camera_from_world, points }, report))
}
