//! Capture times of a live stream, from its frames' time stamps and arrival times.
//!
//! Sources of a frame's time, the best first:
//! 1. The sender's wall clock (RTCP sender reports), where it agrees with this machine's to within [`PLAUSIBLE_S`].
//! 2. The stream's own time stamps, which are evenly spaced but have an unknown origin: the origin is chosen such that
//!    the fastest frame of the latest half minute arrived at the moment it was taken.
//! 3. The arrival time alone: the camera films at a steady rate and the network delay varies ([`cadence`]).
//!
//! All times are seconds since 1970 by this machine's clock. The constant part of the network delay is unknown and
//! stays in them.

mod cadence;

use std::collections::VecDeque;
use std::time::{SystemTime, UNIX_EPOCH};

use cadence::Cadence;

/// Largest plausible error of a sender's clock, seconds; a clock that is off by more is not set.
const PLAUSIBLE_S: f64 = 2.0;
/// Window of the fastest frame, seconds.
const WINDOW_S: f64 = 30.0;
/// Jump of a stream's clock that means that it was set anew, seconds.
const JUMP_S: f64 = 1.0;

/// Seconds since 1970.
pub fn utc_s(time: SystemTime) -> f64 {
    match time.duration_since(UNIX_EPOCH) {
        Ok(since) => since.as_secs_f64(),
        Err(before) => -before.duration().as_secs_f64(),
    }
}

/// Converts the time stamps of one stream's frames into capture times, frame by frame.
#[derive(Debug, Clone, Default)]
pub struct ArrivalClock {
    name: String,
    /// Arrival time, and its difference to the stream's own time, of the frames of the latest half minute, seconds.
    lags: VecDeque<(f64, f64)>,
    cadence: Cadence,
    latest_s: Option<f64>,
    has_warned: bool,
}

impl ArrivalClock {
    /// Clock of the stream of this name.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), ..Self::default() }
    }

    /// Capture time of the next frame from its presentation time on the stream's clock, its sender's wall clock, where
    /// there are such, and its arrival. Times strictly increase.
    pub fn next(&mut self, presentation_s: Option<f64>, sender_s: Option<f64>, arrival_s: f64) -> f64 {
        let by_sender = sender_s.filter(|s| self.is_plausible(*s, arrival_s));
        let time_s = match (by_sender, presentation_s) {
            (Some(sender_s), _) => sender_s,
            (None, Some(stamp_s)) => self.by_stamp(stamp_s, arrival_s),
            (None, None) => self.cadence.next(arrival_s),
        };
        // A frame cannot arrive before it was taken.
        let time_s = if by_sender.is_some() { time_s } else { time_s.min(arrival_s) };
        let time_s = self.latest_s.map_or(time_s, |latest| time_s.max(latest + 1e-3));
        self.latest_s = Some(time_s);
        time_s
    }

    fn is_plausible(&mut self, sender_s: f64, arrival_s: f64) -> bool {
        let off_s = sender_s - arrival_s;
        let is_plausible = off_s.abs() <= PLAUSIBLE_S;
        if !is_plausible && !self.has_warned {
            self.has_warned = true;
            tracing::warn!(
                "{}: its clock is {:.1} s {} this machine's; frames are timed by their arrival (set its clock by NTP)",
                self.name,
                off_s.abs(),
                if off_s > 0.0 { "ahead of" } else { "behind" }
            );
        }
        is_plausible
    }

    fn by_stamp(&mut self, stamp_s: f64, arrival_s: f64) -> f64 {
        let lag_s = arrival_s - stamp_s;
        if self.lags.back().is_some_and(|(_, latest)| (latest - lag_s).abs() > JUMP_S) {
            self.lags.clear();
        }
        while self.lags.front().is_some_and(|(arrived, _)| arrival_s - arrived > WINDOW_S) {
            self.lags.pop_front();
        }
        self.lags.push_back((arrival_s, lag_s));
        stamp_s + self.lags.iter().map(|(_, lag)| *lag).fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    const INTERVAL_S: f64 = 1.0 / 12.0;

    /// Errors of the capture times of a stream, seconds, after its first 100 frames, less the network's least delay of
    /// 20 ms.
    fn errors(seed: u64, jitter_s: f64, lost: f64, stamped: bool) -> Vec<f64> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let (mut clock, mut errors, mut latest_s) = (ArrivalClock::new("a"), Vec::new(), 0.0_f64);
        for frame in 0..1200 {
            let taken_s = 1.7e9 + f64::from(frame) * INTERVAL_S * 1.0002;
            // Frames arrive in their order.
            latest_s = latest_s.max(taken_s + 0.02 + jitter_s * rng.random::<f64>());
            if rng.random::<f64>() < lost {
                continue;
            }
            let stamp_s = stamped.then_some(f64::from(frame) * INTERVAL_S + 77.0);
            let found_s = clock.next(stamp_s, None, latest_s);
            if frame > 100 {
                errors.push(found_s - taken_s - 0.02);
            }
        }
        errors
    }

    fn deviation(errors: &[f64]) -> f64 {
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / errors.len() as f64).sqrt()
    }

    #[test]
    fn jitter_is_smoothed_and_lost_frames_shift_nothing() {
        for (seed, jitter_s) in (0..10).flat_map(|seed| [0.0, 0.02, 0.06, 0.08].map(|jitter| (seed, jitter)))
        {
            for stamped in [false, true] {
                let errors = errors(seed, jitter_s, 0.02, stamped);
                let (low, high) = errors.iter().fold((0.0_f64, 0.0_f64), |(l, h), e| (l.min(*e), h.max(*e)));
                let spread_s = deviation(&errors);
                assert!(spread_s <= 0.008, "{seed}, {jitter_s}, {stamped}: {spread_s} s");
                // Where delays vary by nearly an interval, a few frames cannot be numbered for certain.
                let most_s = if jitter_s > 0.9 * INTERVAL_S { INTERVAL_S } else { 0.015 };
                assert!(low > -most_s && high < most_s, "{seed}, {jitter_s}, {stamped}: {low} to {high}");
            }
        }
    }

    #[test]
    fn a_camera_that_films_unevenly_is_timed_by_arrival() {
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let (mut clock, mut taken_s) = (ArrivalClock::new("a"), 0.0);
        for _ in 0..300 {
            taken_s += 0.02 + 0.4 * rng.random::<f64>().powi(2);
            let found_s = clock.next(None, None, taken_s);
            assert!((found_s - taken_s).abs() < 0.25, "{found_s} for {taken_s}");
        }
    }

    #[test]
    fn a_sender_is_believed_unless_its_clock_is_wrong() {
        let mut clock = ArrivalClock::new("a");
        assert!((clock.next(Some(5.0), Some(1000.0), 1000.3) - 1000.0).abs() < 1e-9);
        let mut wrong = ArrivalClock::new("b");
        assert!((wrong.next(Some(5.0), Some(4600.0), 1000.3) - 1000.3).abs() < 1e-9);
        // Times increase whatever arrives.
        assert!(wrong.next(Some(2.0), None, 1000.1) > 1000.3);
    }

    #[test]
    fn a_stream_that_was_away_is_timed_anew() {
        for stamped in [false, true] {
            let mut clock = ArrivalClock::new("a");
            for (start_s, zero_s) in [(0.0, 0.0), (100.0, 5000.0), (900.0, 3.0)] {
                for frame in 0..50 {
                    let time_s = start_s + f64::from(frame) * INTERVAL_S;
                    let found_s = clock.next(stamped.then_some(time_s + zero_s), None, time_s);
                    assert!(
                        (found_s - time_s).abs() < 1e-3 * f64::from(frame + 2),
                        "{stamped}: {found_s} for {time_s}"
                    );
                }
            }
        }
    }
}
