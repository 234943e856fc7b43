#!/usr/bin/env python3
"""Mean brightness of pbrt-r4's Metropolis sampler against CPU time, over that of its independent samples.

    cargo install pbrt-r4 --version 4.5.2 --no-default-features --root target/pbrt --config 'profile.release.package.pbrt-r4.opt-level=3'
    python3 -m venv target/mlt && target/mlt/bin/pip install -r tests/colour/requirements.txt
    target/mlt/bin/python tests/peers/mlt.py target/pbrt/bin/pbrt-r4 [--scenes SCENE,SCENE] [--times 5,50] [--seeds 3]
        [--long 300] [--long-seeds 1] [--independent SECONDS] [--size 80,60] [--work FOLDER]

This measures of `mlt` what `tests/benches/metropolis.py --brightness` measures of `pssmlt`, at default settings (100,000 bootstrap
samples for each number of vertices, 1000 chains). The scene files of abbe are written as those of pbrt, with their limit of depth, box
filter and one thread; N-SF11 is its "glass-F11", which is SF11. Each time of each seed is a render from the start, of as many mutations
per pixel as come near it by the speed of earlier ones, and of one where the bootstrap alone takes longer. CPU time is that of the
program, start and bootstrap included. So many seeds as --long-seeds says are also rendered for --long.

Means are of luminance, over that of as many renders as there are seeds by pbrt-r4's own `bdpt`, or `path` in `cornell_diffuse`, each for
--independent or the last of --times. Printed are, for each scene and time, the mutations per pixel, the median CPU time, the mean ratio
with its standard error from the spread of both, and the ratio of each seed; where there is one seed, the error is that of what it is
measured against alone. --work keeps the .pbrt files and the last image. The --config has the build script of pbrt-r4 optimized: five CPU
minutes in place of far more. Run by hand; it is no part of the test suite.
"""

import argparse
import contextlib
import math
import pathlib
import statistics
import tempfile

import pbrt

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENES = {
    "torus_in_glass_cube": ("scenes/torus_in_glass_cube.toml", "bdpt"),
    "caustic_lens": ("scenes/bench/caustic_lens.toml", "bdpt"),
    "cornell_diffuse": ("scenes/bench/cornell_diffuse.toml", "path"),
}
FIRST_SEED = 11


class Bench(pbrt.Renderer):
    def __init__(self, arguments, folder, name):
        file, self.independent = SCENES[name]
        super().__init__(arguments.pbrt, ROOT / file, [int(n) for n in arguments.size.split(",")], folder)

    def mean(self, integrator, seed):
        """Mean luminance and CPU seconds."""
        luminance, seconds = self.render(integrator, seed)
        return float(luminance.mean()), seconds

    def chains(self, mutations, seed):
        return self.mean(f'Integrator "mlt" "integer mutationsperpixel" {mutations}', seed)

    def samples(self, count, seed):
        return self.mean(f'Sampler "independent" "integer pixelsamples" {count}\nIntegrator "{self.independent}"', seed)


def mean_and_error(values):
    """Mean and its standard error from the spread."""
    error = statistics.stdev(values) / len(values) ** 0.5 if len(values) > 1 else math.nan
    return statistics.mean(values), error


def brightness(arguments, folder, name):
    bench = Bench(arguments, folder, name)
    times = [float(t) for t in arguments.times.split(",")]
    known = [(count, bench.samples(count, 1)[1]) for count in (4, 36)]
    count = pbrt.near(arguments.independent or times[-1], known)
    independent = [bench.samples(count, seed) for seed in range(1, arguments.seeds + 1)]
    expected, expected_error = mean_and_error([mean for mean, _ in independent])
    seconds = statistics.median(seconds for _, seconds in independent)
    error = expected_error / expected
    print(f"{name}: {bench.independent} {count} samples per pixel, {seconds:.1f} s, mean Y {expected:.5g} (relative error {error:.4f})", flush=True)

    known = [(mutations, bench.chains(mutations, 1)[1]) for mutations in (1, 257)]
    plan = [(time, FIRST_SEED + arguments.seeds) for time in times]
    plan += [(arguments.long, FIRST_SEED + arguments.long_seeds)] if arguments.long else []
    for time, end in plan:
        mutations = pbrt.near(time, known)
        found = [bench.chains(mutations, seed) for seed in range(FIRST_SEED, end)]
        ratios = [mean / expected for mean, _ in found]
        seconds = statistics.median(seconds for _, seconds in found)
        if mutations > known[1][0]:
            known[1] = (mutations, seconds)
        mean, own = mean_and_error(ratios)
        both = math.hypot(0 if math.isnan(own) else own, mean * error)
        each = ", ".join(f"{r:.4f}" for r in ratios)
        print(f"| {name} | {mutations} | {seconds:.1f} s | {mean:.4f} +- {both:.4f} | {each} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pbrt", type=pathlib.Path, help="program pbrt-r4")
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--times", default="5,50", help="CPU seconds")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--long", type=float, help="CPU seconds of the first seeds")
    parser.add_argument("--long-seeds", type=int, default=1)
    parser.add_argument("--independent", type=float, help="CPU seconds of each render of independent samples")
    parser.add_argument("--size", default="80,60")
    parser.add_argument("--work", type=pathlib.Path, help="where the .pbrt files are kept")
    arguments = parser.parse_args()
    if arguments.work:
        arguments.work.mkdir(parents=True, exist_ok=True)
    kept = contextlib.nullcontext(arguments.work) if arguments.work else tempfile.TemporaryDirectory()
    with kept as folder:
        for name in arguments.scenes.split(","):
            brightness(arguments, pathlib.Path(folder), name)


if __name__ == "__main__":
    main()
