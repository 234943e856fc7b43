#!/usr/bin/env python3
"""Traces the same rays through the double Gauss of scenes/lenses by abbe, optiland and ray-optics: intersections per core-second.

    python3 tests/peers/lens_rays.py [--rounds 5] [--work FOLDER] [--markdown]

Builds the example `lens_rays`, makes a Python environment in FOLDER (target/lens-peers) and installs both programs from PyPI into
it, once; a peer that does not install is named and left out. Run by hand on a machine that is otherwise quiet; it is no part of
the test suite.

A thousand rays of 587.5618 nm parallel to the axis fill the aperture. Every program traces all of them, over and over, on one
thread; CPU time, medians over the rounds, in which the programs take turns. An intersection is one ray at one surface, the
stop and the image included. optiland traces arrays: it gets all rays a hundred times over in one call. ray-optics traces ray by ray
in Python. Both get the indices that abbe has. All points of all surfaces must agree within 1e-9 mm.
"""
import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import time
import venv

ROOT = pathlib.Path(__file__).resolve().parents[2]
LENS = ROOT / "scenes" / "lenses" / "double_gauss.zmx"
PEERS = {"optiland": "optiland==0.6.3", "rayoptics": "rayoptics==0.9.8"}
COPIES = 100
TOLERANCE_MM = 1e-9


def by_optiland(bench):
    import numpy as np
    from optiland.fileio import load_zemax_file
    from optiland.materials import IdealMaterial
    from optiland.rays import RealRays

    optic = load_zemax_file(str(LENS))
    surfaces = list(optic.surfaces)
    for i, n in enumerate(bench["indices"]):
        surfaces[i].material_post = IdealMaterial(n)

    def rays(copies):
        columns = np.array([[*o, *d] for o, d in bench["rays"]]).T
        columns = [np.tile(c, copies) for c in columns]
        return RealRays(*columns, np.ones_like(columns[0]), np.full_like(columns[0], bench["nm"] * 1e-3))

    def points():
        optic.surfaces.trace(rays(1))
        each = [np.array([np.ravel(s.x), np.ravel(s.y), np.ravel(s.z)]) for s in surfaces[1:]]
        return np.array(each).transpose(2, 0, 1)

    def once():
        lot = rays(COPIES)
        start = time.process_time()
        optic.surfaces.trace(lot)
        return (time.process_time() - start) / COPIES

    return points, once


def by_rayoptics(bench):
    import numpy as np
    from opticalglass.opticalmedium import ConstantIndex
    from rayoptics.environment import OpticalModel
    from rayoptics.raytr import raytrace

    optical = OpticalModel()
    sequence = optical["seq_model"]
    z = bench["vertices"]
    distance = z[0] - bench["rays"][0][0][2]
    sequence.gaps[0].thi = distance
    for i, c in enumerate(bench["curvatures"][:-1]):
        sequence.add_surface([c, z[i + 1] - z[i]])
        sequence.gaps[sequence.cur_surface].medium = ConstantIndex(bench["indices"][i + 1], "index")
    optical.update_model()
    # rays start on its object, a plane
    rays = [(np.array([*o[:2], 0.0]), np.array(d)) for o, d in bench["rays"]]
    wavelength = sequence.wvlns[0]

    def points():
        every = [raytrace.trace(sequence, o, d, wavelength, eps=1e-14)[0][1:] for o, d in rays]
        vertex = np.array([[0.0, 0.0, at] for at in z])
        return np.array([[segment[0] for segment in ray] for ray in every]) + vertex

    def once():
        start = time.process_time()
        for o, d in rays:
            raytrace.trace(sequence, o, d, wavelength)
        return time.process_time() - start

    return points, once


def traced(name, bench, rounds):
    """In the environment of the peers: seconds of each round, and the largest distance from the points of abbe."""
    import numpy as np

    points, once = {"optiland": by_optiland, "rayoptics": by_rayoptics}[name](bench)
    off = np.linalg.norm(points() - np.array(bench["points"]), axis=-1).max()
    once()
    return {"seconds": [once() for _ in range(rounds)], "off_mm": float(off)}


def environment(folder):
    python = folder / "bin" / "python"
    if not python.exists():
        venv.create(folder, with_pip=True)
    there = []
    for name, package in PEERS.items():
        found = subprocess.run([python, "-m", "pip", "install", "-q", package], capture_output=True, text=True)
        if found.returncode == 0:
            there.append(name)
        else:
            print(f"{package} does not install: {found.stderr.strip().splitlines()[-1:]}")
    return python, there


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rounds", type=int, default=5)
    options.add_argument("--work", type=pathlib.Path, default=ROOT / "target" / "lens-peers")
    options.add_argument("--cargo", default="", help="further arguments of cargo, as one text")
    options.add_argument("--markdown", action="store_true")
    options.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    options = options.parse_args()
    if options.child:
        name, file = options.child
        print(json.dumps(traced(name, json.loads(pathlib.Path(file).read_text()), 1)))
        return
    python, there = environment(options.work)
    command = ["cargo", "build", "--release", "--example", "lens_rays", *options.cargo.split()]
    subprocess.run(command, cwd=ROOT, check=True)
    program = ROOT / "target" / "release" / "examples" / "lens_rays"
    one_thread = dict(os.environ, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", NUMBA_NUM_THREADS="1", MKL_NUM_THREADS="1")
    file = options.work / "rays.json"
    seconds, off = {}, {}
    for _ in range(options.rounds):
        text = subprocess.run([program], capture_output=True, text=True, check=True).stdout
        file.write_text(text)
        bench = json.loads(text)
        seconds.setdefault("abbe, trace", []).extend(bench["trace_s"])
        seconds.setdefault("abbe, scene", []).extend(bench["scene_s"])
        for name in there:
            child = [python, __file__, "--child", name, file]
            found = subprocess.run(child, capture_output=True, text=True, env=one_thread)
            if found.returncode != 0:
                print(f"{name} does not run: {found.stderr.strip().splitlines()[-1:]}")
                there = [other for other in there if other != name]
                continue
            found = json.loads(found.stdout.splitlines()[-1])
            seconds.setdefault(name, []).extend(found["seconds"])
            off[name] = max(off.get(name, 0.0), found["off_mm"])
    surfaces = len(bench["points"][0])
    counts = {name: len(bench["rays"]) * surfaces for name in seconds}
    counts["abbe, scene"] = bench["scene_intersections"]
    print(f"{len(bench['rays'])} rays, {surfaces} surfaces, {options.rounds} rounds")
    row = "| {} | {} | {} |" if options.markdown else "{:12} {:>28} {:>24}"
    print(row.format("program", "intersections per core-second", "largest distance, mm"))
    if options.markdown:
        print("|---|---|---|")
    for name, values in seconds.items():
        rate = counts[name] / statistics.median(values)
        print(row.format(name, f"{rate:.3g}", f"{off[name]:.1e}" if name in off else ""))
    if any(distance > TOLERANCE_MM for distance in off.values()):
        sys.exit(f"points differ by more than {TOLERANCE_MM} mm")


main()
