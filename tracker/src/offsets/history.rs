//! One camera's responses over time, with what stands still taken out.

use std::collections::VecDeque;

use super::filter::quantized;

/// Frames are taken in at most this often, on average.
const LEAST_INTERVAL_S: f64 = 1.0 / 16.0;
/// Time constant of the running mean that is taken out of the responses: somebody who stays for longer is furniture.
const MEAN_S: f64 = 5.0;
/// The mean begins as that of this many seconds, which are not used: otherwise somebody who is there at the beginning would
/// mark in each camera when *it* began.
const WARM_UP_S: f64 = 2.0;
/// After a gap longer than this, the mean begins anew.
const LONGEST_GAP_S: f64 = 2.0;
/// Share of the newest interval in the running mean of intervals.
const NEWEST: f64 = 0.05;

/// What one camera has observed.
#[derive(Debug, Clone, Default)]
pub(super) struct History {
    observations: VecDeque<Observation>,
    latest_s: Option<f64>,
    /// From when on the next frame is taken in.
    due_s: Option<f64>,
    /// When the mean began.
    begun_s: f64,
    mean: Vec<f32>,
    interval_s: Option<f64>,
}

/// A camera's responses at one time.
#[derive(Debug, Clone)]
pub(super) struct Observation {
    pub(super) time_s: f64,
    /// Differences from the mean, quantized.
    pub(super) responses: Vec<i8>,
    /// For each other camera, the norm over the cells that it sees, too.
    pub(super) norms: Vec<f32>,
}

impl History {
    /// Whether a frame of this time is to be taken in.
    pub(super) fn is_due(&self, time_s: f64) -> bool {
        time_s.is_finite()
            && self.latest_s.is_none_or(|latest_s| time_s > latest_s)
            && self.due_s.is_none_or(|due_s| time_s >= due_s)
    }

    /// Takes in the responses of a frame that is due. Returns whether it can be compared with other cameras' frames: not
    /// while the mean begins.
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
        // The plain mean so far, until it is as long as the running mean reaches.
        let share = elapsed_s / (time_s - self.begun_s).min(MEAN_S);
        for (mean, response) in self.mean.iter_mut().zip(responses) {
            *mean += share as f32 * (response - *mean);
        }
        if time_s - self.begun_s < WARM_UP_S {
            return false;
        }
        let moving = responses.iter().zip(&self.mean).map(|(response, mean)| quantized(response - mean));
        let responses: Vec<i8> = moving.collect();
        self.observations.push_back(Observation { time_s, norms: norms(&responses), responses });
        true
    }

    /// The latest frame that can be compared.
    pub(super) fn latest(&self) -> Option<&Observation> {
        self.observations.back()
    }

    /// Observations within a span of time, in order.
    pub(super) fn between(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = &Observation> {
        let first = self.observations.partition_point(|o| o.time_s < from_s);
        self.observations.range(first..).take_while(move |o| o.time_s <= to_s)
    }

    /// Mean time between two frames, of late; 0 before there were two.
    pub(super) fn interval_s(&self) -> f64 {
        self.interval_s.unwrap_or(0.0)
    }

    /// Drops what is older than this.
    pub(super) fn forget_before(&mut self, time_s: f64) {
        let old = self.observations.partition_point(|o| o.time_s < time_s);
        self.observations.drain(..old);
    }
}
