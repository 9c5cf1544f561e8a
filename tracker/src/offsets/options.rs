//! Options of the estimation of offsets.

use serde::{Deserialize, Serialize};

use crate::{Error, Result};

/// Options of the estimation of offsets. Use [`Self::recording`] or [`Self::live`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OffsetOptions {
    /// Largest offset between two cameras that is searched, in seconds either way.
    pub reach_s: f64,
    /// Age up to which observations count, in seconds. Long enough to measure a drift, short enough that it is
    /// constant.
    pub window_s: f64,
    /// Time for which a camera's observations wait for those of the other cameras of about the same time, in seconds;
    /// at least `reach_s` and as much as one camera's frames come later than another's.
    pub keep_s: f64,
    /// Standard deviation of the drift between two cameras' clocks before anything is observed, parts per million.
    pub drift_sigma_ppm: f64,
    /// Standard deviation below which an offset counts as known, in seconds.
    pub known_sigma_s: f64,
}

impl OffsetOptions {
    /// Options for recordings whose start times are unknown: ± 3 s, all observations count.
    pub fn recording() -> Self {
        Self {
            reach_s: 3.0,
            window_s: f64::INFINITY,
            keep_s: f64::INFINITY,
            // Quartz clocks differ by less than 100 ppm, but the frame rate in a file's header is often rounded.
            drift_sigma_ppm: 300.0,
            known_sigma_s: 0.04,
        }
    }

    /// Options for live cameras whose clocks are about right: ± 0.5 s, the latest ten minutes count.
    pub fn live() -> Self {
        // An error of half a second is worse than one of a tenth, which is corrected further as more is observed.
        Self { reach_s: 0.5, window_s: 600.0, keep_s: 5.0, known_sigma_s: 0.1, ..Self::recording() }
    }

    /// Checks that the options make sense.
    ///
    /// # Errors
    /// [`Error::Option`] for the first that does not.
    pub fn validate(&self) -> Result<()> {
        let above_0 = [
            ("reach_s", self.reach_s),
            ("window_s", self.window_s),
            ("drift_sigma_ppm", self.drift_sigma_ppm),
            ("known_sigma_s", self.known_sigma_s),
        ];
        for (name, value) in above_0 {
            if value.is_nan() || value <= 0.0 {
                return Err(Error::option(name, format!("is {value}; give a number above 0")));
            }
        }
        if self.reach_s > 60.0 {
            return Err(Error::option("reach_s", format!("is {}; give at most 60 s", self.reach_s)));
        }
        if self.keep_s.is_nan() || self.keep_s < self.reach_s {
            return Err(Error::option(
                "keep_s",
                format!("is {}, less than reach_s = {}; give at least as much", self.keep_s, self.reach_s),
            ));
        }
        Ok(())
    }
}
