//! Motion model: likelihood that one detection, or a tracklet, continues in another.
//!
//! Along each axis a person's position and velocity are estimated by the filter of
//! [`white_noise_acceleration`](crate::white_noise_acceleration). With m, P the state at the end of one tracklet, predicted to the beginning of the other, and n, Q the
//! state that the other's own detections give at its beginning, a link costs
//!
//! ```text
//! weight · −ln [ N(n − m; 0, P + Q) / (N(v; 0, V + Qvv) · N(0; 0, S₀)) ]
//! ```
//!
//! per axis: the log-likelihood ratio of the second as a continuation of the first and on its own (its velocity v from
//! the prior V), relative to the most certain link, of two detections one frame apart at one place (variance S₀). The
//! uncertainty of a prediction grows with the gap, and so does the cost: no other price of a gap is needed. A single
//! detection is a tracklet with unknown velocity, so one model serves all graphs.
//!
//! Lengths are in heights of the person and times in frames; the constants are in heights and seconds, so that neither
//! the size of the picture nor its rate changes them.

use nalgebra::{Matrix1, Point1, Vector1};

use super::build::Affinity;
use super::detection::{Detection, Detections, colour_distance};
use crate::histogram::Histogram;
use crate::white_noise_acceleration::State;

/// Standard deviation of a detection's position, heights.
const JITTER: f64 = 0.045;
/// Standard deviation of an unknown velocity, heights per second.
const SPEED_PER_S: f64 = 0.9;
/// Variance that a velocity gains in a second, heights² per second³.
const TURN_PER_S3: f64 = 0.08;
/// Foreshortening of the floor: vertical motion in the picture, relative to the same motion across.
const SLANT: f64 = 0.35;
/// Standard deviation of the logarithm of a detection's height, and the variance that it gains in a second.
const SIZE_JITTER: f64 = 0.09;
const SIZE_GROWTH_PER_S: f64 = 0.025;
/// Cost of a unit of negative log-likelihood.
const WEIGHT: f64 = 0.25;
/// Cost of a second without a detection between detections: misses are rare, and long ones rarer.
const MISS_COST_PER_S: f64 = 8.0;
/// Gates: largest deviation from the prediction, in standard deviations over all axes together, for detections and for
/// tracklets.
const DETECTION_GATE: f64 = 5.0;
const TRACKLET_GATE: f64 = 2.7;
/// Length of a tracklet's end from which its velocity is estimated, seconds.
const WINDOW_S: f64 = 0.6;
/// Mean squared Hellinger distance of one person's colours a moment later.
const COLOUR_CHANGE: f64 = 0.1;

/// Variance of a quantity without prior knowledge, heights² (per frame²).
const UNKNOWN: f64 = 1e6;

/// Affinity by motion; lengths in heights, times in frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionModel {
    place_variance: f64,
    /// Variance of an unknown velocity, along each axis.
    velocity_variance: [f64; 2],
    /// Variance that a velocity gains in a frame, along each axis.
    turn_variance: [f64; 2],
    size_variance: f64,
    size_growth: f64,
    gate: f64,
    miss_cost: f64,
    window: u32,
}

/// State of a tracklet at one of its ends, from its own detections.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackletEnd {
    /// Frame of the end.
    pub frame: u32,
    axes: [AxisState; 2],
    log_scale: f64,
    log_scale_variance: f64,
    colours: Option<Histogram>,
}

/// Position and velocity (per frame, in time's direction) along an axis, and their covariance, in heights.
type AxisState = State<1>;

impl MotionModel {
    /// Model of links between detections.
    pub fn of_detections(frames_per_s: f64, on_floor: bool) -> Self {
        Self {
            miss_cost: MISS_COST_PER_S / frames_per_s,
            gate: DETECTION_GATE,
            ..Self::of_tracklets(frames_per_s, on_floor)
        }
    }

    /// Model of links between tracklets: the gap itself has no price.
    pub fn of_tracklets(frames_per_s: f64, on_floor: bool) -> Self {
        let frame_s = 1.0 / frames_per_s;
        let slant = if on_floor { 1.0 } else { SLANT };
        let along = |variance: f64| [variance, variance * slant * slant];
        Self {
            place_variance: JITTER * JITTER,
            velocity_variance: along((SPEED_PER_S * frame_s).powi(2)),
            turn_variance: along(TURN_PER_S3 * frame_s.powi(3)),
            size_variance: SIZE_JITTER * SIZE_JITTER,
            size_growth: SIZE_GROWTH_PER_S * frame_s,
            gate: TRACKLET_GATE,
            miss_cost: 0.0,
            window: (WINDOW_S * frames_per_s).round().max(2.0) as u32,
        }
    }

    /// State at the last frame of a track.
    pub fn tail(&self, detections: &Detections, track: &[u32]) -> Option<TrackletEnd> {
        let last = detections.all[*track.last()? as usize].frame;
        let from = track.partition_point(|n| detections.all[*n as usize].frame + self.window <= last);
        self.end(detections, track[from..].iter(), self.velocity_variance)
    }

    /// State at the first frame of a track, without a prior, which the preceding track provides.
    pub fn head(&self, detections: &Detections, track: &[u32]) -> Option<TrackletEnd> {
        let first = detections.all[*track.first()? as usize].frame;
        let to = track.partition_point(|n| detections.all[*n as usize].frame < first + self.window);
        let mut end = self.end(detections, track[..to].iter().rev(), [UNKNOWN; 2])?;
        end.axes = end.axes.map(|axis| axis.reversed());
        Some(end)
    }

    /// Filters detections in the given order, with time or against it, to the last one.
    fn end<'a>(
        &self,
        detections: &Detections,
        nodes: impl Iterator<Item = &'a u32> + Clone,
        velocity_variance: [f64; 2],
    ) -> Option<TrackletEnd> {
        let mut found = nodes.map(|n| &detections.all[*n as usize]);
        let first = found.next()?;
        let mut end = self.single(first, velocity_variance);
        end.colours = first.colours.as_deref().cloned();
        let mut count = 1.0;
        for detection in found {
            let frames = f64::from(detection.frame.abs_diff(end.frame));
            for axis in 0..2 {
                let state = &mut end.axes[axis];
                state.predict(frames, self.turn_variance[axis]);
                state.update(&Point1::new(detection.place[axis]), &Matrix1::new(self.place_variance));
            }
            end.frame = detection.frame;
            count += 1.0;
            end.log_scale += (detection.scale().ln() - end.log_scale) / count;
            if let (Some(all), Some(new)) = (&mut end.colours, &detection.colours) {
                all.add(new, f64::INFINITY);
            }
        }
        end.log_scale_variance /= count;
        Some(end)
    }

    fn single(&self, detection: &Detection, velocity_variance: [f64; 2]) -> TrackletEnd {
        let axis = |i: usize| still(detection.place[i], self.place_variance, velocity_variance[i]);
        TrackletEnd {
            frame: detection.frame,
            axes: [axis(0), axis(1)],
            log_scale: detection.scale().ln(),
            log_scale_variance: self.size_variance,
            colours: None,
        }
    }

    /// Cost of the link from a tracklet's end to a later one's beginning; `None` outside the gate.
    pub fn cost(&self, from: &TrackletEnd, to: &TrackletEnd) -> Option<f64> {
        let colour_distance = from.colours.as_ref().zip(to.colours.as_ref()).map(|(a, b)| a.distance(b));
        self.cost_with(from, to, colour_distance)
    }

    fn cost_with(&self, from: &TrackletEnd, to: &TrackletEnd, colour_distance: Option<f64>) -> Option<f64> {
        let gap = f64::from(to.frame - from.frame);
        let height = (0.5 * (from.log_scale + to.log_scale)).exp();
        let size_variance = from.log_scale_variance + to.log_scale_variance + self.size_growth * gap;
        let surest_size = 2.0 * self.size_variance + self.size_growth;
        let mut deviation2 = (to.log_scale - from.log_scale).powi(2) / size_variance;
        // Twice the negative logarithm of the ratio.
        let mut unlikely = deviation2 + (size_variance / surest_size).ln();
        for axis in 0..2 {
            let velocity_variance = self.velocity_variance[axis];
            let (mut expected, seen) = (from.axes[axis], &to.axes[axis]);
            expected.predict(gap, self.turn_variance[axis]);
            let pp = (expected.position_covariance + seen.position_covariance).x;
            let pv = (expected.cross_covariance + seen.cross_covariance).x;
            let vv = (expected.velocity_covariance + seen.velocity_covariance).x;
            let determinant = pp * vv - pv * pv;
            let place = (seen.position - expected.position).x / height;
            let velocity = (seen.velocity - expected.velocity).x / height;
            let off =
                (vv * place * place - 2.0 * pv * place * velocity + pp * velocity * velocity) / determinant;
            let alone = velocity_variance + seen.velocity_covariance.x;
            let surest = 2.0 * self.place_variance + velocity_variance;
            deviation2 += off;
            unlikely +=
                off - (seen.velocity.x / height).powi(2) / alone + (determinant / (alone * surest)).ln();
        }
        if deviation2 > self.gate * self.gate {
            return None;
        }
        // The squared distance is exponentially distributed, so its negative log-likelihood is proportional to it.
        unlikely += colour_distance.map_or(0.0, |d| 2.0 * d * d / COLOUR_CHANGE);
        Some(0.5 * WEIGHT * unlikely.max(0.0) + self.miss_cost * (gap - 1.0))
    }
}

/// State of a person at this position whose velocity is unknown.
fn still(position: f64, position_variance: f64, velocity_variance: f64) -> AxisState {
    let position_covariance = Matrix1::new(position_variance);
    State::new(Point1::new(position), Vector1::zeros(), position_covariance, velocity_variance)
}

impl Affinity for MotionModel {
    fn link_cost(&self, from: &Detection, to: &Detection, _gap: u32) -> Option<f64> {
        let distance = colour_distance(from, to);
        let (from, to) = (self.single(from, self.velocity_variance), self.single(to, [UNKNOWN; 2]));
        self.cost_with(&from, &to, distance)
    }

    fn reach(&self, from: &Detection, gap: u32) -> f64 {
        let frames = f64::from(gap);
        let mut next = still(0.0, 2.0 * self.place_variance, self.velocity_variance[0]);
        next.predict(frames, self.turn_variance[0]);
        let variance = next.position_covariance.x;
        // The other box may be higher, as far as the gate permits.
        let size_variance = 2.0 * self.size_variance + self.size_growth * frames;
        self.gate * variance.sqrt() * from.scale() * (0.5 * self.gate * size_variance.sqrt()).exp()
    }
}
