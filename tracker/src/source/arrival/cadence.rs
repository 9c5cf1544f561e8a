//! Capture times of a camera whose frames have no time stamps: only their arrival times are known.
//!
//! The camera films at a steady rate; the network delays each frame by a varying amount and loses a few. Frame `n`
//! arrives at `start + interval · n + delay`, and the number of each frame is estimated:
//! - From time to time all remembered frames are numbered together by maximum likelihood over intervals and phases: a
//!   frame that is lost or that arrives in its neighbour's interval costs [`IRREGULAR_COST`], and delays are uniform.
//! - The line below the arrivals over the numbers (the edge of their lower convex hull below their middle, as in S. B.
//!   Moon, P. Skelly and D. Towsley, "Estimation and removal of clock skew from network delay measurements", INFOCOM
//!   1999) gives the arrival of a frame without delay.
//!
//! Delays that vary by nearly a whole interval leave the numbers of some frames uncertain; the time of such a frame is
//! off by one interval.

use std::collections::VecDeque;

/// Number of remembered frames: 20 seconds at 12 frames/s.
const FRAMES: usize = 256;
/// Number of frames between two numberings of all remembered frames, and the least number of frames for the first.
const RENUMBER_EVERY: usize = 16;
/// Number of phases tried for each interval.
const PHASES: usize = 32;
/// Number of frames from which on the interval is searched for near the last one only.
const CERTAIN_FRAMES: usize = 64;
/// Negative logarithm of the probability that a frame is lost: one in fifty.
const IRREGULAR_COST: f64 = 4.0;
/// Least width of the delays in the likelihood, and least tolerance of the line, in intervals.
const LEAST_WIDTH: f64 = 0.01;
const LEAST_TOLERANCE: f64 = 0.02;
/// Share of lost or doubled frames above which the interval is uncertain, and above which the camera is taken to film
/// unevenly.
const UNCERTAIN: f64 = 0.12;
const UNEVEN: f64 = 0.2;
/// Silence after which the estimation starts again, seconds.
const SILENCE_S: f64 = 30.0;

/// Steady clock of a camera, estimated from the arrival times of its frames.
#[derive(Debug, Clone, Default)]
pub(super) struct Cadence {
    /// Number and arrival time (seconds) of the latest frames.
    frames: VecDeque<(i64, f64)>,
    /// Number of frames that have arrived.
    count: usize,
    /// Latest numbering of all remembered frames.
    numbering: Option<FrameNumbering>,
}

/// A numbering of the remembered frames.
#[derive(Debug, Clone, Copy)]
struct FrameNumbering {
    /// Time between two frames, seconds.
    interval_s: f64,
    /// Delay of the first remembered frame, intervals.
    phase: f64,
    /// Difference of the largest and the smallest delay, intervals.
    width: f64,
    /// Number of steps between consecutive frames that are not 1.
    irregular: usize,
    /// Negative logarithm of the likelihood.
    cost: f64,
}

/// The line `time = start + interval · number` below all arrivals.
#[derive(Debug, Clone, Copy)]
struct Envelope {
    start_s: f64,
    interval_s: f64,
}

impl Cadence {
    /// Capture time of the next frame, which arrives at `arrival_s`, seconds: the arrival itself as long as the
    /// interval is unknown, and where the camera films unevenly.
    pub(super) fn next(&mut self, arrival_s: f64) -> f64 {
        let latest = self.frames.back().copied();
        if latest.is_some_and(|(_, latest_s)| arrival_s < latest_s || arrival_s > latest_s + SILENCE_S) {
            *self = Self::default();
        }
        if self.frames.len() >= RENUMBER_EVERY && self.count.is_multiple_of(RENUMBER_EVERY) {
            self.number_all();
        }
        self.count += 1;
        let number = self.number(arrival_s);
        self.frames.push_back((number, arrival_s));
        if self.frames.len() > FRAMES {
            self.frames.pop_front();
        }
        match (self.envelope(), self.numbering) {
            (Some(line), Some(numbering)) if !self.exceeds(numbering, UNEVEN) => {
                line.start_s + line.interval_s * number as f64
            }
            _ => arrival_s,
        }
    }

    fn exceeds(&self, numbering: FrameNumbering, part: f64) -> bool {
        numbering.irregular as f64 > part * self.frames.len() as f64
    }

    /// Number of the next frame by the line under the latest ones.
    fn number(&self, arrival_s: f64) -> i64 {
        let latest = self.frames.back().map_or(-1, |(number, _)| *number);
        match (self.envelope(), self.numbering) {
            (Some(line), Some(numbering)) => {
                // Half of the interval that the delays leave free, because the line is not exact.
                let tolerance = (0.5 * (1.0 - numbering.width)).max(LEAST_TOLERANCE);
                (((arrival_s - line.start_s) / line.interval_s + tolerance).floor() as i64).max(latest)
            }
            _ => latest + 1,
        }
    }

    fn number_all(&mut self) {
        let count = self.frames.len();
        let near = self.envelope().filter(|_| {
            count >= CERTAIN_FRAMES && self.numbering.is_some_and(|last| !self.exceeds(last, UNCERTAIN))
        });
        // One step changes the phase by 0.15 (near) or 0.3 intervals between the first and the last frame.
        let (middle_s, step, steps) = match near {
            Some(line) => (line.interval_s, 0.15 / count as f64, 3),
            None => (self.median_interval_s(), 0.3 / count as f64, count as i64 / 2),
        };
        let intervals_s = (-steps..=steps).map(|i| middle_s * (1.0 + step * i as f64)).filter(|s| *s > 0.0);
        let numberings = intervals_s
            .flat_map(|interval_s| (0..PHASES).map(move |i| (interval_s, i as f64 / PHASES as f64)));
        let Some(best) = numberings
            .map(|(interval_s, phase)| self.numbering(interval_s, phase))
            .min_by(|a, b| a.cost.total_cmp(&b.cost))
        else {
            return;
        };
        let first_s = self.frames[0].1;
        for (number, arrival_s) in &mut self.frames {
            *number = ((*arrival_s - first_s) / best.interval_s + best.phase).floor() as i64;
        }
        self.numbering = Some(best);
    }

    fn numbering(&self, interval_s: f64, phase: f64) -> FrameNumbering {
        let first_s = self.frames[0].1;
        let (mut irregular, mut latest) = (0, -1);
        let (mut earliest_delay, mut latest_delay) = (1.0_f64, 0.0_f64);
        for (_, arrival_s) in &self.frames {
            let due = (arrival_s - first_s) / interval_s + phase;
            let number = due.floor() as i64;
            irregular += usize::from(number - latest != 1);
            latest = number;
            let delay = due - number as f64;
            earliest_delay = earliest_delay.min(delay);
            latest_delay = latest_delay.max(delay);
        }
        let width = latest_delay - earliest_delay;
        let cost = IRREGULAR_COST * irregular as f64 + self.frames.len() as f64 * width.max(LEAST_WIDTH).ln();
        FrameNumbering { interval_s, phase, width, irregular, cost }
    }

    fn median_interval_s(&self) -> f64 {
        let arrivals_s = || self.frames.iter().map(|(_, arrival_s)| *arrival_s);
        let mut intervals_s: Vec<f64> = arrivals_s().skip(1).zip(arrivals_s()).map(|(b, a)| b - a).collect();
        let middle = intervals_s.len() / 2;
        *intervals_s.select_nth_unstable_by(middle, f64::total_cmp).1
    }

    /// Edge of the arrivals' lower hull below their mean number; `None` while there are too few frames.
    fn envelope(&self) -> Option<Envelope> {
        if self.frames.len() < RENUMBER_EVERY {
            return None;
        }
        let (first, first_s) = self.frames[0];
        let mut hull: Vec<(i64, f64)> = Vec::new();
        for (number, arrival_s) in &self.frames {
            let (n, s) = (number - first, arrival_s - first_s);
            if hull.last().is_some_and(|(latest, _)| *latest == n) {
                continue; // The same number again arrives later.
            }
            while let [.., (n0, s0), (n1, s1)] = hull[..] {
                if (n1 - n0) as f64 * (s - s0) > (s1 - s0) * (n - n0) as f64 {
                    break;
                }
                hull.pop();
            }
            hull.push((n, s));
        }
        let middle = self.frames.iter().map(|(n, _)| n - first).sum::<i64>() / self.frames.len() as i64;
        let edge = hull.windows(2).find(|edge| edge[1].0 >= middle)?;
        let interval_s = (edge[1].1 - edge[0].1) / (edge[1].0 - edge[0].0) as f64;
        let start_s = first_s + edge[0].1 - interval_s * (edge[0].0 + first) as f64;
        (interval_s > 0.0).then_some(Envelope { start_s, interval_s })
    }
}
