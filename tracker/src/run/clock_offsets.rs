//! The offsets between the cameras' clocks, watched while a run goes on, and applied where that was asked for.

use serde::{Deserialize, Serialize};

use crate::Result;
use crate::gathering::Alignment;
use crate::observation::Observation;
use crate::offsets::{OffsetEstimator, OffsetOptions, Offsets};
use crate::stage::Stage;

/// Between two looks at the estimate, seconds of the run.
const EVERY_S: f64 = 0.5;
/// A step of an applied offset that is smaller than this is not taken, seconds.
const LEAST_STEP_S: f64 = 0.005;
/// An offset that is this large, and three standard deviations, is worth a warning where it is not applied, seconds.
const TELLING_S: f64 = 0.04;
/// Time for which a camera's observations are kept to be compared with others', in a run whose offsets are not searched for,
/// seconds.
const KEEP_S: f64 = 10.0;

/// Knowledge of one camera's clock at the end of a run, as `timings.json` has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClockReport {
    /// The camera.
    pub camera: String,
    /// The camera whose clock it is compared with.
    pub reference: String,
    /// Offset that was added to its times, seconds.
    pub applied_s: f64,
    /// Offset that the people seen speak for, seconds; `null` where they do not tell.
    pub offset_s: Option<f64>,
    /// Standard deviation of that, seconds.
    pub sigma_s: Option<f64>,
    /// Change of the offset, microseconds a second, where the run was long enough to tell.
    pub drift_ppm: Option<f64>,
}

/// Watches the clocks of a run's cameras.
#[derive(Debug)]
pub struct ClockOffsets {
    estimator: OffsetEstimator,
    names: Vec<String>,
    /// Alignments that the user gave.
    given: Vec<Alignment>,
    applied: Vec<Alignment>,
    applies: bool,
    next_look_s: f64,
}

impl ClockOffsets {
    /// Watches the cameras of a stage whose clocks are brought together by `given`. With `applies` the offsets found replace
    /// those.
    ///
    /// # Errors
    /// When the options make no sense.
    pub fn new(stage: &Stage, given: Vec<Alignment>, is_live: bool, applies: bool) -> Result<Self> {
        let options = if is_live {
            OffsetOptions::live()
        } else {
            OffsetOptions { keep_s: KEEP_S, ..OffsetOptions::recording() }
        };
        Ok(Self {
            estimator: OffsetEstimator::new(stage, options)?,
            names: stage.cameras.iter().map(|camera| camera.name.clone()).collect(),
            applied: given.clone(),
            given,
            applies,
            next_look_s: f64::NEG_INFINITY,
        })
    }

    /// Takes in a camera's observation, with its time by the camera's own clock.
    ///
    /// # Errors
    /// When the mask has not the size of the camera's images.
    pub fn observe(&mut self, camera: usize, observation: &Observation) -> Result<()> {
        match &observation.mask {
            Some(mask) => {
                let time_s = self.given[camera].apply(observation.time_s);
                self.estimator.observe(camera, time_s, mask)
            }
            None => Ok(()),
        }
    }

    /// Alignments from now on, where they have changed.
    pub fn changed(&mut self, now_s: f64) -> Option<Vec<Alignment>> {
        if !self.applies || now_s < self.next_look_s {
            return None;
        }
        self.next_look_s = now_s + EVERY_S;
        let found = alignments(&self.given, &self.estimator.estimate());
        let step_s =
            |(old, new): (&Alignment, &Alignment)| (new.apply(new.since_s) - old.apply(new.since_s)).abs();
        let is_worth_it = self.applied.iter().zip(&found).map(step_s).fold(0.0, f64::max) > LEAST_STEP_S;
        is_worth_it.then(|| {
            self.applied.clone_from(&found);
            found
        })
    }

    /// Reports of all cameras' clocks; the log tells them as well.
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
                if off_s > TELLING_S.max(3.0 * sigma_s) && !self.applies {
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

/// The given alignments with what was found added.
pub(super) fn alignments(given: &[Alignment], offsets: &Offsets) -> Vec<Alignment> {
    let add = |(camera, given): (usize, &Alignment)| {
        let found = &offsets.cameras[camera];
        if !found.is_known {
            return *given;
        }
        Alignment {
            offset_s: given.offset_s + found.offset_s,
            drift: 1e-6 * found.known_drift_ppm().unwrap_or(0.0),
            since_s: offsets.at_s - given.offset_s - found.offset_s,
        }
    };
    given.iter().enumerate().map(add).collect()
}
