//! Responses of one camera over time, with their static part removed.

use std::collections::VecDeque;

use super::filter::quantized;

/// Least mean interval at which frames are taken in, seconds.
const LEAST_INTERVAL_S: f64 = 1.0 / 16.0;
/// Time constant of the running mean that is subtracted from the responses, seconds: a person who stays for longer
/// counts as furniture.
const MEAN_S: f64 = 5.0;
/// Time over which the mean is first formed, seconds. Its frames are not used: otherwise a person who is there at the
/// beginning would mark in each camera when *it* began.
const WARM_UP_S: f64 = 2.0;
/// Longest gap that the mean survives, seconds; after a longer one it begins anew.
const LONGEST_GAP_S: f64 = 2.0;
/// Share of the newest interval in the running mean of intervals.
const NEWEST: f64 = 0.05;

/// Observations of one camera.
#[derive(Debug, Clone, Default)]
pub(super) struct History {
    observations: VecDeque<ResponseFrame>,
    latest_s: Option<f64>,
    /// Time from which on the next frame is taken in, seconds.
    due_s: Option<f64>,
    /// Time at which the mean began, seconds.
    begun_s: f64,
    mean: Vec<f32>,
    interval_s: Option<f64>,
}

/// Responses of a camera at one time.
#[derive(Debug, Clone)]
pub(super) struct ResponseFrame {
    pub(super) time_s: f64,
    /// Differences from the mean, quantized.
    pub(super) responses: Vec<i8>,
    /// Norms over the cells that each other camera sees, too.
    pub(super) norms: Vec<f32>,
}

impl History {
    /// Whether a frame of this time, seconds, is to be taken in.
    pub(super) fn is_due(&self, time_s: f64) -> bool {
        time_s.is_finite()
            && self.latest_s.is_none_or(|latest_s| time_s > latest_s)
            && self.due_s.is_none_or(|due_s| time_s >= due_s)
    }

    /// Takes in the responses of a frame that is due. Returns whether it can be compared with other cameras' frames:
    /// `false` while the mean begins.
    pub(super) fn push(&mut self, time_s: f64, responses: &[f32], norms: impl Fn(&[i8]) -> Vec<f32>) -> bool {
        let elapsed_s = self.latest_s.map_or(f64::INFINITY, |latest_s| time_s - latest_s);
        // Jitter may bring two frames close together: a frame can be early by one interval.
        let due_s = self.due_s.map_or(time_s, |due_s| due_s.max(time_s - LEAST_INTERVAL_S));
        self.due_s = Some(due_s + LEAST_INTERVAL_S);
        self.latest_s = Some(time_s);
        if elapsed_s > LONGEST_GAP_S {
            self.begun_s = time_s;
            self.mean.clear();
            self.mean.extend_from_slice(responses);
            return false;
        }
        let interval_s = self.interval_s.get_or_insert(elapsed_s);
        *interval_s += NEWEST * (elapsed_s - *interval_s);
        // The plain mean, until its span is that of the running mean.
        let share = elapsed_s / (time_s - self.begun_s).min(MEAN_S);
        for (mean, response) in self.mean.iter_mut().zip(responses) {
            *mean += share as f32 * (response - *mean);
        }
        if time_s - self.begun_s < WARM_UP_S {
            return false;
        }
        let moving = responses.iter().zip(&self.mean).map(|(response, mean)| quantized(response - mean));
        let responses: Vec<i8> = moving.collect();
        self.observations.push_back(ResponseFrame { time_s, norms: norms(&responses), responses });
        true
    }

    /// The latest frame that can be compared.
    pub(super) fn latest(&self) -> Option<&ResponseFrame> {
        self.observations.back()
    }

    /// Observations within a span of time, in order.
    pub(super) fn between(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = &ResponseFrame> {
        let first = self.observations.partition_point(|o| o.time_s < from_s);
        self.observations.range(first..).take_while(move |o| o.time_s <= to_s)
    }

    /// Mean interval between the latest frames, seconds; 0 before there were two.
    pub(super) fn interval_s(&self) -> f64 {
        self.interval_s.unwrap_or(0.0)
    }

    /// Drops the observations before this time, seconds.
    pub(super) fn forget_before(&mut self, time_s: f64) {
        let old = self.observations.partition_point(|o| o.time_s < time_s);
        self.observations.drain(..old);
    }
}
