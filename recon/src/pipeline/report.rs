//! `report.json`: counts, residuals and times of a build.

use std::path::{Path, PathBuf};
use std::time::Duration;

use calib::Intrinsics;
use serde::{Deserialize, Serialize};

use super::BuildOptions;
use crate::assemble::AssembleReport;
use crate::capture::{ASSUMED_FOV_DEG, Capture, Sampled};
use crate::dense::DenseReport;
use crate::motion::{LensOrigin, MotionReport, Starts};
use crate::project::Project;
use crate::surface::{DepthOrigin, Surface};
use crate::verdict::{self, CaptureFigures, RoomEvidence, Verdict};
use crate::{Error, Result};

/// Report of a build.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct BuildReport {
    /// Directory of the room: the one asked for, or one beside it where the verdict is red.
    #[serde(skip)]
    pub room: PathBuf,
    /// Whether the room is to be believed, and why.
    pub verdict: Verdict,
    /// Options that the room was built with; infinite numbers are written as `null`.
    pub options: BuildOptions,
    /// Report of each camera, in the project's order.
    pub cameras: Vec<CameraReport>,
    /// Root mean square distance between the picks and the projections of their points, pixels.
    pub pick_rms_px: f64,
    /// Outliers among the picks, a sentence each.
    pub picks_left_out: Vec<String>,
    /// Number of points that the program proposed to itself, since the project has none.
    pub proposed_points: usize,
    /// Number of features of a capture that were found in another camera's picture; in the adjustment they join the captures beside
    /// the picks.
    pub shared_features: usize,
    /// Relative standard deviation by which the adjustment of all captures changed each camera's depths beside their scale; that of
    /// the depths at the picks where captures were not adjusted; empty for one camera.
    pub depth_sigma: Vec<f64>,
    /// Root mean square distance of the floor's points from its plane, metres.
    pub floor_rms_m: f64,
    /// Floor's share of all area seen.
    pub floor_share: f64,
    /// Number of planes that support the vertical: the floor and those parallel to it …
    pub level_planes: usize,
    /// … and walls; …
    pub plumb_planes: usize,
    /// … and captures whose pictures' vertical lines support it.
    pub plumb_captures: usize,
    /// Number of discs in the room.
    pub discs: usize,
    /// Number of these that were filled in rather than measured.
    pub filled_discs: usize,
    /// Number of these that only key frames saw.
    pub key_frame_discs: usize,
    /// Number of pixels without a measured surface that are assumed to show the floor.
    pub assumed_floor_pixels: usize,
    /// Number of pixels dropped since another camera showed the same surface finer.
    pub duplicate_pixels: usize,
    /// Number of pixels dropped since another camera looks through them.
    pub seen_through_pixels: usize,
    /// Evidence that the verdict weighed.
    pub evidence: RoomEvidence,
    /// Wall times; all else is the same in repeated builds.
    pub seconds: Seconds,
}

/// Wall times of a build's stages, seconds.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Seconds {
    /// Times of each capture's stages, in the project's order; those of an earlier build where they were kept.
    pub cameras: Vec<CameraSeconds>,
    /// Time of merging, floor, metres, fusion.
    pub assembling: f64,
    /// Time of files and previews.
    pub writing: f64,
}

/// Wall times of one capture's stages, seconds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraSeconds {
    /// Time of the motion's estimation.
    pub motion: f64,
    /// Time of stereo, planes and key frames.
    pub dense: f64,
}

/// Report of one capture.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraReport {
    /// Name of the camera.
    pub name: String,
    /// Number of frames used.
    pub frames: usize,
    /// Number in the film, counted from 1, of the frame at the installed pose.
    pub reference: usize,
    /// Start of its motion, "factorization" or "two views": the one with the smaller error.
    pub start: String,
    /// Robust reprojection error of each start, pixels.
    pub start_error_px: StartErrors,
    /// Number of frames with a pose.
    pub registered: usize,
    /// Number of sparse points.
    pub points: usize,
    /// Their root mean square reprojection error, pixels.
    pub reprojection_rms_px: f64,
    /// Median of the widest angle between the rays to a point, degrees.
    pub parallax_deg: f64,
    /// Share of the observations that belong to a static scene.
    pub explained_share: f64,
    /// Time from a frame's first row to its last, as a share of the time between frames; 0 for a global shutter.
    pub readout: f64,
    /// Start of the estimation of a focal length that was not given: EXIF, or an assumption.
    pub focal_start: Option<String>,
    /// Focal length where it was estimated or refined from the capture, pixels.
    pub estimated_focal_px: Option<f64>,
    /// Standard deviation of the focal length, pixels, where it is determined.
    pub focal_sigma_px: Option<f64>,
    /// Doubts about the motion found, a sentence each; they are logged as warnings, too.
    pub doubts: Vec<String>,
    /// Frames matched densely, by their numbers in the film, counted from 1.
    pub key_frames: Vec<usize>,
    /// Share of the reference image's pixels, straightened, that stereo measured.
    pub measured_share: f64,
    /// Share of the pixels that was filled in.
    pub filled_share: f64,
}

/// Error of each start of a motion, pixels; `None` where the start failed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct StartErrors {
    /// Factorization of windows, chained.
    pub factorization: Option<f64>,
    /// The essential matrix of two views, then frame after frame.
    pub two_views: Option<f64>,
}

impl CameraReport {
    /// Figures that a verdict weighs.
    pub(super) fn figures(&self, lens: &Intrinsics) -> CaptureFigures {
        CaptureFigures {
            name: self.name.clone(),
            width: lens.width,
            parallax_deg: self.parallax_deg,
            focal_sigma: self.focal_sigma_px.zip(self.estimated_focal_px).map(|(sigma, focal)| sigma / focal),
            doubts: self.doubts.clone(),
        }
    }

    /// Report of a capture after motion estimation.
    pub(super) fn of_motion(capture: &Capture, lens: &Intrinsics, motion: &MotionReport) -> Self {
        let Starts { factorization_px, two_views_px } = motion.starts;
        let finite = |px: f64| px.is_finite().then_some(px);
        Self {
            name: capture.name.clone(),
            frames: capture.frames.len(),
            reference: capture.sampled.number(capture.reference),
            start: if motion.starts.factorization_won() { "factorization" } else { "two views" }.into(),
            start_error_px: StartErrors {
                factorization: finite(factorization_px),
                two_views: finite(two_views_px),
            },
            registered: motion.registered,
            points: motion.points,
            reprojection_rms_px: motion.rms_px,
            parallax_deg: motion.parallax_deg,
            explained_share: motion.explained_share,
            readout: motion.readout,
            focal_start: focal_start(capture),
            estimated_focal_px: matches!(motion.lens, LensOrigin::Estimated | LensOrigin::Refined)
                .then_some(lens.fx),
            focal_sigma_px: motion.focal_sigma.map(|sigma| sigma * lens.fx),
            doubts: motion.doubts.clone(),
            ..Self::default()
        }
    }

    /// The report with its focal length in pixels as filmed, not those of the working size.
    pub(super) fn in_filmed_pixels(self, enlargement: f64) -> Self {
        let enlarged = |px: Option<f64>| px.map(|px| enlargement * px);
        Self {
            estimated_focal_px: enlarged(self.estimated_focal_px),
            focal_sigma_px: enlarged(self.focal_sigma_px),
            ..self
        }
    }

    /// Adds the results of stereo to the report.
    pub(super) fn with_depth(self, sampled: Sampled, dense: &DenseReport, surface: &Surface) -> Self {
        let share = |origin: DepthOrigin| {
            let count = surface.origin.iter().filter(|o| **o == origin).count();
            count as f64 / dense.filmed_pixels.max(1) as f64
        };
        Self {
            key_frames: dense.key_frames.iter().map(|f| sampled.number(*f)).collect(),
            measured_share: share(DepthOrigin::Stereo),
            filled_share: share(DepthOrigin::Filled),
            ..self
        }
    }
}

/// Start of the focal length's estimation, in words.
fn focal_start(capture: &Capture) -> Option<String> {
    let told = capture.exif_focal_px.map(|px| format!("EXIF, {px:.1} px"));
    let assumed = || {
        let [narrow, wide] =
            [f64::min, f64::max].map(|of| ASSUMED_FOV_DEG.into_iter().reduce(of).unwrap_or_default());
        format!("fields of view from {narrow} to {wide}°")
    };
    capture.intrinsics.is_none().then(|| told.unwrap_or_else(assumed))
}

impl BuildReport {
    pub(super) fn assembled(
        &mut self,
        project: &Project,
        figures: &[CaptureFigures],
        done: &AssembleReport,
        took: Duration,
    ) {
        self.pick_rms_px = done.merge.pick_rms_px;
        self.picks_left_out = done
            .merge
            .outliers
            .iter()
            .map(|(point, camera, off)| {
                let name = &project.cameras[*camera].name;
                format!("[[point]] {point}, {name}: {off:.1} pixels from where the other picks put it")
            })
            .collect();
        self.shared_features =
            done.merge.adjustment.iter().flat_map(|told| told.shared_features.values()).sum();
        self.depth_sigma.clone_from(&done.merge.depth_sigma);
        self.floor_rms_m = done.floor.rms * done.metres_per_unit;
        self.floor_share = done.floor.area_share;
        self.level_planes = done.floor.level_planes;
        self.plumb_planes = done.floor.plumb_planes;
        self.plumb_captures = done.floor.plumb_captures;
        self.discs = done.fusion.discs;
        self.filled_discs = done.fusion.filled;
        self.key_frame_discs = done.fusion.key_frame_discs;
        self.assumed_floor_pixels = done.fusion.assumed_floor;
        self.duplicate_pixels = done.fusion.duplicates;
        self.seen_through_pixels = done.fusion.seen_through;
        self.evidence.clone_from(&done.evidence);
        self.verdict = verdict::judge(&self.evidence, figures);
        if self.proposed_points > 0 {
            self.verdict.note(format!(
                "no points are picked: {} that the program proposed join the cameras; `recon picks --page` shows them",
                self.proposed_points
            ));
        }
        self.seconds.assembling = took.as_secs_f64();
    }

    pub(super) fn write(&self, dir: &Path) -> Result<()> {
        let path = dir.join("report.json");
        let text =
            serde_json::to_string_pretty(self).map_err(|e| Error::content(&path, "report", e.to_string()))?;
        Ok(calib::files::write_atomic(&path, format!("{text}\n").as_bytes())?)
    }
}
