#!/usr/bin/env python3
"""Log-RMSE against CPU time of independent and of Metropolis samples, without cones, with cones and aimed.

    python3 tests/benches/metropolis.py ABBE [--times 1,5,20] [--seeds 3] [--size 80,60] [--reference REFERENCE.exr]
        [--csv FILE]

The torus in its cube of glass (Figure 1 of Bouchard et al. 2013), one thread. Each render has as many passes as fill a time,
by the speed of a short one, and its CPU time is that of the passes as `--stats` tells; errors are against a long render by
photon merging, another estimator, made first if it is not given. Printed is, for each method and time, the median of the log-RMSE over
the seeds with the least and the largest, and the median CPU time. Run by hand; nothing depends on how fast the machine is but where the
points lie.
"""

import argparse
import csv
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent.parent.parent
SCENE = HERE / "scenes/torus_in_glass_cube.toml"
METHODS = {
    "bdpt": ["--integrator", "bdpt", "--regularize", "off", "--aim", "off"],
    "bdpt, regularized": ["--integrator", "bdpt", "--regularize", "mis", "--aim", "off"],
    "bdpt, aimed": ["--integrator", "bdpt", "--regularize", "off", "--aim", "auto"],
    "pssmlt": ["--integrator", "pssmlt", "--regularize", "off", "--aim", "off"],
    "pssmlt, regularized": ["--integrator", "pssmlt", "--regularize", "mis", "--aim", "off"],
    "pssmlt, aimed": ["--integrator", "pssmlt", "--regularize", "off", "--aim", "auto"],
}


def run(*command):
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stderr}")
    return done.stdout


class Bench:
    def __init__(self, arguments, folder):
        self.abbe, self.folder, self.size = arguments.abbe, folder, arguments.size
        self.image, self.stats = folder / "image.exr", folder / "stats.json"

    def render(self, method, passes, seed, image, threads=1):
        common = ["--set", f"sensor.0.resolution=[{self.size}]", "--filter", "box", "--threads", threads]
        output = ["--spp", passes, "--seed", seed, "--stats", self.stats, "-o", image, "--no-preview", "-q"]
        run(self.abbe, "render", SCENE, *common, *method, *output)
        return json.loads(self.stats.read_text())["sensors"][0]["cpu_seconds"]

    def reference(self):
        image = self.folder / "reference.exr"
        method = ["--integrator", "vcm", "--regularize", "off", "--set", "render.merge_radius=0.05"]
        self.render(method, 8000, 77, image, threads=2)
        return image

    def error(self, reference):
        return json.loads(run(self.abbe, "compare", self.image, reference, "--json"))["log_rmse"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("abbe", type=pathlib.Path)
    parser.add_argument("--times", default="1,5,20", help="CPU seconds")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--size", default="80,60")
    parser.add_argument("--reference", type=pathlib.Path)
    parser.add_argument("--methods", default=";".join(METHODS))
    parser.add_argument("--csv", type=pathlib.Path)
    arguments = parser.parse_args()
    times = [float(t) for t in arguments.times.split(",")]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(arguments, pathlib.Path(folder))
        reference = arguments.reference or bench.reference()
        for name in arguments.methods.split(";"):
            method = METHODS[name]
            # the difference of two short renders is without what comes before the first pass
            few, more = (bench.render(method, passes, 1, bench.image) for passes in (16, 48))
            first, per_pass = few, max((more - few) / 32, 1e-4)
            for time in times:
                passes = max(4, round((time - max(first - 16 * per_pass, 0)) / per_pass))
                runs = []
                for seed in range(11, 11 + arguments.seeds):
                    cpu = bench.render(method, passes, seed, bench.image)
                    runs.append((cpu, bench.error(reference)))
                    rows.append([name, passes, seed, *runs[-1]])
                cpu = statistics.median(r[0] for r in runs)
                errors = sorted(r[1] for r in runs)
                spread = f"{errors[0]:.3f} to {errors[-1]:.3f}"
                print(f"| {name} | {passes} | {cpu:.1f} s | {statistics.median(errors):.3f} ({spread}) |", flush=True)
    if arguments.csv:
        with arguments.csv.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["method", "passes", "seed", "cpu_seconds", "log_rmse"])
            writer.writerows(rows)


if __name__ == "__main__":
    main()
