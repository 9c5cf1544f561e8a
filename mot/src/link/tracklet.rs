//! Tracklets, which are tracks that may be parts of longer ones, and the graph over them.

use super::detection::Detections;
use super::graph::{Cost, FlowGraph, fixed};
use super::motion::{MotionModel, TrackletEnd};
use crate::Result;

/// The two ends of a tracklet.
#[derive(Debug, Clone, PartialEq)]
pub struct Ends {
    head: TrackletEnd,
    tail: TrackletEnd,
}

impl Ends {
    /// Ends of tracks over detections, in their order; a track has at least one detection.
    pub fn of(detections: &Detections, tracks: &[Vec<u32>], model: &MotionModel) -> Vec<Self> {
        let ends = |track: &Vec<u32>| {
            Some(Self { head: model.head(detections, track)?, tail: model.tail(detections, track)? })
        };
        tracks.iter().filter_map(ends).collect()
    }
}

/// Graph whose nodes are tracklets, ordered by their beginning: each has its inner cost, and links lead from an end to
/// a later beginning.
///
/// # Errors
/// A cost beyond the graph's range.
pub fn graph(
    ends: &[Ends],
    inner_costs: &[f64],
    birth_cost: f64,
    max_gap: u32,
    model: &MotionModel,
) -> Result<FlowGraph> {
    let birth = fixed("birth_cost", birth_cost)?;
    let mut graph = FlowGraph::with_capacity(birth, birth, ends.len());
    let mut links: Vec<(u32, Cost)> = Vec::new();
    for (from, inner) in ends.iter().zip(inner_costs) {
        links.clear();
        let begin = ends.partition_point(|e| e.head.frame <= from.tail.frame);
        for (other, to) in ends.iter().enumerate().skip(begin) {
            if to.head.frame - from.tail.frame > max_gap {
                break;
            }
            if let Some(cost) = model.cost(&from.tail, &to.head) {
                links.push((other as u32, fixed("cost of a link", cost)?));
            }
        }
        graph.push(fixed("cost of a tracklet", *inner)?, links.iter().copied());
    }
    Ok(graph)
}
