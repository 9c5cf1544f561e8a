#!/usr/bin/env python3
"""Makes the synthetic truth and tracks of this folder, and the figures that independent evaluators give for them.

    python3 -m venv venv && venv/bin/pip install trackeval==1.3.0 motmetrics==1.4.0
    venv/bin/python figures.py            # rewrites *.txt and figures.json, the same bytes every time
    venv/bin/python figures.py --mot15 FOLDER # rewrites mot15.json: figures of tracks made from MOT15 by `blurred`
    venv/bin/python figures.py --time TRACKER MOT15_FOLDER TRACKS_FOLDER # TrackEval and TRACKER on the same files, CPU seconds
    venv/bin/python figures.py --classes      # rewrites mot17_*.txt, mot20_*.txt and classes.json: the benchmarks' own protocols
    venv/bin/python figures.py TRUTH TRACKS   # prints the peers' figures of any two files of boxes (MOTChallenge 2-D)

MOT15 is not ours to ship: the crate's test makes the same tracks from it again, by the same rule.

TrackEval (https://github.com/JonathonLuiten/TrackEval) gives everything but the fragmentations, motmetrics
(https://github.com/cheind/py-motmetrics) gives those, and agrees on switches, misses, false positives and IDF1.
"""
import json
import random
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import motmetrics
import numpy as np
from trackeval.datasets import MotChallenge2DBox
from trackeval.datasets._base_dataset import _BaseDataset
from trackeval.metrics import CLEAR, HOTA, Identity

HERE = Path(__file__).parent
GATE_M = 0.5


def walk(seed, people, frames, size):
    """People who come, walk about, are sometimes not annotated, and go. -> {frame: {id: (x, y)}}"""
    rng = random.Random(seed)
    truth = {}
    for person in range(1, people + 1):
        first = rng.randrange(1, frames // 2)
        last = min(frames, first + rng.randrange(frames // 10, frames))
        x, y = rng.uniform(0, size), rng.uniform(0, size)
        vx, vy = rng.gauss(0, 0.06), rng.gauss(0, 0.06)
        gap = rng.randrange(first, last + 1)
        for frame in range(first, last + 1):
            vx, vy = 0.95 * vx + rng.gauss(0, 0.02), 0.95 * vy + rng.gauss(0, 0.02)
            x, y = min(max(x + vx, 0), size), min(max(y + vy, 0), size)
            if person % 4 == 0 and gap <= frame < gap + 6:
                continue
            truth.setdefault(frame, {})[person] = (x, y)
    return truth


def disturb(truth, seed, frames, size, noise):
    """What a middling tracker makes of it: noise, losses, swaps, new ids after losses, ghosts."""
    rng = random.Random(seed)
    tracks, alias, fresh, lost = {}, {}, 100, {}
    for frame in range(1, frames + 1):
        here = truth.get(frame, {})
        ids = sorted(here)
        if len(ids) > 1 and rng.random() < 0.06:
            a, b = rng.sample(ids, 2)
            if a in alias and b in alias:
                alias[a], alias[b] = alias[b], alias[a]
        for person in ids:
            if lost.get(person, 0) > 0:
                lost[person] -= 1
                if lost[person] == 0 and rng.random() < 0.5:
                    fresh += 1
                    alias[person] = fresh
                continue
            if rng.random() < 0.03:
                lost[person] = rng.randrange(1, 12)
                continue
            if person not in alias:
                fresh += 1
                alias[person] = fresh
            x, y = here[person]
            tracks.setdefault(frame, {})[alias[person]] = (x + rng.gauss(0, noise), y + rng.gauss(0, noise))
        if rng.random() < 0.15:
            tracks.setdefault(frame, {})[900 + frame // 20] = (rng.uniform(0, size), rng.uniform(0, size))
    return tracks


def floor_rows(people):
    return [f"{f},{i},-1,-1,-1,-1,1,{x:.3f},{y:.3f},0" for f in sorted(people) for i, (x, y) in sorted(people[f].items())]


def image_rows(people, confidence=1):
    rows = []
    for f in sorted(people):
        for i, (x, y) in sorted(people[f].items()):
            height = 60 + 25 * y
            rows.append(f"{f},{i},{90 * x - 0.2 * height:.2f},{100 + 20 * y:.2f},{0.4 * height:.2f},{height:.2f},{confidence}")
    return rows


def parse(path):
    """-> {frame: (ids, values)}: boxes or positions, rows whose 7th column is 0 left out"""
    frames = {}
    for line in Path(path).read_text().split():
        v = [float(t) for t in line.split(",")]
        if len(v) > 6 and v[6] == 0:
            continue
        value = v[2:6] if v[4] > 0 else v[7:9]
        ids, values = frames.setdefault(int(v[0]), ([], []))
        ids.append(int(v[1]))
        values.append(value)
    return frames


def blurred(folder):
    """Tracks of a middling tracker, from a sequence's truth and detections; whole numbers decide, so any language can."""
    state = 1
    def draw(n):
        nonlocal state
        state = (state * 1664525 + 1013904223) % 2**32
        return (state >> 8) % n
    rows = []
    for line in (folder / "truth.txt").read_text().split():
        v = [float(t) for t in line.split(",")]
        if v[6] == 0:
            continue
        is_lost, dx, dy = draw(100) < 20, draw(41) - 20, draw(41) - 20
        if not is_lost:
            track = int(v[1]) * 1000 + int(v[0]) // (15 + int(v[1]) % 40)
            rows.append([int(v[0]), track, v[2] + v[4] * dx / 100, v[3] + v[5] * dy / 100, v[4], v[5]])
    for index, line in enumerate((folder / "detections.txt").read_text().split()):
        v = [float(t) for t in line.split(",")]
        if index % 7 == 0:
            rows.append([int(v[0]), 10_000_000 + index // 70, *v[2:6]])
    seen, lines = set(), []
    for row in rows:
        if (row[0], row[1]) not in seen:
            seen.add((row[0], row[1]))
            lines.append(",".join(map(repr, row)) + ",1")
    return "\n".join(lines) + "\n"


def sequence_data(truth, tracks, on_floor):
    """What TrackEval's metrics take."""
    ids = lambda frames: sorted({i for found, _ in frames.values() for i in found})
    truth_numbers, track_numbers = ({i: n for n, i in enumerate(ids(frames))} for frames in (truth, tracks))
    data = dict(gt_ids=[], tracker_ids=[], similarity_scores=[], num_gt_ids=len(truth_numbers), num_tracker_ids=len(track_numbers))
    width = 2 if on_floor else 4
    for frame in range(1, max([*truth, *tracks]) + 1):
        t_ids, t = truth.get(frame, ([], []))
        k_ids, k = tracks.get(frame, ([], []))
        t, k = np.array(t, float).reshape(-1, width), np.array(k, float).reshape(-1, width)
        if on_floor:
            similarity = _BaseDataset._calculate_euclidean_similarity(t, k, zero_distance=2 * GATE_M)
        else:
            similarity = _BaseDataset._calculate_box_ious(t, k, box_format="xywh")
        data["gt_ids"].append(np.array([truth_numbers[i] for i in t_ids], int))
        data["tracker_ids"].append(np.array([track_numbers[i] for i in k_ids], int))
        data["similarity_scores"].append(similarity)
    data["num_gt_dets"] = sum(map(len, data["gt_ids"]))
    data["num_tracker_dets"] = sum(map(len, data["tracker_ids"]))
    data["num_timesteps"] = len(data["gt_ids"])
    return data


def trackeval_figures(data):
    """-> CLEAR, Identity, HOTA"""
    quiet = {"PRINT_CONFIG": False}
    return tuple(metric.eval_sequence(data) for metric in (CLEAR(quiet), Identity(quiet), HOTA()))


def figures(truth_path, tracks_path):
    truth, tracks = parse(truth_path), parse(tracks_path)
    on_floor = len(next(iter(truth.values()))[1][0]) == 2
    data = sequence_data(truth, tracks, on_floor)
    accumulator = motmetrics.MOTAccumulator(auto_id=False)
    for frame, similarity in enumerate(data["similarity_scores"], start=1):
        t_ids, t = truth.get(frame, ([], []))
        k_ids, k = tracks.get(frame, ([], []))
        if on_floor:
            distance = np.linalg.norm(np.array(t, float).reshape(-1, 2)[:, None] - np.array(k, float).reshape(-1, 2)[None], axis=2)
            distance[distance > GATE_M] = np.nan
        else:
            distance = 1 - similarity
            distance[similarity < 0.5] = np.nan
        accumulator.update(t_ids, k_ids, distance, frameid=frame)
    clear, identity, hota = trackeval_figures(data)
    peer = motmetrics.metrics.create().compute(
        accumulator,
        metrics=MOTMETRICS,
        return_dataframe=False,
    )
    result = reported(clear, identity, hota, on_floor)
    compare = peers_reported(peer, clear)
    if abs(peer["mota"] - clear["MOTA"]) < 1e-12:
        # Both paired truth and tracks alike (motmetrics lets a pair outlive a loss), so its count is the one expected.
        result["fragmentations"] = peer["num_fragmentations"]
    plain = lambda figures: {k: float(v) for k, v in figures.items()}
    return plain(result), plain(compare), (clear, identity, hota, accumulator)


def reported(clear, identity, hota, on_floor=False):
    motp = 2 * GATE_M * (1 - clear["MOTP"]) if on_floor else 100 * clear["MOTP"]
    mean = lambda field: 100 * hota[field].mean()
    return {
        "MOTA": 100 * clear["MOTA"], "MODA": 100 * clear["MODA"], "MOTP": motp,
        "recall": 100 * clear["CLR_Re"], "precision": 100 * clear["CLR_Pr"],
        "id_switches": clear["IDSW"], "misses": clear["CLR_FN"], "false_positives": clear["CLR_FP"],
        "mostly_tracked": clear["MT"], "mostly_lost": clear["ML"], "Frag": clear["Frag"],
        "IDF1": 100 * identity["IDF1"], "id_recall": 100 * identity["IDR"], "id_precision": 100 * identity["IDP"],
        **{field: mean(field) for field in ["HOTA", "DetA", "AssA", "DetRe", "DetPr", "AssRe", "AssPr", "LocA"]},
    }


def peers_reported(peer, clear):
    return {
        "MOTA": 100 * peer["mota"], "IDF1": 100 * peer["idf1"], "id_switches": peer["num_switches"],
        "misses": peer["num_misses"], "false_positives": peer["num_false_positives"],
        "fragmentations": peer["num_fragmentations"],
    }


MOTMETRICS = ["mota", "motp", "idf1", "num_switches", "num_fragmentations", "num_misses", "num_false_positives"]


def record_mot15(folder):
    """Per sequence and together, by both peers' own ways to combine."""
    each, parts = {}, {}
    for sequence in sorted(p for p in Path(folder).iterdir() if p.is_dir()):
        with tempfile.NamedTemporaryFile("w", suffix=".txt") as tracks:
            tracks.write(blurred(sequence))
            tracks.flush()
            trackeval, motmetrics_, parts[sequence.name] = figures(sequence / "truth.txt", tracks.name)
        trackeval.pop("fragmentations", None)
        each[sequence.name] = {"trackeval": trackeval, "motmetrics": motmetrics_}
    combine = lambda metric, index: metric.combine_sequences({name: part[index] for name, part in parts.items()})
    clear = combine(CLEAR({"PRINT_CONFIG": False}), 0)
    identity = combine(Identity({"PRINT_CONFIG": False}), 1)
    hota = combine(HOTA(), 2)
    overall = motmetrics.metrics.create().compute_many(
        [part[3] for part in parts.values()], metrics=MOTMETRICS, generate_overall=True).loc["OVERALL"]
    plain = lambda values: {k: float(v) for k, v in values.items()}
    each["together"] = {"trackeval": plain(reported(clear, identity, hota)), "motmetrics": plain(peers_reported(overall, clear))}
    (HERE / "mot15.json").write_text(json.dumps(each, indent=1) + "\n")
    print(json.dumps(each["together"], indent=1))


def with_classes(seed, people, frames, classes):
    """Truth as MOT17 and MOT20 write it (flag, class, visibility), and tracks that follow whatever looks like a person."""
    rng = random.Random(seed)
    truth, tracks = [], []
    for person in range(1, people + 1):
        kind = classes[person % len(classes)]
        x, y, height = rng.uniform(0, 1200), rng.uniform(0, 500), rng.uniform(60, 200)
        vx, vy = rng.gauss(0, 4), rng.gauss(0, 1)
        track, first = 100 + person, rng.randrange(1, frames // 3)
        for frame in range(first, min(frames, first + rng.randrange(frames // 3, frames)) + 1):
            if kind not in (7, 12):
                x, y = x + vx, y + vy
            visibility = round(rng.uniform(0, 1), 3)
            flag = int(kind == 1 and person % 9 != 0)
            truth.append((frame, person, x, y, 0.4 * height, height, flag, kind, visibility))
            if rng.random() < 0.02:
                track += 1000
            if rng.random() < 0.85:
                dx, dy = rng.gauss(0, 0.06 * height), rng.gauss(0, 0.05 * height)
                tracks.append((frame, track, x + dx, y + dy, 0.4 * height, height, round(rng.uniform(0.3, 1), 3)))
    line = lambda row: ",".join(f"{v:.2f}" if isinstance(v, float) and i in (2, 3, 4, 5) else str(v) for i, v in enumerate(row))
    return [line(row) for row in sorted(truth)], [line(row) + ",-1,-1,-1" for row in sorted(tracks)]


def benchmark_figures(benchmark, truth, tracks, frames):
    """What TrackEval's own dataset of the benchmark makes of two files."""
    with tempfile.TemporaryDirectory() as folder:
        gt, data = Path(folder, "gt/S/gt"), Path(folder, "tracks/T/data")
        gt.mkdir(parents=True), data.mkdir(parents=True)
        (gt / "gt.txt").write_text("\n".join(truth) + "\n")
        (data / "S.txt").write_text("\n".join(tracks) + "\n")
        dataset = MotChallenge2DBox({
            "GT_FOLDER": f"{folder}/gt", "TRACKERS_FOLDER": f"{folder}/tracks", "BENCHMARK": benchmark, "SKIP_SPLIT_FOL": True,
            "SEQ_INFO": {"S": frames}, "PRINT_CONFIG": False})
        judged = dataset.get_preprocessed_seq_data(dataset.get_raw_seq_data("T", "S"), "pedestrian")
    return {k: float(v) for k, v in reported(*trackeval_figures(judged)).items()}


def record_classes():
    recorded, frames = {}, 60
    for benchmark, seed, people, classes in [("MOT17", 21, 20, [1, 7, 1, 12, 1, 2, 3, 1, 8, 6]), ("MOT20", 22, 20, [1, 6, 1, 7, 1, 11, 13])]:
        truth, tracks = with_classes(seed, people, frames, classes)
        name = benchmark.lower()
        (HERE / f"{name}_truth.txt").write_text("\n".join(truth) + "\n")
        (HERE / f"{name}_tracks.txt").write_text("\n".join(tracks) + "\n")
        recorded[name] = benchmark_figures(benchmark, truth, tracks, frames)
        print(name, json.dumps(recorded[name]))
    (HERE / "classes.json").write_text(json.dumps(recorded, indent=1) + "\n")


def race(tracker, truth_folder, tracks_folder, repeats=7):
    """TrackEval's own work (reading, similarities, HOTA, CLEAR, Identity), alone and with its start (Python and its imports),
    against the whole process of `tracker eval`. CPU seconds, the least of some repeats in turn: a busy machine slows both."""
    def children():
        return sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])

    def spent_by(*command):
        before = children()
        subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
        return children() - before

    def peer(names):
        start = time.process_time()
        for name in names:
            truth, tracks = parse(f"{truth_folder}/{name}/truth.txt"), parse(f"{tracks_folder}/{name}.txt")
            trackeval_figures(sequence_data(truth, tracks, on_floor=False))
        return time.process_time() - start

    names = sorted(p.name for p in Path(truth_folder).iterdir() if p.is_dir())
    cases = [([n], f"{truth_folder}/{n}/truth.txt", f"{tracks_folder}/{n}.txt") for n in names]
    for chosen, truth, tracks in [*cases, (names, truth_folder, tracks_folder)]:
        times = [(peer(chosen), spent_by(sys.executable, "-c", "import trackeval"),
                  spent_by(tracker, "eval", "--truth", truth, "--tracks", tracks)) for _ in range(repeats)]
        work, start, here = (min(t[i] for t in times) for i in range(3))
        print(f"{chosen[0] if len(chosen) == 1 else 'together':16} TrackEval {work:.4f} s after {start:.4f} s to start, here {here:.4f} s: "
              f"{work / here:.1f} x its work, {(work + start) / here:.1f} x all of it")


def main():
    if len(sys.argv) == 5 and sys.argv[1] == "--time":
        race(*sys.argv[2:])
        return
    if len(sys.argv) == 3 and sys.argv[1] == "--mot15":
        record_mot15(sys.argv[2])
        return
    if sys.argv[1:] == ["--classes"]:
        record_classes()
        return
    if len(sys.argv) == 3:
        for part in figures(*sys.argv[1:])[:2]:
            print(json.dumps(part, indent=1))
        return
    recorded = {}
    for name, seed, people, frames, size, noise in [("sparse", 11, 6, 150, 7.0, 0.06), ("crowd", 12, 14, 200, 5.0, 0.16)]:
        truth = walk(seed, people, frames, size)
        tracks = disturb(truth, seed + 100, frames, size, noise)
        ghosts = {f: {77: (0.5 * size, 0.5 * size)} for f in range(10, 30)}
        for kind, rows in [("floor", floor_rows), ("image", image_rows)]:
            extra = image_rows(ghosts, confidence=0) if kind == "image" else []
            case = f"{name}_{kind}"
            (HERE / f"{case}_truth.txt").write_text("\n".join(rows(truth) + extra) + "\n")
            (HERE / f"{case}_tracks.txt").write_text("\n".join(rows(tracks)) + "\n")
            recorded[case], compare, _ = figures(HERE / f"{case}_truth.txt", HERE / f"{case}_tracks.txt")
            print(case, json.dumps(recorded[case]), "\n   motmetrics", json.dumps(compare))
    (HERE / "figures.json").write_text(json.dumps(recorded, indent=1) + "\n")


if __name__ == "__main__":
    main()
