//! Construction of the flow graph: links between detections, with their costs.
//!
//! Links lead over up to `max_gap` frames. Candidates are found by a sweep along x, so the time grows with the number
//! of detections and links, not with the square of a frame's detections.

use std::ops::Range;

use super::detection::{Detection, Detections};
use super::graph::{Cost, FlowGraph, fixed};
use crate::Result;

/// Cost model of links between two detections.
pub trait Affinity {
    /// Cost of a link over `gap` frames; `None` where there is none.
    fn link_cost(&self, from: &Detection, to: &Detection, gap: u32) -> Option<f64>;
    /// Largest distance of a link along x, in the detections' units.
    fn reach(&self, from: &Detection, gap: u32) -> f64;
}

/// Prices of tracks and detections.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prices {
    /// Price of a track's beginning, and of its end.
    pub birth: f64,
    /// Offset of a detection's cost, which is the offset minus the detection's score.
    pub detection_offset: f64,
}

/// Builds the graph; node i is detection i.
///
/// # Errors
/// A cost beyond the graph's range.
pub fn build(
    detections: &Detections,
    prices: &Prices,
    max_gap: u32,
    affinity: &impl Affinity,
) -> Result<FlowGraph> {
    let birth = fixed("birth_cost", prices.birth)?;
    let mut graph = FlowGraph::with_capacity(birth, birth, detections.all.len());
    let frames = detections.frames();
    let by_x: Vec<Vec<u32>> = frames.iter().map(|(_, range)| sorted_by_x(detections, range)).collect();
    let mut links: Vec<(u32, Cost)> = Vec::new();
    for (index, (frame, range)) in frames.iter().enumerate() {
        for node in range.clone() {
            let from = &detections.all[node];
            links.clear();
            for (later, others) in frames[index + 1..].iter().zip(&by_x[index + 1..]) {
                let gap = later.0 - frame;
                if gap > max_gap {
                    break;
                }
                let reach = affinity.reach(from, gap);
                let begin =
                    others.partition_point(|o| detections.all[*o as usize].place.x < from.place.x - reach);
                let before = links.len();
                for other in &others[begin..] {
                    let to = &detections.all[*other as usize];
                    if to.place.x > from.place.x + reach {
                        break;
                    }
                    if let Some(cost) = affinity.link_cost(from, to, gap) {
                        links.push((*other, fixed("link_cost", cost)?));
                    }
                }
                links[before..].sort_unstable_by_key(|(other, _)| *other);
            }
            let cost = fixed("detection_offset", prices.detection_offset - from.score)?;
            graph.push(cost, links.iter().copied());
        }
    }
    Ok(graph)
}

fn sorted_by_x(detections: &Detections, range: &Range<usize>) -> Vec<u32> {
    let mut nodes: Vec<u32> = range.clone().map(|n| n as u32).collect();
    nodes.sort_by(|a, b| detections.all[*a as usize].place.x.total_cmp(&detections.all[*b as usize].place.x));
    nodes
}
