//! What linking did: sizes, costs, the certificate, times.

use std::path::Path;

use serde::Serialize;

use super::graph::FlowGraph;
use super::options::SolverKind;
use super::solution::Solution;
use crate::{Error, Result};

/// `tracker link --report`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LinkReport {
    /// Detections that were linked.
    pub detections: usize,
    /// Links of the graph of detections.
    pub edges: usize,
    /// Tracks that were written.
    pub tracks: usize,
    /// What the tracks over the graph of detections cost.
    pub total_cost: f64,
    /// No tracks over that graph cost less.
    pub lower_bound: f64,
    /// Whether the two are equal: then nothing is cheaper than what was found.
    pub is_optimal: bool,
    /// Time to build the graphs.
    pub build_seconds: f64,
    /// Time to solve them.
    pub solve_seconds: f64,
    /// Which solver.
    pub solver: SolverKind,
    /// Whether the graph is the paper's (constant link cost, thresholds) rather than the default one.
    pub published_graph: bool,
    /// The graphs of tracklets, in the order in which they were solved; empty where there are none.
    pub joining: Vec<JoiningReport>,
}

/// A graph of tracklets.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JoiningReport {
    /// Its nodes.
    pub tracklets: usize,
    /// Its links.
    pub edges: usize,
    /// What the tracks over it cost.
    pub total_cost: f64,
    /// No tracks over it cost less.
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
    /// Writes it as one JSON object, whole or not at all.
    ///
    /// # Errors
    /// Naming the file.
    pub fn write(&self, path: &Path) -> Result<()> {
        Ok(calib::files::write_atomic(path, self.json(path)?.as_bytes())?)
    }

    /// The text of the file; `path` is for messages.
    ///
    /// # Errors
    /// A number that JSON cannot hold.
    pub fn json(&self, path: &Path) -> Result<String> {
        let text = serde_json::to_string(self)
            .map_err(|e| Error::content(path, "whole file", format!("cannot be written ({e})")))?;
        Ok(text + "\n")
    }
}
