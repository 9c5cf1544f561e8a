//! Tracks under the moving-direction constraint (section 5 of the paper): a detection is split into one copy for each
//! outgoing link.
//!
//! A copy of a detection is an outgoing link, so labels belong to links: the label of link *m* is the cost of the
//! cheapest path that is about to leave over *m*, and only labels of links that [`Directions`] allow before it
//! contribute. One more copy has no direction: there a track may end, whichever link it came over.
//!
//! **Exactness.** All copies share the detection's one unit of flow. A network cannot express that (the unit must pass
//! one bottleneck and remember its incoming link), so the constrained problem is not a network flow. As in section
//! 5.2.2, tracks are found one shortest path at a time, and once a copy is on a track all other copies are closed. A
//! path may run back along older tracks and reroute them, within the constraint; solutions that no such path reaches
//! are not found. The result is always feasible, and never better than the optimum *without* the constraint, which is
//! therefore a proven bound: [`Solution::bound`]. Where both are equal the result is optimal.

use super::super::graph::{Cost, FlowGraph};
use super::super::solution::{Solution, Total};
use super::direction::Directions;
use super::labels::{Arrived, Freed, PathEnd, PathLabels};
use super::tracks::WorkingTracks;

/// Largest number of turns of a path from forward to backward and forward again.
const MAX_TURNS: usize = 16;

/// Tracks whose turns the directions all allow; `bound` is the optimum without them.
pub fn solve(graph: &FlowGraph, directions: &Directions, bound: Total) -> Solution {
    let mut search = PathSearch {
        graph,
        directions,
        tracks: WorkingTracks::none(graph),
        labels: PathLabels::unreached(graph),
        is_turning: true,
    };
    for component in components(graph) {
        search.is_turning = true;
        while search.improve(&component) {}
    }
    let tracks = search.tracks;
    let next = tracks.followers(graph);
    Solution::assemble(graph, |n| tracks.is_used[n], &next, |_| bound)
}

/// Connected components of the graph: they are independent, and smaller ones have cheaper paths.
fn components(graph: &FlowGraph) -> Vec<Vec<u32>> {
    let n = graph.node_count();
    let mut parent: Vec<u32> = (0..n as u32).collect();
    for node in 0..n {
        for link in graph.links_of(node) {
            let (a, b) = (root(&mut parent, node as u32), root(&mut parent, graph.target(link) as u32));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); n];
    for node in 0..n as u32 {
        members[root(&mut parent, node) as usize].push(node);
    }
    members.retain(|m| !m.is_empty());
    members
}

/// Representative of a node's component.
fn root(parent: &mut [u32], mut node: u32) -> u32 {
    while parent[node as usize] != node {
        parent[node as usize] = parent[parent[node as usize] as usize];
        node = parent[node as usize];
    }
    node
}

struct PathSearch<'a> {
    graph: &'a FlowGraph,
    directions: &'a Directions,
    tracks: WorkingTracks,
    labels: PathLabels,
    /// Whether paths may run back along older tracks; switched off for good where that led into a cycle.
    is_turning: bool,
}

impl PathSearch<'_> {
    /// Changes the tracks of a component along its cheapest path. Returns whether that lowers the cost.
    fn improve(&mut self, component: &[u32]) -> bool {
        loop {
            self.labels.forget(self.graph, component);
            self.begin(component);
            self.sweep_forward(component);
            if self.is_turning {
                for _ in 0..MAX_TURNS {
                    if !self.sweep_backward(component) {
                        break;
                    }
                    self.sweep_forward(component);
                }
            }
            let Some(end) = self.cheapest_end(component) else { return false };
            if self.tracks.change(self.graph, self.directions, &self.labels, end) {
                return true;
            }
            if !self.is_turning {
                return false;
            }
            self.is_turning = false;
        }
    }

    /// Starts paths: with a birth at a free node, with a birth that takes over the rest of a track, or at a track's
    /// end.
    fn begin(&mut self, component: &[u32]) {
        let (birth, death) = (self.graph.birth(), self.graph.death());
        for node in component.iter().map(|n| *n as usize) {
            if !self.tracks.is_used[node] {
                self.enter(node, birth, Arrived::Birth);
            } else if self.is_turning {
                if self.tracks.come[node].is_some() {
                    self.labels.meet(node, birth, Arrived::Birth);
                }
                if self.tracks.go[node].is_none() {
                    self.leave(node, -death, Arrived::TrackEnd);
                }
            }
        }
    }

    /// Enters a free node: labels its copies.
    fn enter(&mut self, node: usize, cost: Cost, how: Arrived) {
        let cost = cost + self.graph.node_cost(node);
        self.labels.end_at(node, cost, how);
        let come = if let Arrived::Over(link) = how { Some(link as usize) } else { None };
        for go in self.graph.links_of(node) {
            if come.is_none_or(|come| self.directions.allow(come, go)) {
                self.labels.leave_over(go, cost, how);
            }
        }
    }

    /// Leaves a used node over another link, as far as its incoming link allows.
    fn leave(&mut self, node: usize, cost: Cost, how: Arrived) {
        let come = self.tracks.come[node];
        for go in self.graph.links_of(node) {
            let is_new = self.tracks.go[node] != Some(go as u32);
            if is_new && come.is_none_or(|come| self.directions.allow(come as usize, go)) {
                self.labels.leave_over(go, cost, how);
            }
        }
    }

    /// Propagates labels forward in time over links.
    fn sweep_forward(&mut self, component: &[u32]) {
        for node in component.iter().map(|n| *n as usize) {
            if self.labels.take_freed(node) {
                let cost = self.labels.freed[node].0;
                self.leave(node, cost, Arrived::Freed);
            }
            for link in self.graph.links_of(node) {
                if !self.labels.take_link(link) {
                    continue;
                }
                let cost = self.labels.over[link].0 + self.graph.link_cost(link);
                let target = self.graph.target(link);
                let how = Arrived::Over(link as u32);
                if !self.tracks.is_used[target] {
                    self.enter(target, cost, how);
                } else if self.is_turning
                    && self.tracks.come[target] != Some(link as u32)
                    && self.tracks.go[target].is_none_or(|go| self.directions.allow(link, go as usize))
                {
                    self.labels.meet(target, cost, how);
                }
            }
        }
    }

    /// Propagates labels backward in time along the tracks: a track that lost its rest looks for another. `false` where
    /// nothing changed.
    fn sweep_backward(&mut self, component: &[u32]) -> bool {
        let mut has_changed = false;
        for node in component.iter().rev().map(|n| *n as usize) {
            let Some(come) = self.tracks.come[node] else { continue };
            let before = self.tracks.source(come);
            let link_cost = self.graph.link_cost(come as usize);
            if self.labels.take_met(node) {
                let cost = self.labels.met[node].0 - link_cost;
                has_changed |= self.labels.free(before, cost, Freed::Met(node as u32));
            }
            if self.labels.freed[node].0 < super::labels::FAR {
                let cost = self.labels.freed[node].0 - self.graph.node_cost(node) - link_cost;
                has_changed |= self.labels.free(before, cost, Freed::Dropped(node as u32));
            }
        }
        has_changed
    }

    fn cheapest_end(&self, component: &[u32]) -> Option<PathEnd> {
        let (birth, death) = (self.graph.birth(), self.graph.death());
        let mut best = (0, None);
        let mut offer = |cost: Cost, end: PathEnd| {
            if cost < best.0 {
                best = (cost, Some(end));
            }
        };
        for node in component {
            let n = *node as usize;
            offer(self.labels.end[n].0 + death, PathEnd::Node(*node));
            offer(self.labels.freed[n].0 + death, PathEnd::FreedNode(*node));
            if self.tracks.is_used[n] && self.tracks.come[n].is_none() {
                offer(self.labels.met[n].0 - birth, PathEnd::TrackStart(*node));
                offer(self.labels.freed[n].0 - self.graph.node_cost(n) - birth, PathEnd::DroppedStart(*node));
            }
        }
        best.1
    }
}
