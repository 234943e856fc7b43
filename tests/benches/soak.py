#!/usr/bin/env python3
"""Renders every scene whose chains can be solved for, for long, and looks for numbers that are none.

    cargo build --release
    python3 -m venv target/variance && target/variance/bin/pip install -r tests/colour/requirements.txt
    target/variance/bin/python tests/benches/soak.py [ABBE] [--paths 1e6] [--seed 1] [--scenes torus_in_glass_cube,goblet] [--options=--aim=all]

Each scene takes `--paths` samples of at most 40,000 pixels of its first camera. Printed are the samples, the connections that were
tried, chains among them, the contributions that were not finite or too large for a film, and what no contribution exceeds, in
units of the mean pixel: the brightest pixel times the passes. Run by hand; it is no part of the test suite.
"""
import argparse
import json
import pathlib
import re
import subprocess
import sys
import tempfile

import OpenEXR

ROOT = pathlib.Path(__file__).resolve().parents[2]


def scenes():
    return sorted(ROOT.glob("scenes/*.toml")) + sorted(ROOT.glob("scenes/bench/*.toml"))


def camera_of(abbe, scene):
    """Size of the film of the first sensor, where it is a camera and the scene has chains."""
    text = subprocess.run([abbe, "info", scene], capture_output=True, text=True).stdout
    kinds = re.search(r"^\s*(\d+) kinds?,", text, re.MULTILINE)
    size = re.search(r"^sensors\n\s+\S+\s+perspective, (\d+) x (\d+) pixels", text, re.MULTILINE)
    return (int(size[1]), int(size[2])) if kinds and int(kinds[1]) and size else None


def render(abbe, scene, size, passes, seed, options, folder):
    width, height = size
    scale = min(1.0, (40_000 / (width * height)) ** 0.5)
    resolution = [max(1, round(side * scale)) for side in size]
    out, stats = folder / "out.exr", folder / "stats.json"
    command = [abbe, "render", scene, "-o", out, "--stats", stats, "-q", "--no-preview", "--seed", str(seed)]
    command += ["--spp", str(passes), "--filter", "box", "--set", f"sensor.0.resolution={resolution}"] + options
    subprocess.run(command, check=True)
    with OpenEXR.File(str(out), separate_channels=True) as file:
        image = file.channels()["Y"].pixels
    sensor = json.loads(stats.read_text())["sensors"][0]
    return dict(
        samples=resolution[0] * resolution[1] * passes,
        connections=sensor["connections_tried"],
        searches=sensor["chains_tried"],
        chains=sensor["chains_found"],
        non_finite=sensor["non_finite"],
        saturated=sensor["saturated"],
        largest=round(float(image.max() / image.mean()) * passes),
    ), sensor["cpu_seconds"]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("abbe", nargs="?", default=ROOT / "target" / "release" / "abbe")
    parser.add_argument("--paths", type=float, default=1e6)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scenes", default="")
    parser.add_argument("--options", default="", help="more options of abbe render, apart by spaces")
    args = parser.parse_args()
    wanted = set(filter(None, args.scenes.split(",")))
    rows = []
    with tempfile.TemporaryDirectory() as name:
        for scene in scenes():
            size = camera_of(args.abbe, scene)
            if wanted and scene.stem not in wanted or not size:
                continue
            passes = max(1, round(args.paths / min(40_000, size[0] * size[1])))
            row, seconds = render(args.abbe, scene, size, passes, args.seed, args.options.split(), pathlib.Path(name))
            rows.append(row)
            print(f"{scene.stem:28}" + "".join(f"{key} {value:<14,}" for key, value in row.items()) + f"{seconds:.0f} s", flush=True)
    if not rows:
        sys.exit("no scene with chains")
    totals = {key: (max if key == "largest" else sum)(row[key] for row in rows) for key in rows[0]}
    print(f"{'all':28}" + "".join(f"{key} {value:<14,}" for key, value in totals.items()))
    if totals["non_finite"] or totals["saturated"]:
        sys.exit("contributions that are no number")


if __name__ == "__main__":
    main()
