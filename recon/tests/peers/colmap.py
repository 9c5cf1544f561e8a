#!/usr/bin/env python3
"""COLMAP's sparse reconstruction and `recon` on the same captures: errors against the true poses, and times.

    python3 -m venv venv && venv/bin/pip install pycolmap==4.2.1 numpy
    cargo build --release -p recon && cargo build --release -p tests --example motion_error
    venv/bin/python recon/tests/peers/colmap.py DATA_FOLDER... [--seeds N] [--matching sequential|exhaustive] [--programs FOLDER]

A DATA_FOLDER has `room.toml`, `capture/NAME/*.jpg` and `truth.json`: shared/data/office and shared/data/hololens, which
`motion_error` knows. COLMAP (https://github.com/colmap/colmap): CPU, intrinsics given and held; each image is matched with the
next ten and those 16, 32, … further on, which is its best for films (`--matching exhaustive`: with all). Its time is features,
matching and mapping; recon's is that of a whole `recon build` of all captures, dense stereo included, as a draft and in full. Wall
time depends on what else the machine does, so both programs' processor time is printed as well.
Errors: poses aligned by their rotations, then centres by shift and scale; both systems by the same rule.
"""
import argparse
import json
import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

import numpy as np

PROGRAMS = Path(__file__).resolve().parents[3] / "target/release"


def aligned_errors(estimated, truth):
    """-> rms distance of the centres in cm, rms angle in degrees; `estimated`: (R, t) or None a frame"""
    known = [i for i, pose in enumerate(estimated) if pose is not None]
    if len(known) < 3:
        return float("nan"), float("nan")
    turns = sum(truth[i][0].T @ estimated[i][0] for i in known)
    u, _, vt = np.linalg.svd(turns)
    mean = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    found = np.array([mean @ (-estimated[i][0].T @ estimated[i][1]) for i in known])
    wanted = np.array([-truth[i][0].T @ truth[i][1] for i in known])
    found, wanted = found - found.mean(0), wanted - wanted.mean(0)
    scale = (found * wanted).sum() / (found**2).sum()
    off = np.linalg.norm(found * scale - wanted, axis=1)
    cosine = [(np.trace(truth[i][0].T @ estimated[i][0] @ mean.T) - 1) / 2 for i in known]
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    return 100 * np.sqrt((off**2).mean()), np.sqrt((angle**2).mean())


def timed(work):
    """-> what `work` returns, seconds on the wall, seconds of its child processes on processors"""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    result = work()
    wall, after = time.monotonic() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return result, wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def colmap(images, matrix, seed, matching):
    """-> (R, t) of each image in name order, None where COLMAP placed none"""
    import pycolmap  # Here: each reconstruction has a process of its own, whose time is taken.

    pycolmap.logging.minloglevel = pycolmap.logging.ERROR.value  # It tells every image.
    (fx, _, cx), (_, fy, cy) = matrix[0], matrix[1]
    pycolmap.set_random_seed(seed)
    with tempfile.TemporaryDirectory() as scratch:
        database = Path(scratch) / "database.db"
        reader = pycolmap.ImageReaderOptions()
        reader.camera_model = "PINHOLE"
        reader.camera_params = f"{fx},{fy},{cx + 0.5},{cy + 0.5}"  # COLMAP's pixels have their corner at 0.
        pycolmap.extract_features(
            database, images, camera_mode=pycolmap.CameraMode.SINGLE, reader_options=reader, device=pycolmap.Device.cpu
        )
        match = {"sequential": pycolmap.match_sequential, "exhaustive": pycolmap.match_exhaustive}[matching]
        match(database, device=pycolmap.Device.cpu)
        options = pycolmap.IncrementalPipelineOptions()
        options.ba_refine_focal_length = options.ba_refine_extra_params = False
        models = pycolmap.incremental_mapping(database, images, scratch, options)
    names = sorted(p.name for p in images.iterdir())
    estimated = [None] * len(names)
    if models:
        best = max(models.values(), key=lambda model: model.num_reg_images())
        for image in best.images.values():
            if image.has_pose:
                pose = image.cam_from_world()
                estimated[names.index(image.name)] = (pose.rotation.matrix(), pose.translation)
    return estimated


def recon_motion(programs, camera, seed):
    """-> cm, degrees, as the `motion_error` example measures them"""
    program = programs / "examples/motion_error"
    said = subprocess.run([program, camera, "--seed", str(seed)], capture_output=True, text=True).stdout
    fields = said.replace("°", " ").split()
    if len(fields) < 4 or fields[2] != "cm":
        raise SystemExit(f"{program} {camera} said {said!r}: it knows the captures of office and hololens")
    return float(fields[1]), float(fields[3])


def recon_build(programs, folder, seed, quality):
    """-> whether the whole room was built, and the most memory that it held, MiB"""
    with tempfile.TemporaryDirectory() as scratch:
        command = [programs / "recon", "build", folder / "room.toml", "--quality", quality, "--seed", str(seed)]
        child = subprocess.Popen(
            [*command, "--out", Path(scratch) / "room"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        said = child.stderr.read()
        _, status, usage = os.wait4(child.pid, 0)
    if status != 0:
        print(f"recon build: {said.strip()}", file=sys.stderr)
    return status == 0, usage.ru_maxrss / 1024


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, metavar="DATA_FOLDER")
    parser.add_argument("--seeds", type=int, default=1, metavar="N", help="runs of each, with seeds 1 … N")
    parser.add_argument("--matching", default="sequential", choices=["sequential", "exhaustive"], help="of COLMAP")
    parser.add_argument("--programs", type=Path, default=PROGRAMS, help="where `recon` and `examples/motion_error` lie")
    arguments = parser.parse_args()
    print("                       COLMAP, sparse                            recon")
    print("capture        seed   cm rms  ° rms  frames      s  cpu s   cm rms  ° rms")
    fresh = multiprocessing.get_context("spawn")
    for folder in (f.resolve() for f in arguments.folders):
        truth = json.loads((folder / "truth.json").read_text())["cameras"]
        cameras = tomllib.loads((folder / "room.toml").read_text())["camera"]
        for seed in range(1, arguments.seeds + 1):
            total_wall = total_cpu = 0.0
            for camera in cameras:
                name, images = camera["name"], folder / camera["capture"]

                def run():
                    with fresh.Pool(1) as pool:
                        estimated = pool.apply(colmap, (images, truth[name]["K"], seed, arguments.matching))
                        pool.close()
                        pool.join()
                        return estimated

                estimated, wall, cpu = timed(run)
                total_wall, total_cpu = total_wall + wall, total_cpu + cpu
                poses = [(np.array(c["R"]), np.array(c["t"])) for c in truth[name]["capture"]]
                cm, degrees = aligned_errors(estimated, poses)
                own_cm, own_degrees = recon_motion(arguments.programs, f"{folder.name}/{name}", seed)
                placed = f"{sum(e is not None for e in estimated)}/{len(estimated)}"
                print(
                    f"{folder.name + '/' + name:14} {seed:4} {cm:8.2f} {degrees:6.2f} {placed:>7} {wall:6.1f} {cpu:6.1f} "
                    f"{own_cm:8.2f} {own_degrees:6.2f}",
                    flush=True,
                )
            for quality in ["draft", "full"]:
                (built, memory), wall, cpu = timed(lambda: recon_build(arguments.programs, folder, seed, quality))
                print(
                    f"{folder.name:14} {seed:4} recon build --quality {quality}{'' if built else ' (REFUSED)'}: {wall:.1f} s "
                    f"({wall / total_wall:.2f} of COLMAP's sparse stage), processors {cpu:.1f} s ({cpu / total_cpu:.2f}), "
                    f"{memory:.0f} MiB at most",
                    flush=True,
                )


if __name__ == "__main__":
    main()
