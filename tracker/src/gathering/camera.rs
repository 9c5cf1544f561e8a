//! One camera's observations in the gathering.

use std::collections::VecDeque;
use std::time::Instant;

use crate::Error;
use crate::foreground::Verdict;
use crate::observation::Feedback;
use crate::silhouette::Body;
use crate::station::{Event, ObservedFrame, Port};

/// Frame rate assumed for a camera that does not state it, frames a second.
const USUAL_RATE_HZ: f64 = 25.0;
/// Valid frame rates; a header's value outside is the resolution of its clock.
const RATES_HZ: std::ops::RangeInclusive<f64> = 0.01..=1000.0;
/// Weight of each new interval in a live camera's mean interval.
const FOLLOW: f64 = 0.1;
/// Growth of the least delay with each observation, seconds: clocks drift, networks change.
const FORGET_S: f64 = 1e-3;

/// Correction from a camera's own clock to the run's: `time + offset_s + drift · (time − since_s)`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ClockAlignment {
    /// Offset added to the camera's times, seconds.
    pub offset_s: f64,
    /// Offset added for each second since [`Self::since_s`], seconds.
    pub drift: f64,
    /// Camera time at which the offset holds, seconds.
    pub since_s: f64,
}

impl ClockAlignment {
    /// Converts a camera's time to the run's clock, seconds.
    pub fn apply(&self, time_s: f64) -> f64 {
        time_s + self.offset_s + self.drift * (time_s - self.since_s)
    }
}

/// An observation that has arrived.
#[derive(Debug)]
pub(super) struct PendingObservation {
    /// Capture time on the run's clock, seconds.
    pub(super) time_s: f64,
    pub(super) arrived: Instant,
    pub(super) seen: ObservedFrame,
}

/// Reason why a camera has no more observations.
#[derive(Debug)]
pub(super) enum StreamEnd {
    Ended,
    Failed(Error),
}

/// A camera and its observations.
#[derive(Debug)]
pub(super) struct GatheredCamera {
    pub(super) port: Port,
    pub(super) alignment: ClockAlignment,
    /// Observations that may still belong to a moment, ordered by time.
    pub(super) pending: VecDeque<PendingObservation>,
    pub(super) end: Option<StreamEnd>,
    /// Time between two frames, seconds.
    pub(super) interval_s: f64,
    /// Time of the newest observation, seconds.
    pub(super) newest_s: Option<f64>,
    /// Arrival of that observation.
    pub(super) latest_arrival: Option<Instant>,
    /// Mean delay from capture to arrival, seconds; of the latest observations.
    pub(super) delay_s: f64,
    /// Least delay of the latest observations, seconds: that of an observation that waits nowhere.
    pub(super) least_delay_s: f64,
    /// Latest health that its station reported.
    pub(super) health: Verdict,
    /// Time of the newest observation that belonged to a moment, seconds.
    pub(super) used_s: Option<f64>,
    /// Sequence number of the newest observation.
    newest_sequence: u64,
    /// Number of frames of a live camera that its station or the network passed over.
    pub(super) passed_over: u64,
}

impl GatheredCamera {
    pub(super) fn new(port: Port, alignment: ClockAlignment) -> Self {
        let rate_hz = port.rate_hz.filter(|hz| RATES_HZ.contains(hz)).unwrap_or(USUAL_RATE_HZ);
        Self {
            port,
            alignment,
            pending: VecDeque::new(),
            end: None,
            interval_s: rate_hz.recip(),
            newest_s: None,
            latest_arrival: None,
            delay_s: 0.0,
            least_delay_s: f64::INFINITY,
            health: Verdict::Usable,
            used_s: None,
            newest_sequence: 0,
            passed_over: 0,
        }
    }

    /// Processes an event of the camera's station. `now_s` is the time on the run's clock, for live cameras.
    pub(super) fn take(&mut self, event: Event, now_s: Option<f64>) {
        let seen = match event {
            Event::Seen(seen) => *seen,
            Event::Ended => {
                self.end = Some(StreamEnd::Ended);
                return;
            }
            Event::Failed(error) => {
                self.end = Some(StreamEnd::Failed(error));
                return;
            }
        };
        let arrived = Instant::now();
        let time_s = self.alignment.apply(seen.observation.time_s);
        if self.port.is_live {
            self.health = seen.observation.health;
            if matches!(self.health, Verdict::Lost | Verdict::OtherShape) {
                // There is no frame: the stream is out of reach.
                return;
            }
            let sequence = seen.observation.sequence;
            if self.newest_sequence > 0 {
                self.passed_over += sequence.saturating_sub(self.newest_sequence + 1);
            }
            self.newest_sequence = sequence;
            if let Some(newest_s) = self.newest_s {
                let step_s = time_s - newest_s;
                if step_s > 0.0 && step_s < 4.0 * self.interval_s.max(0.04) {
                    self.interval_s += FOLLOW * (step_s - self.interval_s);
                }
            }
            let delay_s = (now_s.unwrap_or(time_s) - time_s).max(0.0);
            self.delay_s += FOLLOW * (delay_s - self.delay_s);
            self.least_delay_s = delay_s.min(self.least_delay_s + FORGET_S);
        }
        self.newest_s = Some(self.newest_s.map_or(time_s, |newest| newest.max(time_s)));
        self.latest_arrival = Some(arrived);
        self.pending.push_back(PendingObservation { time_s, arrived, seen });
    }

    /// Replaces the alignment of the camera's clock from the next observation on.
    pub(super) fn align(&mut self, alignment: ClockAlignment) {
        let change_s = alignment.apply(alignment.since_s) - self.alignment.apply(alignment.since_s);
        self.alignment = alignment;
        // Frames arrive as before, but their times have changed.
        self.delay_s -= change_s;
        self.least_delay_s -= change_s;
        self.newest_s = self.newest_s.map(|newest_s| newest_s + change_s);
    }

    /// Whether a live camera has delivered within three intervals, or `patience_s`.
    pub(super) fn is_present(&self, now: Instant, patience_s: f64) -> bool {
        let for_s = (3.0 * self.interval_s).max(patience_s);
        self.latest_arrival.is_some_and(|at| now.saturating_duration_since(at).as_secs_f64() <= for_s)
    }

    /// Drops the oldest observation and acknowledges it to the station.
    pub(super) fn drop_oldest(&mut self, believed: &[Body]) {
        if let Some(oldest) = self.pending.pop_front() {
            self.acknowledge(oldest.seen.observation.sequence, believed);
        }
    }

    pub(super) fn acknowledge(&mut self, sequence: u64, believed: &[Body]) {
        (self.port.feedback)(Feedback { sequence, people: believed.to_vec() });
    }

    /// Drops observations that are farther from a time than the one after them; the oldest is then the nearest.
    pub(super) fn keep_nearest(&mut self, time_s: f64, believed: &[Body]) {
        while let [first, second, ..] = self.pending.make_contiguous()
            && (second.time_s - time_s).abs() <= (first.time_s - time_s).abs()
        {
            self.drop_oldest(believed);
        }
    }

    /// Records that the oldest observation belongs to a moment.
    pub(super) fn mark_used(&mut self) {
        self.used_s = self.pending.front().map(|pending| pending.time_s).or(self.used_s);
    }

    /// Whether the oldest observation, or a later one, has belonged to a moment.
    pub(super) fn has_been_used(&self) -> bool {
        let oldest_s = self.pending.front().map(|pending| pending.time_s);
        oldest_s.zip(self.used_s).is_some_and(|(oldest, used)| oldest <= used)
    }

    /// Whether an observation of this time or later has arrived.
    pub(super) fn reaches(&self, time_s: f64) -> bool {
        self.pending.back().is_some_and(|newest| newest.time_s >= time_s)
    }

    /// The first observation later than a time.
    pub(super) fn first_after(&self, time_s: f64) -> Option<&PendingObservation> {
        self.pending.iter().find(|pending| pending.time_s > time_s)
    }
}
