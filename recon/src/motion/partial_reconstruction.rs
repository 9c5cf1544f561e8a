//! Partial reconstruction: poses of some frames and points of some tracks.

use std::borrow::Cow;

use calib::Intrinsics;
use calib::least_squares::{Loss, Options, Report};
use calib::resection::Pick;
use nalgebra::{Isometry3, Point2, Point3};
use rayon::prelude::*;

use super::triangulation::{self, PoseObservation, TriangulationLimits};
use super::two_views::median;
use crate::bundle::{BundleOptions, BundleProblem, BundleState, LensEvidence, LensFreedom, Observation};
use crate::features::FeatureTrack;

/// Error at which an observation counts as wrong when whole reconstructions are compared, pixels.
const WRONG_PX: f64 = 3.0;
/// Relative decrease of the cost at which an intermediate adjustment ends: later ones do the rest. Competing starts end
/// by it, too: the winner is adjusted again, and a tie this close may go either way.
pub(super) const PASSING: f64 = 1e-3;
/// The same for an adjustment whose result is kept, or measured by small changes of its error (readout, lens).
pub(super) const FINAL: f64 = 1e-5;

/// Poses and points, in the frame and scale of their start.
#[derive(Debug, Clone)]
pub(crate) struct PartialReconstruction<'a> {
    /// Tracks; borrowed until lost features are found again.
    pub(crate) tracks: Cow<'a, [FeatureTrack]>,
    pub(crate) intrinsics: Intrinsics,
    /// Pose of each frame.
    pub(crate) poses: Vec<Option<Isometry3<f64>>>,
    /// Point of each track.
    pub(crate) points: Vec<Option<Point3<f64>>>,
    /// Precision of each track's observations, see [`Observation::precision`]; empty where all are equally precise.
    pub(crate) precisions: Vec<Vec<f64>>,
}

/// Options of an adjustment of the whole reconstruction.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Adjustment {
    /// Largest error of an observation that takes part, pixels.
    pub(crate) gate_px: f64,
    pub(crate) loss: Loss,
    pub(crate) lens: LensFreedom,
    /// Ends by a relative decrease of the cost of [`PASSING`] or [`FINAL`].
    pub(crate) solver: Options,
}

/// Options of the solver of an intermediate adjustment.
pub(super) fn passing(max_iterations: usize) -> Options {
    Options { max_iterations, cost_tolerance: PASSING, ..Options::default() }
}

/// Part of a reconstruction that an adjustment moves.
struct AdjustedPart {
    problem: BundleProblem,
    state: BundleState,
    /// Frame of each pose.
    frames: Vec<usize>,
    /// Track of each point.
    tracks: Vec<usize>,
}

impl Adjustment {
    /// Options when only noise is left: observations within ten standard deviations, a loss that fades from two and a
    /// half.
    fn last(noise_px: f64, lens: LensFreedom, cost_end: f64) -> Self {
        Self {
            gate_px: (10.0 * noise_px).max(1.5),
            loss: Loss::Cauchy((2.4 * noise_px).max(0.1)),
            lens,
            solver: Options { max_iterations: 40, cost_tolerance: cost_end, ..Options::default() },
        }
    }
}

impl<'a> PartialReconstruction<'a> {
    pub(crate) fn new(tracks: &'a [FeatureTrack], intrinsics: Intrinsics, frames: usize) -> Self {
        Self {
            tracks: Cow::Borrowed(tracks),
            intrinsics,
            poses: vec![None; frames],
            points: vec![None; tracks.len()],
            precisions: Vec::new(),
        }
    }

    /// Number of frames that have a pose.
    pub(crate) fn registered(&self) -> usize {
        self.poses.iter().flatten().count()
    }

    /// Known points seen in a frame, with their pixels.
    pub(crate) fn picks(&self, seen: &[(usize, Point2<f64>)]) -> Vec<Pick> {
        let pick = |&(track, pixel): &(usize, Point2<f64>)| Some(Pick { world: self.points[track]?, pixel });
        seen.iter().filter_map(pick).collect()
    }

    /// Triangulates every track anew, or only those without a point.
    pub(crate) fn triangulate(&mut self, accept: &TriangulationLimits, only_missing: bool) {
        let points: Vec<Option<Point3<f64>>> = (0..self.tracks.len())
            .into_par_iter()
            .with_min_len(16)
            .map(|track| match self.points[track] {
                Some(point) if only_missing => Some(point),
                _ => {
                    let sightings: Vec<PoseObservation<'_>> = self.tracks[track]
                        .observations
                        .iter()
                        .filter_map(|(frame, pixel)| Some((self.poses[*frame].as_ref()?, *pixel)))
                        .collect();
                    triangulation::triangulate(&self.intrinsics, &sightings, accept)
                }
            })
            .collect();
        self.points = points;
    }

    /// Errors of all observations that have a pose and a point, pixels; those of less precise ones as they count.
    pub(crate) fn errors_px(&self) -> Vec<f64> {
        let of_track = |(index, track): (usize, &FeatureTrack)| -> Vec<f64> {
            let Some(point) = &self.points[index] else { return Vec::new() };
            let error = |(place, (frame, pixel)): (usize, &(usize, Point2<f64>))| {
                Some(self.precision(index, place).sqrt() * self.error_px(*frame, point, pixel)?)
            };
            track.observations.iter().enumerate().filter_map(error).collect()
        };
        self.tracks.iter().enumerate().flat_map(of_track).collect()
    }

    /// Precision of an observation of a track.
    fn precision(&self, track: usize, place: usize) -> f64 {
        self.precisions.get(track).map_or(1.0, |of| of[place])
    }

    /// Error of an observation, pixels; `None` where the frame has no pose, infinite behind the camera.
    pub(crate) fn error_px(&self, frame: usize, point: &Point3<f64>, pixel: &Point2<f64>) -> Option<f64> {
        let pose = self.poses[frame].as_ref()?;
        Some(self.intrinsics.project(&(pose * point)).map_or(f64::INFINITY, |p| (p - pixel).norm()))
    }

    /// Noise of a pixel coordinate, from the median error (whose ratio to it is √(2 ln 2) for Gaussian noise).
    pub(crate) fn noise_px(&self) -> f64 {
        median(&self.errors_px()).unwrap_or(f64::INFINITY) / (2.0 * 2.0_f64.ln()).sqrt()
    }

    /// Root mean truncated squared error over all observations of all tracks, explained or not, for comparing competing
    /// reconstructions.
    pub(crate) fn robust_error_px(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for (track, point) in self.tracks.iter().zip(&self.points).filter(|(t, _)| t.observations.len() >= 3)
        {
            for (frame, pixel) in &track.observations {
                let error = point.as_ref().and_then(|p| self.error_px(*frame, p, pixel)).unwrap_or(WRONG_PX);
                sum += error.min(WRONG_PX).powi(2);
                count += 1;
            }
        }
        if count == 0 { f64::INFINITY } else { (sum / f64::from(count)).sqrt() }
    }

    /// Bundle-adjusts everything that has pose and point; `None` when there is nothing to adjust.
    pub(crate) fn adjust(&mut self, how: &Adjustment) -> Option<Report> {
        let AdjustedPart { problem, mut state, frames, tracks } = self.adjusted_part(how)?;
        let report = problem.adjust(&mut state);
        self.intrinsics = state.intrinsics;
        for (frame, pose) in frames.into_iter().zip(state.poses) {
            self.poses[frame] = Some(pose);
        }
        for (track, point) in tracks.into_iter().zip(state.points) {
            self.points[track] = Some(point);
        }
        Some(report)
    }

    /// Estimate of the lens by the polished reconstruction.
    pub(crate) fn lens_evidence(&self, lens: LensFreedom) -> Option<LensEvidence> {
        let how = Adjustment::last(self.noise_px().clamp(0.05, 4.0), lens, FINAL);
        let part = self.adjusted_part(&how)?;
        part.problem.lens_evidence(&part.state)
    }

    /// Share of all observations of longer tracks that a point explains, to within `agree_px`.
    pub(crate) fn explained_share(&self, agree_px: f64) -> f64 {
        let (mut explained, mut count) = (0_usize, 0_usize);
        for (track, point) in self.tracks.iter().zip(&self.points).filter(|(t, _)| t.observations.len() >= 3)
        {
            for (frame, pixel) in &track.observations {
                let error = point.as_ref().and_then(|p| self.error_px(*frame, p, pixel));
                explained += usize::from(error.is_some_and(|e| e <= agree_px));
                count += 1;
            }
        }
        explained as f64 / count.max(1) as f64
    }

    /// Everything that has pose and point; `None` when that is too little.
    fn adjusted_part(&self, how: &Adjustment) -> Option<AdjustedPart> {
        let frames: Vec<usize> = (0..self.poses.len()).filter(|&f| self.poses[f].is_some()).collect();
        let mut pose_of = vec![usize::MAX; self.poses.len()];
        for (index, frame) in frames.iter().enumerate() {
            pose_of[*frame] = index;
        }
        let mut state = BundleState {
            intrinsics: self.intrinsics.clone(),
            poses: self.poses.iter().flatten().copied().collect(),
            points: Vec::new(),
        };
        let options = BundleOptions { loss: how.loss, lens: how.lens, solver: how.solver };
        let mut problem = BundleProblem { observations: Vec::new(), on_plane: Vec::new(), options };
        let mut tracks = Vec::new();
        for (index, (track, point)) in self.tracks.iter().zip(&self.points).enumerate() {
            let Some(point) = point else { continue };
            let within = |(place, &(frame, pixel)): (usize, &(usize, Point2<f64>))| {
                let precision = self.precision(index, place);
                let error = precision.sqrt() * self.error_px(frame, point, &pixel)?;
                (error <= how.gate_px).then(|| Observation { pose: pose_of[frame], pixel, precision })
            };
            let observations: Vec<Observation> =
                track.observations.iter().enumerate().filter_map(within).collect();
            if observations.len() >= 2 {
                tracks.push(index);
                state.points.push(*point);
                problem.observations.push(observations);
            }
        }
        if frames.len() < 2 || tracks.is_empty() {
            return None;
        }
        Some(AdjustedPart { problem, state, frames, tracks })
    }

    /// Adjusts, triangulates anew and adjusts again with tighter bounds, until only noise is left. The last adjustment
    /// ends by `cost_end`.
    pub(crate) fn polish(&mut self, lens: LensFreedom, rounds: usize, cost_end: f64) -> Option<Report> {
        let mut report = None;
        for round in 0..rounds {
            let noise = self.noise_px().clamp(0.05, 4.0);
            let accept = TriangulationLimits {
                max_error_px: (8.0 * noise).max(1.0),
                min_angle: 0.5_f64.to_radians(),
                min_sightings: 3,
            };
            if round > 0 {
                self.triangulate(&accept, false);
            }
            let last = round + 1 == rounds;
            let whole = Adjustment::last(noise, lens, cost_end);
            let how = if last { whole } else { Adjustment { solver: passing(15), ..whole } };
            report = self.adjust(&how).or(report);
        }
        report
    }
}
