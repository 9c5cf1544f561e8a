//! Tracklets: tracks that may be parts of longer ones, with where they come from and where they are going.

use nalgebra::{Point2, Vector2};

use super::affinity::Relative;
use super::detection::Detections;
use super::graph::{Cost, FlowGraph, fixed};
use crate::Result;

/// How a tracklet's motion is read off its ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionOptions {
    /// Frames at an end that tell the motion there.
    pub frames: u32,
    /// Prior of standing still: variance of a place over the variance of a velocity, frames².
    pub prior: f64,
}

/// One end of a tracklet.
#[derive(Debug, Clone, Copy, PartialEq)]
struct End {
    frame: u32,
    place: Point2<f64>,
    /// Per frame.
    velocity: Vector2<f64>,
    log_scale: f64,
}

impl End {
    /// Fits a straight way to the detections `nodes` (in time order), and reads it off at `frame`.
    fn fit(detections: &Detections, nodes: &[u32], frame: u32, prior: f64) -> Self {
        let n = nodes.len() as f64;
        let of = |node: &u32| &detections.all[*node as usize];
        let time = |node: &u32| f64::from(of(node).frame) - f64::from(frame);
        let mean_time = nodes.iter().map(time).sum::<f64>() / n;
        let mean_place = nodes.iter().map(|i| of(i).place.coords).sum::<Vector2<f64>>() / n;
        let log_scale = nodes.iter().map(|i| of(i).scale().ln()).sum::<f64>() / n;
        let (mut spread, mut moved) = (prior, Vector2::zeros());
        for node in nodes {
            let t = time(node) - mean_time;
            spread += t * t;
            moved += (of(node).place.coords - mean_place) * t;
        }
        let velocity = if spread > 0.0 { moved / spread } else { Vector2::zeros() };
        Self { frame, place: Point2::from(mean_place - velocity * mean_time), velocity, log_scale }
    }

    fn after(&self, frames: f64) -> Point2<f64> {
        self.place + self.velocity * frames
    }
}

/// A tracklet's two ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ends {
    begin: End,
    end: End,
}

impl Ends {
    /// Of a track over detections.
    pub fn of(detections: &Detections, track: &[u32], options: &MotionOptions) -> Self {
        let frame = |i: usize| detections.all[track[i] as usize].frame;
        let (first, last) = (frame(0), frame(track.len() - 1));
        let head = track.partition_point(|n| detections.all[*n as usize].frame < first + options.frames);
        let tail = track.partition_point(|n| detections.all[*n as usize].frame + options.frames <= last);
        Self {
            begin: End::fit(detections, &track[..head], first, options.prior),
            end: End::fit(detections, &track[tail..], last, options.prior),
        }
    }
}

/// The graph whose nodes are tracklets, by their beginning: each costs what it costs inside, and links lead from an end to
/// a later beginning.
///
/// # Errors
/// A cost beyond what the graph holds.
pub fn graph(
    ends: &[Ends],
    inner_costs: &[f64],
    birth_cost: f64,
    max_gap: u32,
    affinity: &Relative,
) -> Result<FlowGraph> {
    let birth = fixed("birth cost", birth_cost)?;
    let mut graph = FlowGraph::with_capacity(birth, birth, ends.len());
    let mut links: Vec<(u32, Cost)> = Vec::new();
    for (from, inner) in ends.iter().zip(inner_costs) {
        links.clear();
        let begin = ends.partition_point(|e| e.begin.frame <= from.end.frame);
        for (other, to) in ends.iter().enumerate().skip(begin) {
            let gap = to.begin.frame - from.end.frame;
            if gap > max_gap {
                break;
            }
            if let Some(cost) = join_cost(&from.end, &to.begin, gap, affinity) {
                links.push((other as u32, fixed("cost of a link", cost)?));
            }
        }
        graph.push(fixed("cost of a tracklet", *inner)?, links.iter().copied());
    }
    Ok(graph)
}

/// Both ends must expect each other: the mean of the prediction's errors forwards and backwards counts.
fn join_cost(from: &End, to: &End, gap: u32, affinity: &Relative) -> Option<f64> {
    let frames = f64::from(gap);
    let forwards = (from.after(frames) - to.place).norm();
    let backwards = (to.after(-frames) - from.place).norm();
    let height = 0.5 * (from.log_scale.exp() + to.log_scale.exp());
    affinity.cost(0.5 * (forwards + backwards) / height, to.log_scale - from.log_scale, gap)
}
