//! `report.json`: what building a room did — counts, residuals, time a stage.

use std::path::Path;
use std::time::Duration;

use calib::Intrinsics;
use serde::{Deserialize, Serialize};

use crate::assemble::AssembleReport;
use crate::capture::{ASSUMED_FOV_DEG, Capture, Sampled};
use crate::dense::DenseReport;
use crate::motion::{LensOrigin, MotionReport, Starts};
use crate::project::Project;
use crate::surface::{Origin, Surface};
use crate::{Error, Result};

/// What building a room did.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct BuildReport {
    /// One a camera, in the project's order.
    pub cameras: Vec<CameraReport>,
    /// Root mean square distance of the picks from where the room puts them, pixels.
    pub pick_rms_px: f64,
    /// Picks left out, each told as a sentence.
    pub picks_left_out: Vec<String>,
    /// Places that pictures were found to have in common and that joined the cameras beside the picks.
    pub matches: usize,
    /// What the depths at each camera's picks turned out to be off by, as a share of them; empty for one camera.
    pub pick_depth_sigma: Vec<f64>,
    /// Pairs of surface points of different cameras that were laid on each other.
    pub surface_pairs: usize,
    /// Their root mean square distance, metres.
    pub surface_rms_m: f64,
    /// Root mean square distance of the floor's points from its plane, metres.
    pub floor_rms_m: f64,
    /// The floor's share of all area seen.
    pub floor_share: f64,
    /// Planes that say which way is up: the floor and those parallel to it …
    pub level_planes: usize,
    /// … and walls; …
    pub plumb_planes: usize,
    /// … captures in whose pictures plumb lines do.
    pub plumb_captures: usize,
    /// Discs in the room.
    pub discs: usize,
    /// Of these, filled in rather than measured.
    pub filled_discs: usize,
    /// Of these, seen only from key frames, beside what the cameras see from where they are installed.
    pub key_frame_discs: usize,
    /// Pixels dropped since another camera showed the same finer.
    pub duplicate_pixels: usize,
    /// Pixels dropped since another camera looks through them.
    pub seen_through_pixels: usize,
    /// Time for the whole room; each camera has its own.
    pub seconds: RoomSeconds,
}

/// Wall time of the stages that concern the whole room.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct RoomSeconds {
    /// Merging, floor, metres, fusion.
    pub assembling: f64,
    /// Files and previews.
    pub writing: f64,
}

/// What became of one capture.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraReport {
    /// The camera.
    pub name: String,
    /// Frames used.
    pub frames: usize,
    /// The frame at the installed pose, by its number in the film, counted from 1.
    pub reference: usize,
    /// How its motion began: by "factorization" or from "two views", whichever came to the smaller error.
    pub start: String,
    /// The robust reprojection error that each start came to, pixels.
    pub start_error_px: StartErrors,
    /// Frames whose pose was found.
    pub registered: usize,
    /// Sparse points.
    pub points: usize,
    /// Their root mean square reprojection error, pixels.
    pub reprojection_rms_px: f64,
    /// The share of what was followed that stood still.
    pub explained_share: f64,
    /// The time from a frame's first row to its last, as a share of the time between frames; 0 for all at once.
    pub readout: f64,
    /// Where the estimation of a focal length that was not given started: what the photographs tell, or an assumption.
    pub focal_start: Option<String>,
    /// The focal length where it was estimated or refined from the capture, pixels.
    pub estimated_focal_px: Option<f64>,
    /// Its standard deviation, pixels, where it can be told.
    pub focal_sigma_px: Option<f64>,
    /// What the capture leaves in doubt though a motion was found, a sentence each; they are warned of, too.
    pub doubts: Vec<String>,
    /// Frames matched densely, by their numbers in the film, counted from 1.
    pub key_frames: Vec<usize>,
    /// Share of the reference image's pixels that stereo measured.
    pub measured_share: f64,
    /// Share that was filled in.
    pub filled_share: f64,
    /// Wall time of motion and of everything dense.
    pub motion_seconds: f64,
    /// See `motion_seconds`.
    pub dense_seconds: f64,
}

/// What each start of a motion came to, pixels; none where it came to nothing.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct StartErrors {
    /// Factorization of windows, chained.
    pub factorization: Option<f64>,
    /// The essential matrix of two views, then frame after frame.
    pub two_views: Option<f64>,
}

impl CameraReport {
    /// What is known once a capture's motion is.
    pub(super) fn of_motion(
        capture: &Capture,
        lens: &Intrinsics,
        motion: &MotionReport,
        took: Duration,
    ) -> Self {
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
            explained_share: motion.explained_share,
            readout: motion.readout,
            focal_start: focal_start(capture),
            estimated_focal_px: matches!(motion.lens, LensOrigin::Estimated | LensOrigin::Refined)
                .then_some(lens.fx),
            focal_sigma_px: motion.focal_sigma.map(|sigma| sigma * lens.fx),
            doubts: motion.doubts.clone(),
            motion_seconds: took.as_secs_f64(),
            ..Self::default()
        }
    }

    /// The same once its depths are known, too.
    pub(super) fn with_depth(
        self,
        sampled: Sampled,
        dense: &DenseReport,
        surface: &Surface,
        took: Duration,
    ) -> Self {
        let share = |origin: Origin| {
            let count = surface.origin.iter().filter(|o| **o == origin).count();
            count as f64 / surface.origin.len().max(1) as f64
        };
        Self {
            key_frames: dense.key_frames.iter().map(|f| sampled.number(*f)).collect(),
            measured_share: share(Origin::Stereo),
            filled_share: share(Origin::Filled),
            dense_seconds: took.as_secs_f64(),
            ..self
        }
    }
}

/// In words, for people.
fn focal_start(capture: &Capture) -> Option<String> {
    let told = capture.told_focal_px.map(|px| format!("EXIF, {px:.1} px"));
    let assumed = || format!("a field of view of {ASSUMED_FOV_DEG}°");
    capture.intrinsics.is_none().then(|| told.unwrap_or_else(assumed))
}

impl BuildReport {
    pub(super) fn assembled(&mut self, project: &Project, done: &AssembleReport, took: Duration) {
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
        self.matches = done.merge.matches;
        self.pick_depth_sigma.clone_from(&done.merge.depth_sigma);
        self.surface_pairs = done.merge.surface_pairs;
        self.surface_rms_m = done.merge.surface_rms * done.metres_per_unit;
        self.floor_rms_m = done.floor.rms * done.metres_per_unit;
        self.floor_share = done.floor.area_share;
        self.level_planes = done.floor.level_planes;
        self.plumb_planes = done.floor.plumb_planes;
        self.plumb_captures = done.floor.plumb_captures;
        self.discs = done.fusion.discs;
        self.filled_discs = done.fusion.filled;
        self.key_frame_discs = done.fusion.key_frame_discs;
        self.duplicate_pixels = done.fusion.duplicates;
        self.seen_through_pixels = done.fusion.seen_through;
        self.seconds.assembling = took.as_secs_f64();
    }

    pub(super) fn write(&self, dir: &Path) -> Result<()> {
        let path = dir.join("report.json");
        let text =
            serde_json::to_string_pretty(self).map_err(|e| Error::content(&path, "report", e.to_string()))?;
        Ok(calib::files::write_atomic(&path, format!("{text}\n").as_bytes())?)
    }
}
