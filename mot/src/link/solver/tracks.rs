//! Tracks during their construction, by the incoming and outgoing link of each node.

use super::super::graph::FlowGraph;
use super::direction::Directions;
use super::labels::{Arrived, Freed, PathEnd, PathLabels};

/// Tracks by their links.
pub(super) struct WorkingTracks {
    pub(super) is_used: Vec<bool>,
    pub(super) come: Vec<Option<u32>>,
    pub(super) go: Vec<Option<u32>>,
    /// Source node of each link.
    sources: Vec<u32>,
    /// Former state of each node in the current change.
    journal: Vec<(usize, NodeState)>,
}

/// Whether a node is used, its incoming link and its outgoing link.
type NodeState = (bool, Option<u32>, Option<u32>);

impl WorkingTracks {
    pub(super) fn none(graph: &FlowGraph) -> Self {
        let n = graph.node_count();
        let sources = (0..n).flat_map(|node| graph.links_of(node).map(move |_| node as u32)).collect();
        Self { is_used: vec![false; n], come: vec![None; n], go: vec![None; n], sources, journal: Vec::new() }
    }

    /// Source node of a link.
    pub(super) fn source(&self, link: u32) -> usize {
        self.sources[link as usize] as usize
    }

    /// Follower of each node.
    pub(super) fn followers(&self, graph: &FlowGraph) -> Vec<Option<u32>> {
        self.go.iter().map(|link| link.map(|l| graph.target(l as usize) as u32)).collect()
    }

    /// Changes the tracks along the path that ends at `end`. If the path crosses itself so that the result would break
    /// a track or a direction, or cost no less, nothing changes and the result is `false`.
    pub(super) fn change(
        &mut self,
        graph: &FlowGraph,
        directions: &Directions,
        labels: &PathLabels,
        end: PathEnd,
    ) -> bool {
        let Some(steps) = self.steps(labels, end) else { return false };
        self.journal.clear();
        for step in steps.into_iter().rev() {
            self.apply(graph, &step);
        }
        let mut touched: Vec<usize> = self.journal.iter().map(|(node, _)| *node).collect();
        touched.sort_unstable();
        touched.dedup();
        let is_sound = touched.iter().all(|node| self.is_sound(graph, directions, *node));
        let after = self.cost_at(graph, &touched);
        // Each node's first entry, undone last, is its former state.
        for i in (0..self.journal.len()).rev() {
            let (node, old) = self.journal[i];
            let new = (self.is_used[node], self.come[node], self.go[node]);
            (self.is_used[node], self.come[node], self.go[node]) = old;
            self.journal[i].1 = new;
        }
        if !(is_sound && after < self.cost_at(graph, &touched)) {
            return false;
        }
        for (node, (is_used, come, go)) in std::mem::take(&mut self.journal) {
            (self.is_used[node], self.come[node], self.go[node]) = (is_used, come, go);
        }
        true
    }

    /// Cost of some nodes, their incoming links and their tracks' ends.
    fn cost_at(&self, graph: &FlowGraph, nodes: &[usize]) -> i128 {
        let cost = |node: &usize| {
            let come = self.come[*node].map_or(graph.birth(), |link| graph.link_cost(link as usize));
            let go = if self.go[*node].is_none() { graph.death() } else { 0 };
            i128::from(come) + i128::from(go) + i128::from(graph.node_cost(*node))
        };
        nodes.iter().filter(|n| self.is_used[**n]).map(cost).sum()
    }

    /// Steps of the path, its end first; `None` where it is a cycle.
    fn steps(&self, labels: &PathLabels, end: PathEnd) -> Option<Vec<PathStep>> {
        let mut steps = Vec::new();
        let mut at = match end {
            PathEnd::Node(node) => TracePosition::Arrived(node, labels.end[node as usize].1),
            PathEnd::TrackStart(node) => TracePosition::Arrived(node, labels.met[node as usize].1),
            PathEnd::FreedNode(node) => TracePosition::Freed(node),
            PathEnd::DroppedStart(node) => {
                steps.push(PathStep::Drop(node));
                TracePosition::Freed(node)
            }
        };
        let longest = 2 * (labels.over.len() + labels.end.len()) + 2;
        while steps.len() <= longest {
            at = match at {
                TracePosition::Arrived(_, Arrived::Nowhere) => return None,
                TracePosition::Arrived(node, Arrived::Birth) => {
                    steps.push(PathStep::Begin(node));
                    return Some(steps);
                }
                TracePosition::Arrived(_, Arrived::TrackEnd) => return Some(steps),
                TracePosition::Arrived(node, Arrived::Freed) => TracePosition::Freed(node),
                TracePosition::Arrived(_, Arrived::Over(link)) => {
                    steps.push(PathStep::Follow(link));
                    TracePosition::Arrived(self.sources[link as usize], labels.over[link as usize].1)
                }
                TracePosition::Freed(node) => {
                    steps.push(PathStep::LoseRest(node));
                    match labels.freed[node as usize].1 {
                        Freed::Nowhere => return None,
                        Freed::Met(behind) => TracePosition::Arrived(behind, labels.met[behind as usize].1),
                        Freed::Dropped(behind) => {
                            steps.push(PathStep::Drop(behind));
                            TracePosition::Freed(behind)
                        }
                    }
                }
            };
        }
        None
    }

    fn apply(&mut self, graph: &FlowGraph, step: &PathStep) {
        match *step {
            PathStep::Begin(node) => {
                let node = self.note(node);
                self.is_used[node] = true;
                self.come[node] = None;
            }
            PathStep::Follow(link) => {
                let source = self.note(self.sources[link as usize]);
                self.go[source] = Some(link);
                let target = self.note(graph.target(link as usize) as u32);
                self.is_used[target] = true;
                self.come[target] = Some(link);
            }
            PathStep::LoseRest(node) => {
                let node = self.note(node);
                self.go[node] = None;
            }
            PathStep::Drop(node) => {
                let node = self.note(node);
                (self.is_used[node], self.come[node], self.go[node]) = (false, None, None);
            }
        }
    }

    fn note(&mut self, node: u32) -> usize {
        let node = node as usize;
        self.journal.push((node, (self.is_used[node], self.come[node], self.go[node])));
        node
    }

    /// Whether a node's links agree with its neighbours', and its direction is kept.
    fn is_sound(&self, graph: &FlowGraph, directions: &Directions, node: usize) -> bool {
        let (come, go) = (self.come[node], self.go[node]);
        if !self.is_used[node] {
            return come.is_none() && go.is_none();
        }
        let comes_rightly = come.is_none_or(|link| {
            graph.target(link as usize) == node && self.go[self.source(link)] == Some(link)
        });
        let goes_rightly = go.is_none_or(|link| {
            self.source(link) == node && self.come[graph.target(link as usize)] == Some(link)
        });
        let turns_rightly =
            come.zip(go).is_none_or(|(come, go)| directions.allow(come as usize, go as usize));
        comes_rightly && goes_rightly && turns_rightly
    }
}

/// Position at which a path is traced backwards.
enum TracePosition {
    Arrived(u32, Arrived),
    Freed(u32),
}

/// One step of a path, in forward order.
enum PathStep {
    Begin(u32),
    Follow(u32),
    LoseRest(u32),
    Drop(u32),
}
