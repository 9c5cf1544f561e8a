//! Capture times of a recording, frame by frame.

use super::Times;
use crate::Result;

/// Origin of a recording's capture times.
#[derive(Debug, Clone, PartialEq)]
enum TimeSource {
    /// A rate or a file given by the user, which replaces the recording's own times.
    Given(Times),
    /// The recording's own presentation times; a frame without one is placed one interval after the frame before it.
    Presentation { rate_hz: f64 },
}

/// Capture times of one recording, queried frame by frame, seconds on its own clock.
#[derive(Debug, Clone)]
pub struct CaptureTimes {
    name: String,
    clock: TimeSource,
    /// Number of frames queried so far.
    frames: u32,
    latest_s: Option<f64>,
    has_warned: bool,
}

impl CaptureTimes {
    /// Uses the given times for the recording of this name.
    pub fn given(name: impl Into<String>, times: Times) -> Self {
        Self::new(name.into(), TimeSource::Given(times))
    }

    /// Uses the recording's own presentation times, and `rate_hz` frames a second where it has none.
    pub fn presentation(name: impl Into<String>, rate_hz: f64) -> Self {
        Self::new(name.into(), TimeSource::Presentation { rate_hz })
    }

    fn new(name: String, clock: TimeSource) -> Self {
        Self { name, clock, frames: 0, latest_s: None, has_warned: false }
    }

    /// Mean frame rate, frames a second.
    pub fn mean_rate(&self) -> f64 {
        match &self.clock {
            TimeSource::Given(times) => times.mean_rate(),
            TimeSource::Presentation { rate_hz } => *rate_hz,
        }
    }

    /// Capture time of the next frame, whose presentation time is `stamp_s`; later than that of every frame before. A
    /// frame whose presentation time is not later is placed one interval after the frame before it, with one warning.
    ///
    /// # Errors
    /// A file of times without a line for the frame.
    pub fn next(&mut self, stamp_s: Option<f64>) -> Result<f64> {
        self.frames += 1;
        let time_s = match &self.clock {
            TimeSource::Given(times) => times.of(self.frames)?,
            TimeSource::Presentation { rate_hz } => {
                let expected_s = self.latest_s.map_or(0.0, |latest| latest + rate_hz.recip());
                let found_s =
                    stamp_s.filter(|s| s.is_finite() && self.latest_s.is_none_or(|latest| *s > latest));
                if found_s.is_none() && !self.has_warned {
                    self.has_warned = true;
                    let what = match stamp_s {
                        None => "has no time".to_owned(),
                        Some(s) => format!("has the time {s:.3} s, which is not after the frame before"),
                    };
                    tracing::warn!(
                        "{}: frame {}: {what}; such frames are taken {:.0} ms after the one before (--rate or --times \
                         decide otherwise)",
                        self.name,
                        self.frames,
                        1e3 / rate_hz
                    );
                }
                found_s.unwrap_or(expected_s)
            }
        };
        self.latest_s = Some(time_s);
        Ok(time_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presentation_times_are_taken_as_they_are_and_mended_where_they_fail() {
        let mut times = CaptureTimes::presentation("a.mp4", 10.0);
        let stamps = [Some(2.0), Some(2.1), Some(2.5), None, Some(2.3), Some(f64::NAN), Some(3.0)];
        let found: Vec<f64> = stamps.into_iter().map(|s| times.next(s).unwrap()).collect();
        let expected = [2.0, 2.1, 2.5, 2.6, 2.7, 2.8, 3.0];
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
    }

    #[test]
    fn given_times_outweigh_the_recording() {
        let mut times = CaptureTimes::given("a.mp4", Times::steady(4.0).unwrap());
        let found: Vec<f64> =
            [Some(7.0), None, Some(1.0)].into_iter().map(|s| times.next(s).unwrap()).collect();
        assert!(found.iter().zip([0.0, 0.25, 0.5]).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
    }
}
