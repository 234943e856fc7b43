#!/usr/bin/env python3
"""Log-RMSE against CPU time of independent and of Metropolis samples, without cones, with cones and aimed.

    python3 tests/benches/metropolis.py ABBE [--times 1,3,10,30,100] [--seeds 3] [--long 300] [--size 80,60]
        [--reference REFERENCE.exr] [--csv FILE] [--plot FILE.svg] [--methods NAME;NAME] [--set KEY=VALUE]...
    python3 tests/benches/metropolis.py ABBE --brightness SCENE,SCENE [--times 5,50] [--seeds 4] [--long 300] [--size 80,60]

The torus in its cube of glass (Figure 1 of Bouchard et al. 2013), one thread. Each method and seed is one render that is stopped near
each of the times, by the speed of a short one, and goes on from its part; CPU time is that of the program, start and pilots included.
The first seed goes on to the time of --long. Errors are against a long render by photon merging, another estimator, made first if it is
not given. Printed is, for each method and time, the median of the log-RMSE over the seeds with the least and the largest, and the median
CPU time; --plot draws them (matplotlib). Run by hand; nothing depends on how fast the machine is but where the points lie.

The second form prints the mean Y of `pssmlt` at default settings over that of `bdpt`: as many renders by bdpt as there are seeds, each for
the last of --times; every seed of pssmlt goes on to --long. The standard error is from the spread of both.
"""

import argparse
import csv
import json
import math
import os
import pathlib
import shutil
import statistics
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent.parent.parent
SCENE = HERE / "scenes/torus_in_glass_cube.toml"


def scene_file(name):
    """A scene of scenes/bench, or else of scenes."""
    bench = HERE / f"scenes/bench/{name}.toml"
    return bench if bench.exists() else HERE / f"scenes/{name}.toml"


METHODS = {
    "bdpt": ["--integrator", "bdpt", "--regularize", "off", "--aim", "off"],
    "bdpt, regularized": ["--integrator", "bdpt", "--regularize", "mis", "--aim", "off"],
    "bdpt, aimed": ["--integrator", "bdpt", "--regularize", "off", "--aim", "auto"],
    "pssmlt": ["--integrator", "pssmlt", "--regularize", "off", "--aim", "off"],
    "pssmlt, regularized": ["--integrator", "pssmlt", "--regularize", "mis", "--aim", "off"],
    "pssmlt, aimed": ["--integrator", "pssmlt", "--regularize", "off", "--aim", "auto"],
}
FIRST_SEED = 11


def run(*command):
    """Standard output and CPU seconds of a command."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        process = subprocess.Popen([str(c) for c in command], stdout=out, stderr=err)
        _, status, usage = os.wait4(process.pid, 0)
        out.seek(0)
        err.seek(0)
        if status:
            sys.exit(f"{' '.join(map(str, command))}\n{err.read().decode()}")
        return out.read().decode(), usage.ru_utime + usage.ru_stime


class Bench:
    def __init__(self, arguments, folder, scene=SCENE):
        self.abbe, self.folder, self.size, self.scene = arguments.abbe, folder, arguments.size, scene
        self.options = [word for keyed in arguments.set for word in ("--set", keyed)]
        self.image, self.part = folder / "image.exr", folder / "image.part"

    def render(self, method, passes, seed, image, *more, threads=1):
        common = ["--set", f"sensor.0.resolution=[{self.size}]", "--filter", "box", "--threads", threads, *self.options]
        output = ["--spp", passes, "--seed", seed, "-o", image, "--no-preview", "-q", *more]
        return run(self.abbe, "render", self.scene, *common, *method, *output)[1]

    def reference(self):
        image = self.folder / "reference.exr"
        method = ["--integrator", "vcm", "--regularize", "off", "--set", "render.merge_radius=0.05"]
        self.render(method, 8000, 77, image, threads=2)
        return image

    def compare(self, reference):
        return json.loads(run(self.abbe, "compare", self.image, reference, "--json")[0])

    def error(self, reference):
        return self.compare(reference)["log_rmse"]

    def brightness(self, reference):
        return self.compare(reference)["mean_ratio"]["Y"]

    def curve(self, method, seed, times, figure):
        """(passes, CPU seconds, figure of the image) near each of the times."""
        # the difference of two short renders is without what comes before the first pass
        few, more = (self.render(method, passes, seed, self.image) for passes in (16, 48))
        per_pass = max((more - few) / 32, 1e-4)
        self.part.unlink(missing_ok=True)
        passes = cpu = 0
        points = []
        for time in times:
            passes = max(4, passes + 2, passes + round((time - cpu) / per_pass))
            kept = ["--resume"] if points else []
            cpu += self.render(method, passes, seed, self.image, "--part", self.part, *kept)
            per_pass = cpu / passes
            points.append((passes, cpu, figure()))
        return points


def mean_and_error(values):
    """Mean and its standard error from the spread."""
    error = statistics.stdev(values) / len(values) ** 0.5 if len(values) > 1 else math.nan
    return statistics.mean(values), error


def brightness(arguments, times, folder):
    """Prints mean Y of chains over that of independent samples, scene by scene."""
    times_and_long = times + ([arguments.long] if arguments.long else [])
    unit = folder / "independent.exr"
    for name in arguments.brightness.split(","):
        bench = Bench(arguments, folder, scene_file(name))
        unit.unlink(missing_ok=True)
        independent = []
        for seed in range(1, arguments.seeds + 1):
            bench.curve(["--integrator", "bdpt"], seed, times[-1:], lambda: None)
            if not unit.exists():
                shutil.copy(bench.image, unit)
            independent.append(bench.brightness(unit))
        expected, expected_error = mean_and_error(independent)
        by_seed = []
        for seed in range(FIRST_SEED, FIRST_SEED + arguments.seeds):
            by_seed.append(bench.curve(["--integrator", "pssmlt"], seed, times_and_long, lambda: bench.brightness(unit)))
        for at in zip(*by_seed):
            mean, error = mean_and_error([p[2] / expected for p in at])
            both = math.hypot(error, expected_error / expected)
            print(f"| {name} | {statistics.median(p[1] for p in at):.1f} s | {mean:.4f} +- {both:.4f} |", flush=True)


def plot(curves, file):
    import matplotlib

    matplotlib.use("svg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7, 4.6))
    colors = {"": "#d55e00", ", regularized": "#0072b2", ", aimed": "#009e73"}
    for name, points in curves.items():
        kind = name.removeprefix("bdpt").removeprefix("pssmlt")
        times = [statistics.median(p[1] for p in at) for at in points]
        errors = [sorted(p[2] for p in at) for at in points]
        style = "--" if name.startswith("bdpt") else "-"
        axes.plot(times, [statistics.median(e) for e in errors], style, color=colors[kind], marker="o", ms=3, label=name)
        axes.fill_between(times, [e[0] for e in errors], [e[-1] for e in errors], color=colors[kind], alpha=0.12)
    axes.set(xscale="log", yscale="log", xlabel="CPU time (s)", ylabel="log-RMSE")
    axes.grid(which="both", alpha=0.25)
    axes.legend(fontsize="small")
    figure.tight_layout()
    figure.savefig(file, metadata={"Date": None})


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("abbe", type=pathlib.Path)
    parser.add_argument("--times", default="1,3,10,30,100", help="CPU seconds")
    parser.add_argument("--long", type=float, help="CPU seconds of the first seed")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--size", default="80,60")
    parser.add_argument("--reference", type=pathlib.Path)
    parser.add_argument("--methods", default=";".join(METHODS))
    parser.add_argument("--set", action="append", default=[], help="KEY=VALUE, for all methods")
    parser.add_argument("--brightness", help="scenes whose mean is compared")
    parser.add_argument("--csv", type=pathlib.Path)
    parser.add_argument("--plot", type=pathlib.Path)
    arguments = parser.parse_args()
    times = [float(t) for t in arguments.times.split(",")]
    rows, curves = [], {}
    with tempfile.TemporaryDirectory() as folder:
        if arguments.brightness:
            return brightness(arguments, times, pathlib.Path(folder))
        bench = Bench(arguments, pathlib.Path(folder))
        reference = arguments.reference or bench.reference()
        for name in arguments.methods.split(";"):
            method = METHODS[name]
            by_seed = []
            for seed in range(FIRST_SEED, FIRST_SEED + arguments.seeds):
                beyond = [arguments.long] if arguments.long and seed == FIRST_SEED else []
                by_seed.append(bench.curve(method, seed, times + beyond, lambda: bench.error(reference)))
                rows += [[name, seed, *point] for point in by_seed[-1]]
            curves[name] = [[c[i] for c in by_seed if i < len(c)] for i in range(len(by_seed[0]))]
            for at in curves[name]:
                passes, cpu = (statistics.median(p[i] for p in at) for i in (0, 1))
                errors = sorted(p[2] for p in at)
                spread = f"{errors[0]:.3f} to {errors[-1]:.3f}" if len(at) > 1 else "one seed"
                print(f"| {name} | {passes:.0f} | {cpu:.1f} s | {statistics.median(errors):.3f} ({spread}) |", flush=True)
    if arguments.csv:
        with arguments.csv.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["method", "seed", "passes", "cpu_seconds", "log_rmse"])
            writer.writerows(rows)
    if arguments.plot:
        plot(curves, arguments.plot)


if __name__ == "__main__":
    main()
