//! Tests of the solvers against slow, independent ones: exhaustive search, and a textbook min-cost flow with source and
//! sink.

use std::collections::BTreeSet;
use std::path::Path;

use proptest::prelude::*;

use super::graph::{Cost, FlowGraph};
use super::solution::cost_of;
use super::solver::direction::Directions;
use super::solver::{constrained, exact, greedy};
use super::*;
use crate::rows::RowFile;

/// Least cost of any tracks, by a textbook min-cost flow with source and sink.
fn textbook_minimum(graph: &FlowGraph) -> i128 {
    textbook_flow(graph, usize::MAX, |_| true)
}

/// The graph as drawn in the paper: every arc with its capacity and cost, source 0, sink 1, two nodes a detection.
/// Solved by Bellman–Ford paths through source and sink while they lower the cost, up to a number of paths, over the
/// wanted nodes: slow, and unlike the crate's solvers.
fn textbook_flow(graph: &FlowGraph, max_paths: usize, wants: impl Fn(usize) -> bool) -> i128 {
    struct Arc {
        from: usize,
        to: usize,
        is_free: bool,
        cost: i128,
    }
    let mut arcs: Vec<Arc> = Vec::new();
    let mut add = |from, to, cost: Cost| {
        arcs.push(Arc { from, to, is_free: true, cost: i128::from(cost) });
        arcs.push(Arc { from: to, to: from, is_free: false, cost: -i128::from(cost) });
    };
    for node in (0..graph.node_count()).filter(|n| wants(*n)) {
        let (way_in, way_out) = (2 + 2 * node, 3 + 2 * node);
        add(0, way_in, graph.birth());
        add(way_in, way_out, graph.node_cost(node));
        add(way_out, 1, graph.death());
        for link in graph.links_of(node) {
            add(way_out, 2 + 2 * graph.target(link), graph.link_cost(link));
        }
    }
    let nodes = 2 + 2 * graph.node_count();
    let mut total = 0;
    for _ in 0..max_paths {
        let mut distance = vec![i128::MAX / 2; nodes];
        let mut by = vec![usize::MAX; nodes];
        distance[0] = 0;
        for _ in 0..nodes {
            for (index, arc) in arcs.iter().enumerate().filter(|(_, a)| a.is_free) {
                if distance[arc.from] < i128::MAX / 2 && distance[arc.from] + arc.cost < distance[arc.to] {
                    distance[arc.to] = distance[arc.from] + arc.cost;
                    by[arc.to] = index;
                }
            }
        }
        if distance[1] >= 0 {
            return total;
        }
        total += distance[1];
        let mut at = 1;
        while at != 0 {
            let arc = by[at];
            arcs[arc].is_free = false;
            arcs[arc ^ 1].is_free = true;
            at = arcs[arc].from;
        }
    }
    total
}

/// Least cost of tracks that keep the directions, by trying every continuation from every node.
fn exhaustive_minimum(graph: &FlowGraph, directions: &Directions) -> i128 {
    struct TriedTracks<'a> {
        graph: &'a FlowGraph,
        directions: &'a Directions,
        /// The link that enters each node; `None` while none does.
        come: Vec<Option<usize>>,
    }
    fn least(t: &mut TriedTracks, node: usize) -> i128 {
        if node == t.graph.node_count() {
            return 0;
        }
        let come = t.come[node];
        let paid = come.map_or(t.graph.birth(), |link| t.graph.link_cost(link));
        let here = i128::from(paid) + i128::from(t.graph.node_cost(node));
        let mut best = here + i128::from(t.graph.death()) + least(t, node + 1);
        if come.is_none() {
            best = best.min(least(t, node + 1));
        }
        for link in t.graph.links_of(node) {
            let target = t.graph.target(link);
            if t.come[target].is_none() && come.is_none_or(|come| t.directions.allow(come, link)) {
                t.come[target] = Some(link);
                best = best.min(here + least(t, node + 1));
                t.come[target] = None;
            }
        }
        best
    }
    least(&mut TriedTracks { graph, directions, come: vec![None; graph.node_count()] }, 0)
}

/// A graph from numbers: few different costs, so that ties are common, or many.
fn random_graph(nodes: usize, values: &[u32], is_coarse: bool) -> FlowGraph {
    let mut next = values.iter().cycle();
    let mut draw = |range: u32| next.next().unwrap_or(&0) % range;
    let mut cost = |low: i64, high: i64| {
        let steps = if is_coarse { 4 } else { 1000 };
        low + (high - low) * i64::from(draw(steps + 1)) / i64::from(steps)
    };
    let (birth, death) = (cost(0, 1000), cost(0, 1000));
    let mut graph = FlowGraph::with_capacity(birth, death, nodes);
    for node in 0..nodes {
        let links: Vec<(u32, Cost)> =
            (node + 1..nodes.min(node + 6)).filter(|_| cost(0, 100) > 40).map(|to| (to as u32, 0)).collect();
        let links: Vec<(u32, Cost)> = links.into_iter().map(|(to, _)| (to, cost(-100, 900))).collect();
        graph.push(cost(-1500, 500), links);
    }
    graph
}

#[test]
fn a_window_that_is_too_narrow_costs_something_and_says_how_much_at_most() {
    // Most of these chains gain most when taken together; decided at once, some are not.
    let (mut missed, mut narrower) = (0, 0);
    let mut state = 3u32;
    for _ in 0..200 {
        let values: Vec<u32> = (0..97)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                state >> 8
            })
            .collect();
        let graph = random_graph(30, &values, false);
        let least = exact::solve(&graph).total.0;
        let at_once = exact::solve_in_windows(&graph, |node| node);
        missed += usize::from(at_once.total.0 > least);
        let wider = exact::solve_in_windows(&graph, |node| node.saturating_sub(8));
        narrower += usize::from(at_once.total.0 - at_once.bound.0 > wider.total.0 - wider.bound.0);
        assert!(wider.total.0 - wider.bound.0 <= 10 * (at_once.total.0 - at_once.bound.0));
    }
    assert!(missed > 50 && narrower > 50, "{missed} {narrower}");
}

fn unbounded(graph: &FlowGraph) -> Directions {
    Directions { velocities: vec![[0.0, 0.0]; graph.link_count()], threshold: 1.0 }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn the_exact_solution_costs_what_a_textbook_flow_costs_and_proves_it(
        nodes in 0usize..24, values in prop::collection::vec(any::<u32>(), 97), is_coarse in any::<bool>()) {
        let graph = random_graph(nodes, &values, is_coarse);
        let solution = exact::solve(&graph);
        prop_assert_eq!(solution.total.0, textbook_minimum(&graph));
        prop_assert_eq!(solution.bound, solution.total);
        prop_assert_eq!(cost_of(&graph, &solution.tracks), solution.total);
        let mut used: Vec<u32> = solution.tracks.iter().flatten().copied().collect();
        used.sort_unstable();
        let count = used.len();
        used.dedup();
        prop_assert_eq!(used.len(), count, "a detection on two tracks");
    }

    #[test]
    fn windows_cost_no_more_than_they_say_and_wide_ones_nothing(
        nodes in 0usize..40, window in 0u32..12, values in prop::collection::vec(any::<u32>(), 97), is_coarse in any::<bool>()) {
        let graph = random_graph(nodes, &values, is_coarse);
        let least = textbook_minimum(&graph);
        let found = exact::solve_in_windows(&graph, |node| node.saturating_sub(window));
        prop_assert_eq!(cost_of(&graph, &found.tracks), found.total);
        prop_assert!(found.bound.0 <= least && least <= found.total.0, "{} in {:?}", least, found);
        let wide = exact::solve_in_windows(&graph, |node| node.saturating_sub(40));
        prop_assert_eq!((wide.total.0, wide.bound.0), (least, least));
    }

    #[test]
    fn the_oracles_agree_with_each_other(
        nodes in 0usize..9, values in prop::collection::vec(any::<u32>(), 97), is_coarse in any::<bool>()) {
        let graph = random_graph(nodes, &values, is_coarse);
        prop_assert_eq!(exhaustive_minimum(&graph, &unbounded(&graph)), textbook_minimum(&graph));
    }

    #[test]
    fn greedy_leaves_no_track_that_pays_and_is_never_below_the_optimum(
        nodes in 0usize..24, values in prop::collection::vec(any::<u32>(), 97), is_coarse in any::<bool>()) {
        let graph = random_graph(nodes, &values, is_coarse);
        let optimum = exact::solve(&graph).total;
        let found = greedy::solve(&graph, optimum);
        prop_assert_eq!(cost_of(&graph, &found.tracks), found.total);
        prop_assert!(found.total >= optimum, "{:?} {:?}", found.total, optimum);
        // Guarantees of the greedy solver: it begins with the cheapest of all tracks, each further one lowers the cost,
        // and it ends when none of the rest does. It guarantees no share of the optimum: another test measures how near
        // it comes on average.
        prop_assert!(found.total.0 <= textbook_flow(&graph, 1, |_| true), "{:?}", found);
        let used: BTreeSet<usize> = found.tracks.iter().flatten().map(|n| *n as usize).collect();
        prop_assert_eq!(used.len(), found.tracks.iter().map(Vec::len).sum::<usize>(), "a detection on two tracks");
        prop_assert_eq!(textbook_flow(&graph, usize::MAX, |n| !used.contains(&n)), 0);
    }

    #[test]
    fn directions_are_kept_and_cost_no_less_than_the_least_that_keeps_them(
        nodes in 0usize..9, values in prop::collection::vec(any::<u32>(), 97), is_coarse in any::<bool>()) {
        let graph = random_graph(nodes, &values, is_coarse);
        let velocities: Vec<[f64; 2]> =
            (0..graph.link_count()).map(|l| [f64::from(values[l % 97] % 5), f64::from(values[(l + 50) % 97] % 3)]).collect();
        let directions = Directions { velocities, threshold: 1.5 };
        let optimum = exact::solve(&graph).total;
        let found = constrained::solve(&graph, &directions, optimum);
        for track in &found.tracks {
            let links: Vec<usize> = track.windows(2)
                .map(|p| graph.link_between(p[0] as usize, p[1] as usize).unwrap()).collect();
            prop_assert!(links.windows(2).all(|l| directions.allow(l[0], l[1])));
        }
        let least = exhaustive_minimum(&graph, &directions);
        prop_assert!(found.total.0 >= least && least >= found.bound.0);
        // Without a limit on the turn there is no constraint, and paths that may turn back find the optimum.
        let free = constrained::solve(&graph, &unbounded(&graph), optimum);
        prop_assert_eq!(free.total, optimum);
    }
}

#[test]
fn a_turn_is_the_change_of_velocity_along_both_axes() {
    let directions = Directions { velocities: vec![[1.0, 1.0], [4.0, -3.0], [1.0, -3.5]], threshold: 5.0 };
    assert!(directions.allow(0, 1) && directions.allow(0, 2) && directions.allow(1, 2));
    let tight = Directions { threshold: 4.4, ..directions };
    assert!(!tight.allow(0, 1) && !tight.allow(0, 2) && tight.allow(1, 2));
}

#[test]
fn greedy_and_directions_miss_little_in_the_mean() {
    let (mut greedy_sum, mut optimum_sum, mut constrained, mut least) = (0i128, 0i128, 0i128, 0i128);
    let mut state = 7u32;
    for _ in 0..400 {
        let values: Vec<u32> = (0..97)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                state >> 8
            })
            .collect();
        let graph = random_graph(9, &values, false);
        let optimum = exact::solve(&graph).total;
        optimum_sum += optimum.0;
        greedy_sum += greedy::solve(&graph, optimum).total.0;
        let velocities = (0..graph.link_count()).map(|l| [f64::from(values[l % 97] % 5), 0.0]).collect();
        let directions = Directions { velocities, threshold: 1.5 };
        constrained += constrained::solve(&graph, &directions, optimum).total.0;
        least += exhaustive_minimum(&graph, &directions);
    }
    let share = |found: i128, best: i128| found as f64 / best as f64;
    let (greedy, constrained) = (share(greedy_sum, optimum_sum), share(constrained, least));
    assert!(greedy > 0.98 && constrained > 0.96, "greedy {greedy}, with directions {constrained}");
}

/// Graph sizes and least costs that `tests/peers/flow.py` got from OR-tools, which builds the graph independently.
const PEER: &str = include_str!("../../tests/peers/flow.json");

#[test]
fn an_independent_solver_finds_the_same_graph_and_the_same_least_cost() {
    let home = Path::new(env!("CARGO_MANIFEST_DIR"));
    let cases: Vec<serde_json::Value> = serde_json::from_str(PEER).unwrap();
    let (mut compared, mut exact_in_windows) = (0, 0);
    for case in &cases {
        let name = case["file"].as_str().unwrap();
        let path = match name.strip_prefix("mot15/") {
            Some(sequence) => home.join("../../shared/data/mot15").join(sequence).join("detections.txt"),
            None => home.join("tests/peers").join(name),
        };
        if !path.is_file() {
            eprintln!("skipped: {} is not here", path.display());
            continue;
        }
        let given = |name: &str| case["options"][name].as_f64();
        let options = LinkOptions {
            max_distance: given("max_distance"),
            max_area_change_px2: given("max_area_change"),
            link_cost: given("link_cost"),
            birth_cost: given("birth_cost"),
            detection_offset: given("detection_offset"),
            max_gap: given("max_gap").map(|gap| gap as u32),
            ..LinkOptions::default()
        };
        let detections =
            Detections::from_rows(&RowFile::read(&path).unwrap(), |row| options.wants(row)).unwrap();
        let report = link(&detections, &options).unwrap().report;
        assert_eq!(Some(report.detections as u64), case["detections"].as_u64(), "{name}");
        assert_eq!(Some(report.edges as u64), case["edges"].as_u64(), "{name}");
        assert!(
            (report.total_cost - case["total_cost"].as_f64().unwrap()).abs() < 1e-9,
            "{name}: {report:?}"
        );
        assert!(report.is_optimal && report.lower_bound.to_bits() == report.total_cost.to_bits());
        let windowed =
            link(&detections, &LinkOptions { window: Some(60), ..options.clone() }).unwrap().report;
        assert!(
            windowed.lower_bound <= report.total_cost && report.total_cost <= windowed.total_cost,
            "{name}"
        );
        exact_in_windows += usize::from(windowed.is_optimal);
        let greedy =
            link(&detections, &LinkOptions { solver: SolverKind::Greedy, ..options }).unwrap().report;
        assert!(greedy.total_cost <= 0.9 * report.total_cost, "{name}: {greedy:?}");
        assert!(greedy.lower_bound.to_bits() == report.total_cost.to_bits());
        compared += 1;
    }
    assert!(compared >= 3);
    // Two of the three kinds of prices; where tracks cost so much that they gain only over minutes, 60 frames are too
    // few.
    assert!(3 * exact_in_windows >= 2 * compared, "{exact_in_windows} of {compared}");
}
