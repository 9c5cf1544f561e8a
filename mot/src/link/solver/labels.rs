//! Labels of a shortest-path search over split nodes: cost and predecessor.

use super::super::graph::{Cost, FlowGraph};

/// Cost above that of any path; sums of two do not overflow.
pub(super) const FAR: Cost = Cost::MAX / 4;

/// Way in which a path reached a node, or the point of leaving it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Arrived {
    Nowhere,
    /// The path begins there.
    Birth,
    /// Over this link.
    Over(u32),
    /// The node is on a track that lost its rest.
    Freed,
    /// The node is a track's last.
    TrackEnd,
}

/// Way in which a used node lost its follower.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Freed {
    Nowhere,
    /// The path took the following node, and its track's rest.
    Met(u32),
    /// The following node is dropped.
    Dropped(u32),
}

/// End of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PathEnd {
    /// A free node, with a death.
    Node(u32),
    /// A used node whose rest was given away, with a death.
    FreedNode(u32),
    /// A track's first node: its birth is saved.
    TrackStart(u32),
    /// A track's first node is dropped, after everything behind it.
    DroppedStart(u32),
}

/// All labels of a search.
pub(super) struct PathLabels {
    /// For each link: about to leave over it.
    pub(super) over: Vec<(Cost, Arrived)>,
    /// For each free node: ending there, before the death.
    pub(super) end: Vec<(Cost, Arrived)>,
    /// For each used node: arriving in front of it, to take over its track's rest.
    pub(super) met: Vec<(Cost, Arrived)>,
    /// For each used node: its rest is gone.
    pub(super) freed: Vec<(Cost, Freed)>,
    is_new_link: Vec<bool>,
    is_new_met: Vec<bool>,
    is_new_freed: Vec<bool>,
}

impl PathLabels {
    pub(super) fn unreached(graph: &FlowGraph) -> Self {
        let (nodes, links) = (graph.node_count(), graph.link_count());
        Self {
            over: vec![(FAR, Arrived::Nowhere); links],
            end: vec![(FAR, Arrived::Nowhere); nodes],
            met: vec![(FAR, Arrived::Nowhere); nodes],
            freed: vec![(FAR, Freed::Nowhere); nodes],
            is_new_link: vec![false; links],
            is_new_met: vec![false; nodes],
            is_new_freed: vec![false; nodes],
        }
    }

    /// Clears the labels of some nodes and their links.
    pub(super) fn forget(&mut self, graph: &FlowGraph, nodes: &[u32]) {
        for node in nodes.iter().map(|n| *n as usize) {
            self.end[node] = (FAR, Arrived::Nowhere);
            self.met[node] = (FAR, Arrived::Nowhere);
            self.freed[node] = (FAR, Freed::Nowhere);
            self.is_new_met[node] = false;
            self.is_new_freed[node] = false;
            self.over[graph.links_of(node)].fill((FAR, Arrived::Nowhere));
            self.is_new_link[graph.links_of(node)].fill(false);
        }
    }

    pub(super) fn leave_over(&mut self, link: usize, cost: Cost, how: Arrived) {
        if cost < self.over[link].0 {
            self.over[link] = (cost, how);
            self.is_new_link[link] = true;
        }
    }

    pub(super) fn end_at(&mut self, node: usize, cost: Cost, how: Arrived) {
        if cost < self.end[node].0 {
            self.end[node] = (cost, how);
        }
    }

    pub(super) fn meet(&mut self, node: usize, cost: Cost, how: Arrived) {
        if cost < self.met[node].0 {
            self.met[node] = (cost, how);
            self.is_new_met[node] = true;
        }
    }

    /// Sets the label of a freed node if this is cheaper. Returns whether it is.
    pub(super) fn free(&mut self, node: usize, cost: Cost, how: Freed) -> bool {
        let is_cheaper = cost < self.freed[node].0;
        if is_cheaper {
            self.freed[node] = (cost, how);
            self.is_new_freed[node] = true;
        }
        is_cheaper
    }

    /// Whether a link's label has changed since the last call; likewise the two functions below.
    pub(super) fn take_link(&mut self, link: usize) -> bool {
        std::mem::take(&mut self.is_new_link[link])
    }

    pub(super) fn take_met(&mut self, node: usize) -> bool {
        std::mem::take(&mut self.is_new_met[node])
    }

    pub(super) fn take_freed(&mut self, node: usize) -> bool {
        std::mem::take(&mut self.is_new_freed[node])
    }
}
