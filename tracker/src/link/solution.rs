//! Tracks over a graph, and what they cost.

use super::graph::{Cost, FlowGraph, UNITS};

/// Disjoint tracks over the nodes of a [`FlowGraph`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Solution {
    /// The nodes of each track in time order; tracks by their first node.
    pub tracks: Vec<Vec<u32>>,
    /// Sum of everything the tracks pay.
    pub total: Total,
    /// No tracks whatever over this graph cost less: the certificate. Equal to `total` where the solver is exact.
    pub bound: Total,
}

/// A sum of costs, in billionths; wide enough for any graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Total(pub i128);

impl Total {
    /// As a number.
    pub fn value(self) -> f64 {
        self.0 as f64 / UNITS
    }
}

impl Solution {
    /// Reads the tracks off their parts: which nodes are used, and which node follows which.
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

/// What tracks over a graph cost, counted link by link.
///
/// # Panics
/// Where two nodes follow each other in a track without a link between them.
pub fn cost_of(graph: &FlowGraph, tracks: &[Vec<u32>]) -> Total {
    let mut sum = 0i128;
    for track in tracks {
        sum += i128::from(graph.birth()) + i128::from(graph.death());
        sum += track.iter().map(|n| i128::from(graph.node_cost(*n as usize))).sum::<i128>();
        for pair in track.windows(2) {
            let link = graph.link_between(pair[0] as usize, pair[1] as usize);
            let cost: Option<Cost> = link.map(|l| graph.link_cost(l));
            #[allow(clippy::expect_used)]
            // Only a solver's defect leads here, and no figure of it may be believed.
            let cost = cost.expect("a track follows links of its graph");
            sum += i128::from(cost);
        }
    }
    Total(sum)
}
