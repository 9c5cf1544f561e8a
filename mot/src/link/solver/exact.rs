//! Exact solution by successive shortest paths.
//!
//! Source and sink touch every detection, so a search through them visits the whole recording. They can be eliminated:
//! each detection has an exit and an entry, a link joins the exit of one with the entry of another, and an unused
//! detection joins its own two. An open entry is a birth, an open exit a death. Then
//!
//! ```text
//! total = Σᵢ (birth + death + costᵢ)  −  Σ gain of the joints,
//! gain(i → j) = birth + death − link cost,   gain(i unused) = birth + death + costᵢ
//! ```
//!
//! and the least total is the matching (each exit and entry at most once) of greatest gain. It is found one shortest
//! augmenting path at a time, with prices that keep all reduced costs non-negative (J. Edmonds and R. M. Karp 1972; N.
//! Tomizawa 1971), as in the successive shortest paths of R. K. Ahuja, T. L. Magnanti and J. B. Orlin, "Network Flows",
//! 1993, section 12.4; but each search ends where the nearest entry is open or the nearest exit is better left open:
//! within a few frames, not at the recording's ends. The prices are the certificate: if y ≥ 0 everywhere, and y(exit) +
//! y(entry) ≥ gain for every possible joint, no matching gains more than Σ y.
//!
//! Exits are processed in time order, so a long recording can be solved in windows ([`solve_in_windows`]): joints
//! before a window are final. A search that reaches one turns away, and the price of that entry rises by what the path
//! could have gained beyond it. The prices then still cover every joint, so Σ y still bounds all matchings: where the
//! bound and the cost are equal the windows have changed nothing, and otherwise their difference bounds the loss.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::super::graph::{Cost, FlowGraph};
use super::super::solution::{Solution, Total};

const NONE: u32 = u32::MAX;

/// Tracks of least total cost, with the certificate.
pub fn solve(graph: &FlowGraph) -> Solution {
    solve_in_windows(graph, |_| 0)
}

/// Tracks found in windows that move over the nodes: while node n is new, joints of nodes before `first_open(n)` are
/// final. Their cost is at most `total − bound` above the least; `bound` holds for the whole graph.
pub fn solve_in_windows(graph: &FlowGraph, first_open: impl Fn(u32) -> u32) -> Solution {
    let mut joints = Joints::new(graph);
    for exit in 0..graph.node_count() as u32 {
        if !joints.take_first_choice(exit) {
            joints.augment_from(exit, first_open(exit));
        }
    }
    joints.solution()
}

/// Joints so far, their prices, and the workspace of a search.
struct Joints<'a> {
    graph: &'a FlowGraph,
    /// Saving of a joint over a death and a birth, before the link's cost.
    track_price: Cost,
    entry_of: Vec<u32>,
    exit_of: Vec<u32>,
    price_out: Vec<Cost>,
    price_in: Vec<Cost>,
    search: DijkstraSearch,
}

/// Workspace of a search: entries are valid where the stamp is the search's own.
struct DijkstraSearch {
    stamp: u32,
    stamp_of: Vec<u32>,
    /// For each entry: its distance from the root, and the exit from which it was reached.
    distance: Vec<Cost>,
    reached_from: Vec<u32>,
    queue: BinaryHeap<Reverse<(Cost, u32)>>,
    /// Exits in the tree with their distances.
    tree: Vec<(u32, Cost)>,
    /// Entries that were reached, but are final.
    settled: Vec<u32>,
}

/// End of a shortest path.
#[derive(Clone, Copy)]
enum AugmentingEnd {
    /// At an open entry.
    Entry(u32),
    /// At an exit that is open from now on.
    Exit(u32),
}

impl<'a> Joints<'a> {
    /// No joints yet.
    fn new(graph: &'a FlowGraph) -> Self {
        let n = graph.node_count();
        Self {
            graph,
            track_price: graph.birth() + graph.death(),
            entry_of: vec![NONE; n],
            exit_of: vec![NONE; n],
            price_out: vec![0; n],
            price_in: vec![0; n],
            search: DijkstraSearch {
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

    /// Gives an exit its initial price, the greatest gain of its joints, which none of them exceeds. If that joint's
    /// entry is open, the two are joined without a search.
    fn take_first_choice(&mut self, exit: u32) -> bool {
        let price = self.joints_of(exit).map(|(_, gain)| gain).max().unwrap_or(0).max(0);
        self.price_out[exit as usize] = price;
        // An open entry has no joint, so its price is still 0.
        let is_open = |entry: u32| self.exit_of[entry as usize] == NONE;
        let open = self.joints_of(exit).find(|(entry, gain)| *gain == price && is_open(*entry));
        let found = open.filter(|_| price > 0);
        if let Some((entry, _)) = found {
            self.join(exit, entry);
        }
        found.is_some()
    }

    /// All possible joints of an exit, with their gains.
    fn joints_of(&self, exit: u32) -> impl Iterator<Item = (u32, Cost)> + use<'a> {
        let (graph, price) = (self.graph, self.track_price);
        let node = exit as usize;
        let unused = (exit, price + graph.node_cost(node));
        let links = graph.links_of(node).map(move |l| (graph.target(l) as u32, price - graph.link_cost(l)));
        std::iter::once(unused).chain(links)
    }

    fn join(&mut self, exit: u32, entry: u32) {
        self.entry_of[exit as usize] = entry;
        self.exit_of[entry as usize] = exit;
    }

    /// Finds one shortest augmenting path from an open exit (Dijkstra over reduced costs) that leaves exits before
    /// `first_open` unchanged, and updates the prices.
    fn augment_from(&mut self, root: u32, first_open: u32) {
        let search = &mut self.search;
        search.stamp += 1;
        search.queue.clear();
        search.tree.clear();
        search.settled.clear();
        let mut shortest = self.price_out[root as usize];
        let mut end = AugmentingEnd::Exit(root);
        let (mut exit, mut distance) = (root, 0);
        loop {
            self.search.tree.push((exit, distance));
            if distance + self.price_out[exit as usize] < shortest {
                shortest = distance + self.price_out[exit as usize];
                end = AugmentingEnd::Exit(exit);
            }
            self.look_around(exit, distance, first_open, &mut shortest, &mut end);
            let Some(nearest) = self.search.pop(shortest) else { break };
            distance = nearest.0;
            exit = self.exit_of[nearest.1 as usize];
        }
        for (exit, distance) in &self.search.tree {
            let passed = shortest - distance;
            self.price_out[*exit as usize] -= passed;
            // The entry through which the tree came; the root has none.
            if *exit != root {
                self.price_in[self.entry_of[*exit as usize] as usize] += passed;
            }
        }
        while let Some(entry) = self.search.settled.pop() {
            let missed = shortest - self.search.distance[entry as usize];
            if missed > 0 {
                self.price_in[entry as usize] += missed;
                self.search.distance[entry as usize] = shortest;
            }
        }
        let mut entry = match end {
            AugmentingEnd::Entry(entry) => entry,
            AugmentingEnd::Exit(exit) if exit == root => return,
            AugmentingEnd::Exit(exit) => std::mem::replace(&mut self.entry_of[exit as usize], NONE),
        };
        loop {
            let exit = self.search.reached_from[entry as usize];
            let before = self.entry_of[exit as usize];
            self.join(exit, entry);
            if exit == root {
                return;
            }
            entry = before;
        }
    }

    /// Relaxes all possible joints of an exit.
    fn look_around(
        &mut self,
        exit: u32,
        distance: Cost,
        first_open: u32,
        shortest: &mut Cost,
        end: &mut AugmentingEnd,
    ) {
        let price = self.price_out[exit as usize];
        let joined = self.entry_of[exit as usize];
        for (entry, gain) in self.joints_of(exit) {
            let to = entry as usize;
            let reached = distance + price + self.price_in[to] - gain;
            if reached >= *shortest || entry == joined {
                continue;
            }
            let search = &mut self.search;
            if search.stamp_of[to] == search.stamp && search.distance[to] <= reached {
                continue;
            }
            search.stamp_of[to] = search.stamp;
            search.distance[to] = reached;
            search.reached_from[to] = exit;
            let holder = self.exit_of[to];
            if holder == NONE {
                *shortest = reached;
                *end = AugmentingEnd::Entry(entry);
            } else if holder < first_open {
                search.settled.push(entry);
            } else {
                search.queue.push(Reverse((reached, entry)));
            }
        }
    }

    fn solution(&self) -> Solution {
        let graph = self.graph;
        let is_used = |node: usize| self.entry_of[node] != node as u32;
        let next: Vec<Option<u32>> = (0..graph.node_count())
            .map(|n| Some(self.entry_of[n]).filter(|to| *to != NONE && *to != n as u32))
            .collect();
        let all: i128 = (0..graph.node_count())
            .map(|n| i128::from(self.track_price) + i128::from(graph.node_cost(n)))
            .sum();
        let prices: i128 = self.price_out.iter().chain(&self.price_in).map(|p| i128::from(*p)).sum();
        Solution::assemble(graph, is_used, &next, |_| Total(all - prices))
    }
}

impl DijkstraSearch {
    /// Nearest reached entry, if it is nearer than the known path.
    fn pop(&mut self, shortest: Cost) -> Option<(Cost, u32)> {
        while let Some(Reverse((distance, entry))) = self.queue.pop() {
            if distance >= shortest {
                return None;
            }
            if distance == self.distance[entry as usize] {
                return Some((distance, entry));
            }
        }
        None
    }
}
