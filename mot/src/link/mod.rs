//! Globally optimal linking: from all detections of a recording to the tracks of least total cost.
//!
//! A. Okada, N. Ukita and N. Hagita, "Globally-optimal multi-object tracking with constraints on moving directions" (in
//! Japanese, IEICE Transactions on Information and Systems, 2014), on the graph of H. Pirsiavash, D. Ramanan and C. C.
//! Fowlkes, "Globally-optimal greedy algorithms for tracking a variable number of objects", CVPR 2011. The data flow:
//!
//! * [`detection`] — the input: boxes in an image, or floor positions;
//! * [`colours`] — their colours, where there is a video;
//! * [`affinity`], [`motion`], [`build`] — links between detections and their costs: the flow graph ([`graph`]);
//! * [`solver`] — the tracks of least cost: exact with a certificate, greedy, or with the direction constraint;
//! * [`tracklet`] — the same again over the resulting tracks, by their motion, over longer gaps;
//! * [`fill`] — the output rows: gaps filled, boxes smoothed;
//! * [`tune`], [`experiment`] — thresholds by cross-validation, and the paper's experiment.
//!
//! [`link`] does all of it; [`link_tracklets`] and [`mend_run`] do the second half for the tracks of an online tracker.
//! [`LinkOptions`] documents the costs and the kinds of graph.

pub mod affinity;
pub mod build;
pub mod colours;
pub mod detection;
pub mod experiment;
pub mod fill;
pub mod graph;
mod mend;
mod mend_lines;
pub mod motion;
mod options;
pub mod rate;
mod report;
mod skip;
pub mod solution;
pub mod solver;
pub mod tracklet;
pub mod tune;
mod write;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::time::Instant;

pub use detection::Detections;
pub use mend::{link_tracklets, mend_run};
pub use options::{LinkOptions, SolverKind};
pub use report::{JoiningReport, LinkReport};
pub use write::track_file;

use crate::Result;
use fill::TrackRow;
use graph::FlowGraph;
use options::Joining;
use solution::Solution;
use solver::direction::Directions;
use solver::{constrained, exact, greedy};
use tracklet::Ends;

/// Tracks of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Linked {
    /// Rows of each track in time order; tracks by their first frame.
    pub tracks: Vec<Vec<TrackRow>>,
    /// Ids of the tracks: 1, 2, 3 … for detections, those of their first tracklets for tracklets.
    pub ids: Vec<u32>,
    /// New id of each tracklet, where tracklets were linked.
    pub renamed: BTreeMap<u32, u32>,
    /// Sizes, costs and times.
    pub report: LinkReport,
}

/// Links the detections of a recording.
///
/// # Errors
/// Invalid options, or costs beyond the graph's range.
pub fn link(detections: &Detections, options: &LinkOptions) -> Result<Linked> {
    options.check()?;
    let (kept, places) = match options.skip {
        0 => (Cow::Borrowed(detections), Vec::new()),
        skip => {
            let (kept, places) = skip::kept(detections, skip);
            (Cow::Owned(kept), places)
        }
    };
    // The paper's costs refer to raw scores.
    let linked =
        if options.is_published() { Cow::Borrowed(kept.as_ref()) } else { kept.with_probabilities() };
    let linked = linked.as_ref();
    let started = Instant::now();
    let graph = detection_graph(linked, options)?;
    let mut build_seconds = started.elapsed().as_secs_f64();
    let started = Instant::now();
    let solution = solve(linked, &graph, options);
    let mut solve_seconds = started.elapsed().as_secs_f64();
    let (total_cost, lower_bound) = (solution.total.value(), solution.bound.value());
    let is_optimal = solution.total == solution.bound;
    let mut tracks = solution.tracks;
    let mut rounds = Vec::new();
    if !options.is_published() {
        let joining = options.joining(linked.on_floor);
        for max_gap in joining.max_gaps {
            let started = Instant::now();
            let (tracklets, graph) = tracklet_graph(linked, tracks, &joining, max_gap)?;
            build_seconds += started.elapsed().as_secs_f64();
            let started = Instant::now();
            let solution = exact::solve(&graph);
            solve_seconds += started.elapsed().as_secs_f64();
            tracks = solution.tracks.iter().map(|track| chain(&tracklets, track)).collect();
            rounds.push(JoiningReport::of(&graph, &solution));
        }
    }
    if options.skip > 0 {
        for node in tracks.iter_mut().flatten() {
            *node = places[*node as usize];
        }
        skip::restore(detections, &mut tracks, options.skip);
    }
    tracks.sort_by_key(|track| track.first().copied());
    let report = LinkReport {
        detections: linked.all.len(),
        edges: graph.link_count(),
        tracks: tracks.len(),
        total_cost,
        lower_bound,
        is_optimal,
        build_seconds,
        solve_seconds,
        solver: options.solver,
        published_graph: options.is_published(),
        joining: rounds,
    };
    let fill = options.fill();
    Ok(Linked {
        ids: (1..=tracks.len() as u32).collect(),
        tracks: tracks.iter().map(|t| fill::rows(detections, t, &fill)).collect(),
        renamed: BTreeMap::new(),
        report,
    })
}

fn detection_graph(detections: &Detections, options: &LinkOptions) -> Result<FlowGraph> {
    let (prices, max_gap) = (options.prices(), options.detection_gap());
    if options.is_published() {
        build::build(detections, &prices, max_gap, &options.thresholds())
    } else {
        build::build(detections, &prices, max_gap, &options.motion(detections.on_floor))
    }
}

fn solve(detections: &Detections, graph: &FlowGraph, options: &LinkOptions) -> Solution {
    let optimum = match options.window {
        None => exact::solve(graph),
        Some(frames) => {
            let frame = |node: u32| detections.all[node as usize].frame;
            let first_open = |node: u32| {
                detections.all.partition_point(|d| d.frame.saturating_add(frames) <= frame(node)) as u32
            };
            exact::solve_in_windows(graph, first_open)
        }
    };
    if let Some(threshold) = options.direction_threshold {
        let directions = directions(detections, graph, threshold);
        return constrained::solve(graph, &directions, optimum.bound);
    }
    match options.solver {
        SolverKind::Exact => optimum,
        SolverKind::Greedy => greedy::solve(graph, optimum.bound),
    }
}

/// Velocities of all links.
fn directions(detections: &Detections, graph: &FlowGraph, threshold: f64) -> Directions {
    let velocity = |node: usize, link: usize| {
        let (from, to) = (&detections.all[node], &detections.all[graph.target(link)]);
        let step = (to.place - from.place) / f64::from(to.frame - from.frame);
        [step.x, step.y]
    };
    let nodes = 0..graph.node_count();
    let velocities =
        nodes.flat_map(|node| graph.links_of(node).map(move |link| velocity(node, link))).collect();
    Directions { velocities, threshold }
}

/// Tracks as nodes, ordered by their beginning, and the graph over them.
fn tracklet_graph(
    detections: &Detections,
    mut tracklets: Vec<Vec<u32>>,
    joining: &Joining,
    max_gap: u32,
) -> Result<(Vec<Vec<u32>>, FlowGraph)> {
    tracklets.sort_by_key(|t| t.first().copied());
    let ends = Ends::of(detections, &tracklets, &joining.model);
    let worth = |node: &u32| joining.prices.detection_offset - detections.all[*node as usize].score;
    let inner: Vec<f64> = tracklets.iter().map(|t| t.iter().map(worth).sum()).collect();
    let graph = tracklet::graph(&ends, &inner, joining.prices.birth, max_gap, &joining.model)?;
    Ok((tracklets, graph))
}

/// Detections of a chain of tracklets.
fn chain(tracklets: &[Vec<u32>], track: &[u32]) -> Vec<u32> {
    track.iter().flat_map(|t| &tracklets[*t as usize]).copied().collect()
}

#[cfg(test)]
mod mend_tests;
#[cfg(test)]
mod motion_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod whole_tests;
