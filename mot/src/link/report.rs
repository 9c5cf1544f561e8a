//! Report of linking: sizes, costs, certificate, times.

use std::path::Path;

use serde::Serialize;

use super::graph::FlowGraph;
use super::options::SolverKind;
use super::solution::Solution;
use crate::{Error, Result};

/// Report of `tracker link --report`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LinkReport {
    /// Number of linked detections.
    pub detections: usize,
    /// Number of links of the graph of detections.
    pub edges: usize,
    /// Number of written tracks.
    pub tracks: usize,
    /// Cost of the tracks over the graph of detections.
    pub total_cost: f64,
    /// Lower bound of the cost of any tracks over that graph.
    pub lower_bound: f64,
    /// Whether the two are equal, which proves that the result is optimal.
    pub is_optimal: bool,
    /// Time to build the graphs, seconds.
    pub build_seconds: f64,
    /// Time to solve them, seconds.
    pub solve_seconds: f64,
    /// Solver.
    pub solver: SolverKind,
    /// Whether the graph is the paper's (constant link cost, thresholds) rather than the default one.
    pub published_graph: bool,
    /// Graphs of tracklets, in the order in which they were solved; empty where there are none.
    pub joining: Vec<JoiningReport>,
}

/// Report of a graph of tracklets.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JoiningReport {
    /// Number of nodes.
    pub tracklets: usize,
    /// Number of links.
    pub edges: usize,
    /// Cost of the tracks over it.
    pub total_cost: f64,
    /// Lower bound of the cost of any tracks over it.
    pub lower_bound: f64,
}

impl JoiningReport {
    pub(super) fn of(graph: &FlowGraph, solution: &Solution) -> Self {
        Self {
            tracklets: graph.node_count(),
            edges: graph.link_count(),
            total_cost: solution.total.value(),
            lower_bound: solution.bound.value(),
        }
    }
}

impl LinkReport {
    /// Writes the report as one JSON object, atomically.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        Ok(calib::files::write_atomic(path, self.json(path)?.as_bytes())?)
    }

    /// Text of the file; `path` is for messages.
    ///
    /// # Errors
    /// A number that JSON cannot represent.
    pub fn json(&self, path: &Path) -> Result<String> {
        let text = serde_json::to_string(self)
            .map_err(|e| Error::content(path, "whole file", format!("cannot be written ({e})")))?;
        Ok(text + "\n")
    }
}
