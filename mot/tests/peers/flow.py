#!/usr/bin/env python3
"""The flow graph of `tracker link` built anew from its description, and solved by OR-tools' min-cost flow.

    python3 -m venv venv && venv/bin/pip install ortools==9.15.6755
    venv/bin/python flow.py [MOT15_FOLDER]          # rewrites flow.json: cases, graph sizes, least costs
    venv/bin/python flow.py --time DETECTIONS TRACKER OPTION=VALUE...   # OR-tools and TRACKER on one file, solve times

A detection costs offset - score; links join detections at most `max_gap` frames apart whose centres are no more than
`max_distance` apart and whose areas differ by no more than `max_area_change`, and cost `link_cost`; a track pays
`birth_cost` at its beginning and again at its end.
"""
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from ortools.graph.python import min_cost_flow

HERE = Path(__file__).parent
UNITS = 10**6  # Scores have at most six decimals: whole numbers, nothing is rounded.
CASES = [
    dict(max_distance=30, max_area_change=2500, link_cost=0.1, birth_cost=1.5, detection_offset=0.2, max_gap=1),
    dict(max_distance=60, max_area_change=20000, link_cost=0.05, birth_cost=3, detection_offset=0.6, max_gap=4),
    dict(max_distance=15, max_area_change=900, link_cost=0, birth_cost=0.3, detection_offset=0.9, max_gap=2),
]


def graph(path, max_distance, max_area_change, link_cost, birth_cost, detection_offset, max_gap):
    """-> number of detections, arcs (from, to, cost), number of links; nodes 2i and 2i + 1, then source and sink"""
    rows = np.loadtxt(path, delimiter=",", usecols=range(7), ndmin=2)
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    frame, n = rows[:, 0].astype(int), len(rows)
    centre, area = rows[:, 2:4] + rows[:, 4:6] / 2, rows[:, 4] * rows[:, 5]
    whole = lambda cost: np.rint(np.asarray(cost) * UNITS).astype(np.int64)
    pairs = []
    of_frame = {f: np.flatnonzero(frame == f) for f in np.unique(frame)}
    for f, here in of_frame.items():
        for gap in range(1, max_gap + 1):
            there = of_frame.get(f + gap)
            if there is None:
                continue
            distance = np.linalg.norm(centre[here][:, None] - centre[there][None], axis=2)
            change = np.abs(area[here][:, None] - area[there][None])
            i, j = np.nonzero((distance <= max_distance) & (change <= max_area_change))
            pairs.append(np.column_stack([here[i], there[j]]))
    pairs = np.concatenate(pairs) if pairs else np.zeros((0, 2), int)
    each = np.arange(n)
    source, sink = np.full(n, 2 * n), np.full(n, 2 * n + 1)
    tails = np.concatenate([source, 2 * each, 2 * each + 1, 2 * pairs[:, 0] + 1])
    heads = np.concatenate([2 * each, 2 * each + 1, sink, 2 * pairs[:, 1]])
    price = lambda cost, count: np.full(count, whole(cost))
    costs = np.concatenate([price(birth_cost, n), whole(detection_offset - rows[:, 6]), price(birth_cost, n), price(link_cost, len(pairs))])
    return n, tails, heads, costs, len(pairs)


def solve(n, tails, heads, costs):
    """Least cost over any number of tracks -> cost, seconds. A free arc back to the source lets unused units go by."""
    flow = min_cost_flow.SimpleMinCostFlow()
    flow.add_arcs_with_capacity_and_unit_cost(tails, heads, np.ones(len(tails), int), costs)
    flow.add_arc_with_capacity_and_unit_cost(2 * n, 2 * n + 1, n, 0)
    flow.set_node_supply(2 * n, n)
    flow.set_node_supply(2 * n + 1, -n)
    start = time.perf_counter()
    status = flow.solve()
    seconds = time.perf_counter() - start
    assert status == flow.OPTIMAL, status
    return flow.optimal_cost() / UNITS, seconds


def record(folder):
    cases = []
    files = [("crowd_image_tracks.txt", HERE / "crowd_image_tracks.txt")]
    files += [(f"mot15/{p.parent.name}", p) for p in sorted(Path(folder).glob("*/detections.txt"))] if folder else []
    for name, path in files:
        for options in CASES:
            n, *arcs, links = graph(path, **options)
            cost, seconds = solve(n, *arcs)
            cases.append(dict(file=name, options=options, detections=n, edges=links, total_cost=cost))
            print(json.dumps(cases[-1]), f"{seconds:.3f} s")
    (HERE / "flow.json").write_text(json.dumps(cases, indent=1) + "\n")


def race(path, tracker, options):
    n, *arcs, links = graph(path, **options)
    cost, seconds = solve(n, *arcs)
    flags = [f"--{k.replace('_', '-')}={v}" for k, v in options.items()]
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        subprocess.run([tracker, "link", path, "--out", f"{folder}/tracks.txt", "--report", report, *flags], check=True)
        told = json.loads(report.read_text())
    print(f"{n} detections, {links} edges; OR-tools {cost:.6f} in {seconds:.3f} s; here {told['detections']} detections, "
          f"{told['edges']} edges, {told['total_cost']:.6f} in {told['solve_seconds']:.3f} s "
          f"({told['solve_seconds'] / seconds:.3f} of the time)")


def main():
    if sys.argv[1:2] == ["--time"]:
        path, tracker, *options = sys.argv[2:]
        parse = lambda text: int(text) if text.isdigit() else float(text)
        given = dict(option.split("=") for option in options)
        race(path, tracker, {**CASES[0], **{k: parse(v) for k, v in given.items()}})
        return
    record(sys.argv[1] if len(sys.argv) > 1 else None)


if __name__ == "__main__":
    main()
