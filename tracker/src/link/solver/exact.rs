//! The exact solution by successive shortest paths.
//!
//! Source and sink touch every detection, so a search through them sees the whole recording. They can be taken out:
//! each detection has a way out and a way in, a link joins one's way out with another's way in, and a detection that
//! stays unused joins its own two. What is left open at a way in is a birth, at a way out a death. Then
//!
//! ```text
//! total = Σᵢ (birth + death + costᵢ)  −  Σ gain of the joints,
//! gain(i → j) = birth + death − link cost,   gain(i unused) = birth + death + costᵢ
//! ```
//!
//! and the least total is the joining (each way in and way out at most once) of greatest gain. It is found a shortest
//! augmenting path at a time, with prices that keep all reduced costs non-negative (Edmonds & Karp 1972; Tomizawa 1971),
//! as in the successive shortest paths of Ahuja, Magnanti & Orlin, "Network Flows", section 12.4; but each search ends
//! where the nearest way in is open or the nearest way out is better left open: within a few frames, not at the
//! recording's ends. The prices are the certificate: where y ≥ 0 at all ways, and y(out) + y(in) ≥ gain for
//! every possible joint, no joining gains more than Σ y.
//!
//! Ways out are taken in time order, so a long recording can be solved in windows ([`solve_in_windows`]): joints behind a
//! window stay as they are. A search that comes to one turns away, and the price of that way in rises by what the path could
//! have gained behind it. Prices then still allow for every joint, so Σ y still bounds all joinings: where the bound and
//! the cost are equal the windows have changed nothing, and otherwise their difference is all that they can have cost.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::super::graph::{Cost, FlowGraph};
use super::super::solution::{Solution, Total};

const NONE: u32 = u32::MAX;

/// The tracks of least total cost, with the proof.
pub fn solve(graph: &FlowGraph) -> Solution {
    solve_in_windows(graph, |_| 0)
}

/// Tracks found in windows that move over the nodes: while node n is new, joints of nodes before `first_open(n)` are
/// settled. Their cost is at most `total − bound` above the least; `bound` holds for the whole graph.
pub fn solve_in_windows(graph: &FlowGraph, first_open: impl Fn(u32) -> u32) -> Solution {
    let mut joints = Joints::new(graph);
    for way_out in 0..graph.node_count() as u32 {
        if !joints.take_first_choice(way_out) {
            joints.augment_from(way_out, first_open(way_out));
        }
    }
    joints.solution()
}

/// The joints so far, their prices, and the workspace of a search.
struct Joints<'a> {
    graph: &'a FlowGraph,
    /// What a joint saves over a death and a birth, before the link's cost.
    track_price: Cost,
    way_in_of: Vec<u32>,
    way_out_of: Vec<u32>,
    price_out: Vec<Cost>,
    price_in: Vec<Cost>,
    search: Search,
}

/// A search's workspace: valid where the stamp is the search's own.
struct Search {
    stamp: u32,
    stamp_of: Vec<u32>,
    /// Of each way in: its distance from the root, and the way out it was reached from.
    distance: Vec<Cost>,
    reached_from: Vec<u32>,
    queue: BinaryHeap<Reverse<(Cost, u32)>>,
    /// Ways out in the tree with their distance.
    tree: Vec<(u32, Cost)>,
    /// Ways in that were reached, but are settled.
    settled: Vec<u32>,
}

/// Where a shortest path ends.
#[derive(Clone, Copy)]
enum End {
    /// At an open way in.
    WayIn(u32),
    /// At a way out that is left open from now on.
    WayOut(u32),
}

impl<'a> Joints<'a> {
    /// No joints yet.
    fn new(graph: &'a FlowGraph) -> Self {
        let n = graph.node_count();
        Self {
            graph,
            track_price: graph.birth() + graph.death(),
            way_in_of: vec![NONE; n],
            way_out_of: vec![NONE; n],
            price_out: vec![0; n],
            price_in: vec![0; n],
            search: Search {
                stamp: 0,
                stamp_of: vec![0; n],
                distance: vec![0; n],
                reached_from: vec![NONE; n],
                queue: BinaryHeap::new(),
                tree: Vec::new(),
                settled: Vec::new(),
            },
        }
    }

    /// A way out begins with the price that no joint of its can beat, its greatest gain. If that is still
    /// open, it gets it without a search.
    fn take_first_choice(&mut self, way_out: u32) -> bool {
        let price = self.joints_of(way_out).map(|(_, gain)| gain).max().unwrap_or(0).max(0);
        self.price_out[way_out as usize] = price;
        // Nobody has it, so nobody has raised its price above 0.
        let is_open = |way_in: u32| self.way_out_of[way_in as usize] == NONE;
        let open = self.joints_of(way_out).find(|(way_in, gain)| *gain == price && is_open(*way_in));
        let found = open.filter(|_| price > 0);
        if let Some((way_in, _)) = found {
            self.join(way_out, way_in);
        }
        found.is_some()
    }

    /// Everything a way out can be joined with, and the gain of it.
    fn joints_of(&self, way_out: u32) -> impl Iterator<Item = (u32, Cost)> + use<'a> {
        let (graph, price) = (self.graph, self.track_price);
        let node = way_out as usize;
        let unused = (way_out, price + graph.node_cost(node));
        let links = graph.links_of(node).map(move |l| (graph.target(l) as u32, price - graph.link_cost(l)));
        std::iter::once(unused).chain(links)
    }

    fn join(&mut self, way_out: u32, way_in: u32) {
        self.way_in_of[way_out as usize] = way_in;
        self.way_out_of[way_in as usize] = way_out;
    }

    /// One shortest augmenting path from an open way out (Dijkstra over reduced costs) that leaves ways out before
    /// `first_open` as they are, and the prices after it.
    fn augment_from(&mut self, root: u32, first_open: u32) {
        let search = &mut self.search;
        search.stamp += 1;
        search.queue.clear();
        search.tree.clear();
        search.settled.clear();
        let mut shortest = self.price_out[root as usize];
        let mut end = End::WayOut(root);
        let (mut way_out, mut distance) = (root, 0);
        loop {
            self.search.tree.push((way_out, distance));
            if distance + self.price_out[way_out as usize] < shortest {
                shortest = distance + self.price_out[way_out as usize];
                end = End::WayOut(way_out);
            }
            self.look_around(way_out, distance, first_open, &mut shortest, &mut end);
            let Some(nearest) = self.search.pop(shortest) else { break };
            distance = nearest.0;
            way_out = self.way_out_of[nearest.1 as usize];
        }
        for (way_out, distance) in &self.search.tree {
            let passed = shortest - distance;
            self.price_out[*way_out as usize] -= passed;
            // The way in that the tree came through; the root has none.
            if *way_out != root {
                self.price_in[self.way_in_of[*way_out as usize] as usize] += passed;
            }
        }
        while let Some(way_in) = self.search.settled.pop() {
            let missed = shortest - self.search.distance[way_in as usize];
            if missed > 0 {
                self.price_in[way_in as usize] += missed;
                self.search.distance[way_in as usize] = shortest;
            }
        }
        let mut way_in = match end {
            End::WayIn(way_in) => way_in,
            End::WayOut(way_out) if way_out == root => return,
            End::WayOut(way_out) => std::mem::replace(&mut self.way_in_of[way_out as usize], NONE),
        };
        loop {
            let way_out = self.search.reached_from[way_in as usize];
            let before = self.way_in_of[way_out as usize];
            self.join(way_out, way_in);
            if way_out == root {
                return;
            }
            way_in = before;
        }
    }

    /// Relaxes everything that a way out can be joined with.
    fn look_around(
        &mut self,
        way_out: u32,
        distance: Cost,
        first_open: u32,
        shortest: &mut Cost,
        end: &mut End,
    ) {
        let price = self.price_out[way_out as usize];
        let joined = self.way_in_of[way_out as usize];
        for (way_in, gain) in self.joints_of(way_out) {
            let to = way_in as usize;
            let reached = distance + price + self.price_in[to] - gain;
            if reached >= *shortest || way_in == joined {
                continue;
            }
            let search = &mut self.search;
            if search.stamp_of[to] == search.stamp && search.distance[to] <= reached {
                continue;
            }
            search.stamp_of[to] = search.stamp;
            search.distance[to] = reached;
            search.reached_from[to] = way_out;
            let holder = self.way_out_of[to];
            if holder == NONE {
                *shortest = reached;
                *end = End::WayIn(way_in);
            } else if holder < first_open {
                search.settled.push(way_in);
            } else {
                search.queue.push(Reverse((reached, way_in)));
            }
        }
    }

    fn solution(&self) -> Solution {
        let graph = self.graph;
        let is_used = |node: usize| self.way_in_of[node] != node as u32;
        let next: Vec<Option<u32>> = (0..graph.node_count())
            .map(|n| Some(self.way_in_of[n]).filter(|to| *to != NONE && *to != n as u32))
            .collect();
        let all: i128 = (0..graph.node_count())
            .map(|n| i128::from(self.track_price) + i128::from(graph.node_cost(n)))
            .sum();
        let prices: i128 = self.price_out.iter().chain(&self.price_in).map(|p| i128::from(*p)).sum();
        Solution::assemble(graph, is_used, &next, |_| Total(all - prices))
    }
}

impl Search {
    /// The nearest way in that was reached, if it is nearer than the path that is known.
    fn pop(&mut self, shortest: Cost) -> Option<(Cost, u32)> {
        while let Some(Reverse((distance, way_in))) = self.queue.pop() {
            if distance >= shortest {
                return None;
            }
            if distance == self.distance[way_in as usize] {
                return Some((distance, way_in));
            }
        }
        None
    }
}
