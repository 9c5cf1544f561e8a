//! Flow graph of figure 2: detections as nodes with a cost, links between them, and a price for each track.
//!
//! The paper draws every detection as two nodes with an inner edge; here the two are one entry with an inner cost,
//! incoming and outgoing links. Source and sink are not stored: every track pays [`FlowGraph::birth`] once and
//! [`FlowGraph::death`] once.

use crate::{Error, Result};

/// A cost in billionths. Integers have the same sum in any order, so an optimum and its dual bound are equal to the
/// last digit, and scores of up to nine decimals are exact.
pub type Cost = i64;

/// Units of [`Cost`] in 1.
pub const UNITS: f64 = 1e9;

/// Largest absolute cost: sums along any path of a graph then stay far inside 64 bits.
pub const MAX_COST: f64 = 1e6;

/// Converts a cost to billionths.
///
/// # Errors
/// A number that is not finite or beyond [`MAX_COST`]; `what` is its name in the error.
pub fn fixed(what: &str, cost: f64) -> Result<Cost> {
    if cost.is_nan() || cost.abs() > MAX_COST {
        return Err(Error::option(what, format!("makes a cost of {cost}; costs lie between ±{MAX_COST:e}")));
    }
    Ok((cost * UNITS).round() as Cost)
}

/// Detections and the links between them, ordered by time: a link always leads to a higher index.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FlowGraph {
    birth: Cost,
    death: Cost,
    node_costs: Vec<Cost>,
    /// Index of each node's first link; one entry more than there are nodes.
    first: Vec<u32>,
    targets: Vec<u32>,
    link_costs: Vec<Cost>,
}

impl FlowGraph {
    /// Graph without nodes and links, with capacity for `nodes` nodes.
    pub fn with_capacity(birth: Cost, death: Cost, nodes: usize) -> Self {
        Self {
            birth,
            death,
            node_costs: Vec::with_capacity(nodes),
            first: vec![0],
            targets: Vec::new(),
            link_costs: Vec::new(),
        }
    }

    /// Adds the next node with its outgoing links; their targets, which have higher indices, are added later.
    pub fn push(&mut self, cost: Cost, links: impl IntoIterator<Item = (u32, Cost)>) {
        debug_assert!(self.targets.len() < u32::MAX as usize);
        self.node_costs.push(cost);
        for (target, link_cost) in links {
            debug_assert!(target as usize >= self.node_costs.len());
            self.targets.push(target);
            self.link_costs.push(link_cost);
        }
        self.first.push(self.targets.len() as u32);
    }

    /// Price of a track's beginning.
    pub fn birth(&self) -> Cost {
        self.birth
    }

    /// Price of a track's end.
    pub fn death(&self) -> Cost {
        self.death
    }

    /// Number of nodes.
    pub fn node_count(&self) -> usize {
        self.node_costs.len()
    }

    /// Number of links.
    pub fn link_count(&self) -> usize {
        self.targets.len()
    }

    /// Cost of a node on a track; negative where the detection lowers the total.
    pub fn node_cost(&self, node: usize) -> Cost {
        self.node_costs[node]
    }

    /// Indices of a node's outgoing links.
    pub fn links_of(&self, node: usize) -> std::ops::Range<usize> {
        self.first[node] as usize..self.first[node + 1] as usize
    }

    /// Target node of a link.
    pub fn target(&self, link: usize) -> usize {
        self.targets[link] as usize
    }

    /// Cost of a link.
    pub fn link_cost(&self, link: usize) -> Cost {
        self.link_costs[link]
    }

    /// Cheapest link from one node to another.
    pub fn link_between(&self, from: usize, to: usize) -> Option<usize> {
        self.links_of(from).filter(|l| self.target(*l) == to).min_by_key(|l| self.link_cost(*l))
    }
}
