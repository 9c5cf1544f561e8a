//! Estimates the offsets between the cameras' clocks during a run, and applies them where asked to.

use serde::{Deserialize, Serialize};

use crate::Result;
use crate::gathering::ClockAlignment;
use crate::observation::Observation;
use crate::offsets::{OffsetEstimator, OffsetOptions, Offsets};
use crate::prepared_room::PreparedRoom;

/// Interval between two readings of the estimate, seconds of the run.
const EVERY_S: f64 = 0.5;
/// Least change of an applied offset, seconds; smaller changes are ignored.
const LEAST_STEP_S: f64 = 0.005;
/// Least offset, seconds, that is worth a warning where it is not applied; it must also exceed three standard
/// deviations.
const WARNING_S: f64 = 0.04;
/// Time for which a camera's observations are kept for comparison in a recorded run whose offsets are not searched for
/// beforehand, seconds.
const KEEP_S: f64 = 10.0;

/// Estimate of one camera's clock at the end of a run, as in `timings.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClockReport {
    /// The camera.
    pub camera: String,
    /// The camera with whose clock it is compared.
    pub reference: String,
    /// Offset that was added to the camera's times, seconds.
    pub applied_s: f64,
    /// Offset estimated from the people seen, seconds; `null` where they do not determine it.
    pub offset_s: Option<f64>,
    /// Standard deviation of the estimated offset, seconds.
    pub sigma_s: Option<f64>,
    /// Drift of the offset, microseconds a second; `null` where the run was too short to estimate it.
    pub drift_ppm: Option<f64>,
}

/// Estimator of the offsets between the clocks of a run's cameras.
#[derive(Debug)]
pub struct ClockOffsets {
    estimator: OffsetEstimator,
    names: Vec<String>,
    /// Alignments given by the user.
    given: Vec<ClockAlignment>,
    applied: Vec<ClockAlignment>,
    applies: bool,
    next_look_s: f64,
}

impl ClockOffsets {
    /// Estimates the offsets of the cameras of `room` on top of the alignments `given`. With `applies`, the estimates
    /// replace those.
    ///
    /// # Errors
    /// Invalid options.
    pub fn new(
        room: &PreparedRoom,
        given: Vec<ClockAlignment>,
        is_live: bool,
        applies: bool,
    ) -> Result<Self> {
        let options = if is_live {
            OffsetOptions::live()
        } else {
            OffsetOptions { keep_s: KEEP_S, ..OffsetOptions::recording() }
        };
        Ok(Self {
            estimator: OffsetEstimator::new(room, options)?,
            names: room.cameras.iter().map(|camera| camera.name.clone()).collect(),
            applied: given.clone(),
            given,
            applies,
            next_look_s: f64::NEG_INFINITY,
        })
    }

    /// Adds an observation, whose time is by the camera's own clock.
    ///
    /// # Errors
    /// A mask whose size is not that of the camera's images.
    pub fn observe(&mut self, camera: usize, observation: &Observation) -> Result<()> {
        match &observation.mask {
            Some(mask) => {
                let time_s = self.given[camera].apply(observation.time_s);
                self.estimator.observe(camera, time_s, mask)
            }
            None => Ok(()),
        }
    }

    /// New alignments, where they have changed since the last call.
    pub fn changed(&mut self, now_s: f64) -> Option<Vec<ClockAlignment>> {
        if !self.applies || now_s < self.next_look_s {
            return None;
        }
        self.next_look_s = now_s + EVERY_S;
        let found = alignments(&self.given, &self.estimator.estimate());
        let step_s = |(old, new): (&ClockAlignment, &ClockAlignment)| {
            (new.apply(new.since_s) - old.apply(new.since_s)).abs()
        };
        let is_worth_it = self.applied.iter().zip(&found).map(step_s).fold(0.0, f64::max) > LEAST_STEP_S;
        is_worth_it.then(|| {
            self.applied.clone_from(&found);
            found
        })
    }

    /// Reports of all cameras' clocks, which are also logged.
    pub fn finish(self) -> Vec<ClockReport> {
        let offsets = self.estimator.estimate();
        let mut reports = Vec::new();
        for (camera, found) in offsets.cameras.iter().enumerate() {
            let is_other = found.is_known && found.reference != camera;
            let report = ClockReport {
                camera: self.names[camera].clone(),
                reference: self.names[found.reference].clone(),
                applied_s: self.applied[camera].offset_s,
                offset_s: is_other.then(|| self.given[camera].offset_s + found.offset_s),
                sigma_s: is_other.then_some(found.sigma_s),
                drift_ppm: found.known_drift_ppm().filter(|_| is_other),
            };
            if let (Some(offset_s), Some(sigma_s)) = (report.offset_s, report.sigma_s) {
                let off_s = (offset_s - report.applied_s).abs();
                let drift =
                    report.drift_ppm.map_or(String::new(), |ppm| format!(", drifting by {ppm:.0} ppm"));
                if off_s > WARNING_S.max(3.0 * sigma_s) && !self.applies {
                    tracing::warn!(
                        "camera `{}`: by the people seen its first frame was taken {offset_s:.2} ± {sigma_s:.2} s after \
                         that of `{}`{drift}; give --offset auto, or --offset {0}={offset_s:.2}",
                        report.camera,
                        report.reference
                    );
                } else {
                    tracing::info!(
                        "camera `{}`: clock {offset_s:+.3} ± {sigma_s:.3} s against `{}`{drift}",
                        report.camera,
                        report.reference
                    );
                }
            }
            reports.push(report);
        }
        reports
    }
}

/// The given alignments plus the estimated offsets.
pub(super) fn alignments(given: &[ClockAlignment], offsets: &Offsets) -> Vec<ClockAlignment> {
    let add = |(camera, given): (usize, &ClockAlignment)| {
        let found = &offsets.cameras[camera];
        if !found.is_known {
            return *given;
        }
        ClockAlignment {
            offset_s: given.offset_s + found.offset_s,
            drift: 1e-6 * found.known_drift_ppm().unwrap_or(0.0),
            since_s: offsets.at_s - given.offset_s - found.offset_s,
        }
    };
    given.iter().enumerate().map(add).collect()
}
