//! Two-pass greedy solution of H. Pirsiavash, D. Ramanan and C. C. Fowlkes, "Globally-optimal greedy algorithms for
//! tracking a variable number of objects", CVPR 2011, section 5.3.
//!
//! The cheapest track is taken repeatedly, each by dynamic programming over the graph in time order. A new track may
//! take over the rest of an older one, whose beginning then finds another continuation: a backward pass runs along the
//! old track from the node at which the new one meets it, and a forward pass continues from there. Paths that turn back
//! more than once are not considered, so the result is near the optimum, not always at it.

use super::super::graph::{Cost, FlowGraph};
use super::super::solution::{Solution, Total};

/// Cost above that of any path; sums of two do not overflow.
const FAR: Cost = Cost::MAX / 4;

/// Tracks of nearly the least cost, with the bound that the caller provides: greedy has no certificate of its own.
pub fn solve(graph: &FlowGraph, bound: Total) -> Solution {
    let mut greedy = Greedy::new(graph);
    while greedy.take_cheapest() {}
    Solution::assemble(graph, |n| greedy.is_used[n], &greedy.next, |_| bound)
}

/// Predecessor of a label.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Predecessor {
    Nowhere,
    Birth,
    /// From a free node's label of the first pass.
    First(u32),
    /// From a used node that the backward pass freed at its end.
    Freed(u32),
    /// From a free node's label of the last pass.
    Last(u32),
}

struct Greedy<'a> {
    graph: &'a FlowGraph,
    is_used: Vec<bool>,
    next: Vec<Option<u32>>,
    previous: Vec<Option<u32>>,
    /// First pass: cost of the cheapest path that ends behind a free node, or in front of a used one.
    first: Vec<(Cost, Predecessor)>,
    /// Backward pass: cost at a used node's exit, and the node behind it at which the path met its track.
    freed: Vec<(Cost, u32)>,
    /// Last pass: as the first, for paths that have turned back.
    last: Vec<(Cost, Predecessor)>,
}

impl<'a> Greedy<'a> {
    fn new(graph: &'a FlowGraph) -> Self {
        let n = graph.node_count();
        Self {
            graph,
            is_used: vec![false; n],
            next: vec![None; n],
            previous: vec![None; n],
            first: vec![(FAR, Predecessor::Nowhere); n],
            freed: vec![(FAR, 0); n],
            last: vec![(FAR, Predecessor::Nowhere); n],
        }
    }

    /// Takes the cheapest path. Returns whether it lowers the cost.
    fn take_cheapest(&mut self) -> bool {
        self.pass_forward();
        self.pass_backward();
        self.pass_forward_again();
        let death = self.graph.death();
        let nodes = 0..self.graph.node_count();
        let free = |n: &usize| !self.is_used[*n];
        let plain = nodes.clone().filter(free).map(|n| (self.first[n].0 + death, n)).min();
        let turned = nodes.clone().filter(free).map(|n| (self.last[n].0 + death, n)).min();
        // A used node that gives its rest away may also end there, if it did not end there before.
        let ended = nodes
            .filter(|n| self.is_used[*n] && self.next[*n].is_some())
            .map(|n| (self.freed[n].0 + death, n))
            .min();
        let worth = |end: &(Cost, usize)| end.0 < 0;
        let mut ends: Vec<(Cost, Predecessor)> = Vec::with_capacity(3);
        ends.extend(plain.filter(worth).map(|(cost, n)| (cost, Predecessor::First(n as u32))));
        ends.extend(turned.filter(worth).map(|(cost, n)| (cost, Predecessor::Last(n as u32))));
        ends.extend(ended.filter(worth).map(|(cost, n)| (cost, Predecessor::Freed(n as u32))));
        ends.sort_by_key(|(cost, _)| *cost);
        ends.into_iter().any(|(_, end)| self.take(end))
    }

    /// Dynamic programming in time order over the free nodes.
    fn pass_forward(&mut self) {
        let birth = self.graph.birth();
        self.first.fill((birth, Predecessor::Birth));
        for node in 0..self.graph.node_count() {
            if self.is_used[node] {
                continue;
            }
            self.first[node].0 += self.graph.node_cost(node);
            relax(self.graph, node, self.first[node].0, Predecessor::First(node as u32), &mut self.first);
        }
    }

    /// Propagates costs backward from the nodes at which paths meet a track along that track.
    fn pass_backward(&mut self) {
        for node in (0..self.graph.node_count()).rev() {
            self.freed[node] = (FAR, 0);
            let Some(next) = self.next[node] else { continue };
            let behind = next as usize;
            // At the entry of the node behind: met there, or dropped with the cost of the backward pass.
            let met = self.first[behind].0;
            let dropped = self.freed[behind].0 - self.graph.node_cost(behind);
            let link = self.link(node, behind);
            self.freed[node] = if dropped < met {
                (dropped.min(FAR) - link, self.freed[behind].1)
            } else {
                (met - link, next)
            };
        }
    }

    /// Dynamic programming in time order from all freed nodes.
    fn pass_forward_again(&mut self) {
        self.last.fill((FAR, Predecessor::Nowhere));
        for node in 0..self.graph.node_count() {
            if self.is_used[node] {
                if self.freed[node].0 < FAR / 2 {
                    relax(
                        self.graph,
                        node,
                        self.freed[node].0,
                        Predecessor::Freed(node as u32),
                        &mut self.last,
                    );
                }
            } else if self.last[node].0 < FAR / 2 {
                self.last[node].0 += self.graph.node_cost(node);
                relax(self.graph, node, self.last[node].0, Predecessor::Last(node as u32), &mut self.last);
            }
        }
    }

    fn link(&self, from: usize, to: usize) -> Cost {
        self.graph.link_between(from, to).map_or(0, |l| self.graph.link_cost(l))
    }

    /// Changes the tracks along the path that ends at `end`; `false`, without a change, where it visits a node twice.
    fn take(&mut self, end: Predecessor) -> bool {
        let (mut tail, mut head) = (Vec::new(), Vec::new());
        let mut freed = None;
        let mut at = end;
        let mut meets = None;
        loop {
            at = match at {
                Predecessor::Last(node) => {
                    tail.push(node);
                    self.last[node as usize].1
                }
                Predecessor::Freed(node) => {
                    let met = self.freed[node as usize].1;
                    freed = Some(node);
                    meets = Some(met);
                    self.first[met as usize].1
                }
                Predecessor::First(node) => {
                    head.push(node);
                    self.first[node as usize].1
                }
                Predecessor::Birth => break,
                Predecessor::Nowhere => return false,
            };
        }
        if head.iter().any(|node| tail.contains(node)) {
            return false;
        }
        if let (Some(freed), Some(met)) = (freed, meets) {
            // Between the freed node and the one that was met, the old track is dropped.
            let mut node = self.next[freed as usize];
            while let Some(dropped) = node.filter(|n| *n != met) {
                node = self.next[dropped as usize];
                self.is_used[dropped as usize] = false;
                self.next[dropped as usize] = None;
                self.previous[dropped as usize] = None;
            }
            self.next[freed as usize] = None;
            self.previous[met as usize] = None;
            tail.push(freed);
            head.insert(0, met);
        }
        for run in [&tail, &head] {
            for pair in run.windows(2) {
                self.next[pair[1] as usize] = Some(pair[0]);
                self.previous[pair[0] as usize] = Some(pair[1]);
            }
            for node in run {
                self.is_used[*node as usize] = true;
            }
        }
        true
    }
}

/// Relaxes the outgoing links of a node.
fn relax(graph: &FlowGraph, node: usize, cost: Cost, from: Predecessor, labels: &mut [(Cost, Predecessor)]) {
    for link in graph.links_of(node) {
        let label = &mut labels[graph.target(link)];
        let offered = cost + graph.link_cost(link);
        if offered < label.0 {
            *label = (offered, from);
        }
    }
}
