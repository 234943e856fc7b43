#!/usr/bin/env python3
"""The film sums of every scene, integrator, regularization and number of lanes, bit for bit as another build makes them.

    python3 tests/sums/same.py record BUILD FILE.json    renders everything and keeps digests of sums and attributes
    python3 tests/sums/same.py compare BUILD FILE.json   renders everything again and names each difference

BUILD is an `abbe` program. Run by hand: a change that claims to leave images as they are is held to it. Scenes that need
generated meshes are rendered where these exist (`cargo run --release --example bench_meshes`). Attributes are compared but
for `abbeVersion` and hashes. `--only TEXT` keeps the cells whose name contains TEXT; `--sums-only` leaves attributes out.
"""

import argparse
import concurrent.futures
import hashlib
import itertools
import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]
INTEGRATORS = ["path", "light", "bdpt", "vcm", "bpm", "ppm"]
WIDTH = 32
PASSES = 2
PREFIX = 16
CHECKSUM = 8


def scenes():
    found = sorted((ROOT / "scenes").glob("*.toml")) + sorted((ROOT / "scenes/bench").glob("*.toml"))
    return [p for p in found if p.name != "mesh.toml" or (ROOT / "scenes/bench/generated").exists()]


def size(scene):
    """Overrides that make each sensor WIDTH pixels wide."""
    sensors = tomllib.loads(scene.read_text())["sensor"]
    options = []
    for i, sensor in enumerate(sensors):
        width, height = sensor["resolution"]
        height = max(1, round(WIDTH * height / width))
        options += ["--set", f"sensor.{i}.resolution=[{WIDTH}, {height}]"]
    return options


def digest(part):
    """What a part file holds: digest of its sums, and its attributes."""
    data = part.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    header = json.loads(data[PREFIX : PREFIX + length])
    sums = hashlib.sha256(data[PREFIX + length : -CHECKSUM]).hexdigest()
    names = {k: v for k, v in header["image"].items() if k != "abbeVersion" and "hash" not in k.lower()}
    return sums, names


def render(build, scene, integrator, regularize, lanes):
    with tempfile.TemporaryDirectory() as folder:
        part = pathlib.Path(folder) / "x.part"
        command = [build, "render", str(scene), "-o", f"{folder}/x.exr", "--part", str(part), "--no-preview"]
        command += ["--integrator", integrator, "--regularize", regularize, "--lanes", str(lanes)]
        command += ["--spp", str(PASSES), "--threads", "1", "--quiet", "--seed", "7", *size(scene)]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        if run.returncode != 0:
            return {"refused": run.stderr.strip().replace(folder, "").replace(str(ROOT), "")}
        parts = sorted(pathlib.Path(folder).glob("*.part"))
        found = {p.name: digest(p) for p in parts}
        return {name: {"sums": sums, "attributes": names} for name, (sums, names) in found.items()}


def cells(only):
    for scene, integrator, regularize, lanes in itertools.product(scenes(), INTEGRATORS, ["off", "mis"], [1, 4]):
        name = f"{scene.relative_to(ROOT / 'scenes')} {integrator} {regularize} {lanes}"
        if not only or only in name:
            yield name, (scene, integrator, regularize, lanes)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=["record", "compare"])
    parser.add_argument("build")
    parser.add_argument("file", type=pathlib.Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--sums-only", action="store_true")
    options = parser.parse_args()
    build = str(pathlib.Path(options.build).resolve())
    todo = list(cells(options.only))
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        found = dict(zip((n for n, _ in todo), pool.map(lambda cell: render(build, *cell[1]), todo)))
    if options.action == "record":
        options.file.write_text(json.dumps(found, indent=1, sort_keys=True))
        refused = sum("refused" in v for v in found.values())
        print(f"{len(found)} cells recorded, {refused} of them refused by the program")
        return 0
    wanted = json.loads(options.file.read_text())
    wrong = 0
    for name, value in found.items():
        if name not in wanted:
            print(f"{name}: not recorded")
            wrong += 1
            continue
        before = wanted[name]
        if options.sums_only and "refused" not in value and "refused" not in before:
            value = {k: v["sums"] for k, v in value.items()}
            before = {k: v["sums"] for k, v in before.items()}
        if value != before:
            wrong += 1
            print(f"{name}: differs\n  before {before}\n  now    {value}")
    print(f"{len(found)} cells, {wrong} differ")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
