//! Tracks over a graph, and their cost.

use super::graph::{Cost, FlowGraph, UNITS};

/// Disjoint tracks over the nodes of a [`FlowGraph`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Solution {
    /// Nodes of each track in time order; tracks by their first node.
    pub tracks: Vec<Vec<u32>>,
    /// Total cost of the tracks.
    pub total: Total,
    /// Lower bound of the cost of any tracks over this graph: the certificate. Equal to `total` where the solver is
    /// exact.
    pub bound: Total,
}

/// A sum of costs in billionths; wide enough for any graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Total(pub i128);

impl Total {
    /// The sum as a floating-point number.
    pub fn value(self) -> f64 {
        self.0 as f64 / UNITS
    }
}

impl Solution {
    /// Assembles the tracks from the used nodes and each node's follower.
    pub(super) fn assemble(
        graph: &FlowGraph,
        is_used: impl Fn(usize) -> bool,
        next: &[Option<u32>],
        bound: impl FnOnce(Total) -> Total,
    ) -> Self {
        let mut is_first = vec![true; graph.node_count()];
        for follower in next.iter().flatten() {
            is_first[*follower as usize] = false;
        }
        let mut tracks = Vec::new();
        for start in (0..graph.node_count()).filter(|n| is_first[*n] && is_used(*n)) {
            let mut track = vec![start as u32];
            let mut node = start;
            while let Some(follower) = next[node] {
                track.push(follower);
                node = follower as usize;
            }
            tracks.push(track);
        }
        let total = cost_of(graph, &tracks);
        Self { tracks, total, bound: bound(total) }
    }
}

/// Cost of tracks over a graph, summed link by link.
///
/// # Panics
/// A track with two consecutive nodes that no link joins.
pub fn cost_of(graph: &FlowGraph, tracks: &[Vec<u32>]) -> Total {
    let mut sum = 0i128;
    for track in tracks {
        sum += i128::from(graph.birth()) + i128::from(graph.death());
        sum += track.iter().map(|n| i128::from(graph.node_cost(*n as usize))).sum::<i128>();
        for pair in track.windows(2) {
            let link = graph.link_between(pair[0] as usize, pair[1] as usize);
            let cost: Option<Cost> = link.map(|l| graph.link_cost(l));
            #[allow(clippy::expect_used)]
            // Only a defect of a solver leads here, and none of its figures can be trusted.
            let cost = cost.expect("a track follows links of its graph");
            sum += i128::from(cost);
        }
    }
    Total(sum)
}
