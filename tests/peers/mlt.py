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
import csv
import math
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import tomllib

import numpy as np
import OpenEXR

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENES = {
    "torus_in_glass_cube": ("scenes/torus_in_glass_cube.toml", "bdpt"),
    "caustic_lens": ("scenes/bench/caustic_lens.toml", "bdpt"),
    "cornell_diffuse": ("scenes/bench/cornell_diffuse.toml", "path"),
}
FIRST_SEED = 11


def run(*command):
    """CPU seconds of a command."""
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen([str(c) for c in command], stdout=log, stderr=log)
        _, status, usage = os.wait4(process.pid, 0)
        log.seek(0)
        if status:
            sys.exit(f"{' '.join(map(str, command))}\n{log.read().decode()}")
        return usage.ru_utime + usage.ru_stime


def numbers(values):
    return f"[{' '.join(f'{v:.9g}' for v in np.ravel(values))}]"


class Translation:
    """A scene file of abbe as directives of pbrt. What it has no word for is an error, not left out."""

    def __init__(self, file):
        self.folder, self.scene = file.parent, tomllib.loads(file.read_text())
        self.depth = self.scene["render"]["max_depth"]
        self.camera = self.scene["sensor"][0]["perspective"]
        self.world = "\n".join(self.object(o) for o in self.scene["object"])

    def spectrum(self, key, value):
        if isinstance(value, list):
            return f'"rgb {key}" {numbers(value)}'
        if isinstance(value, str):
            # comments, then a line of names
            lines = (self.folder / self.scene["spectrum"][value]["file"]).read_text().splitlines()
            rows = list(csv.reader(line for line in lines if not line.startswith("#")))[1:]
            return f'"spectrum {key}" {numbers([[float(x) for x in row] for row in rows])}'
        return f'"spectrum {key}" {numbers([360, value, 830, value])}'

    def material(self, thing):
        ((kind, keys),) = self.scene["material"][thing["material"]].items()
        if kind == "diffuse":
            return f'Material "diffuse" {self.spectrum("reflectance", keys["reflectance"])}'
        if kind == "conductor":
            metal = f'"spectrum eta" "metal-{keys["metal"]}-eta" "spectrum k" "metal-{keys["metal"]}-k"'
            return f'Material "conductor" {metal} "float roughness" {keys["roughness"]} "bool remaproughness" false'
        assert (kind, keys) == ("dielectric", {})
        medium = self.scene["medium"][thing["interior"]]
        if "ior" in medium:
            return f'Material "dielectric" "float eta" {medium["ior"]}'
        assert medium["sellmeier"][0][0] == 1.73759695
        return 'Material "dielectric" "spectrum eta" "glass-F11"'

    def light(self, emission):
        """Flat, or as a named illuminant; pbrt scales either to the luminance."""
        if isinstance(emission, dict):
            return f'AreaLightSource "diffuse" "spectrum L" "stdillum-{emission["name"]}" "float scale" {emission["luminance"]}'
        return f'AreaLightSource "diffuse" "spectrum L" [360 1 830 1] "float scale" {emission}'

    def object(self, thing):
        thing = dict(thing)
        if "emission" in thing:
            # lamps of abbe reflect nothing
            words = ['Material "diffuse" "spectrum reflectance" [360 0 830 0]', self.light(thing.pop("emission"))]
        else:
            words = [self.material(thing)]
        turn, move = placement(thing.pop("transform", []))
        for key in ("name", "material", "interior"):
            thing.pop(key, None)
        ((kind, shape),) = thing.items()
        if kind in ("sphere", "disk"):
            assert not move.any() and np.array_equal(turn, np.eye(3))
            words += round_shape(kind, shape)
        else:
            words.append(self.mesh(kind, shape, turn, move))
        return "\n    ".join(["AttributeBegin", *words]) + "\nAttributeEnd"

    def mesh(self, kind, shape, turn, move):
        normals = None
        if kind == "quad":
            c, u, v = (np.array(shape[k], float) for k in ("center", "u", "v"))
            # shines toward u x v, as seen from where the corners run counterclockwise
            points, triangles = np.array([c - u - v, c + u - v, c + u + v, c - u + v]), [(0, 1, 2), (0, 2, 3)]
        elif kind == "box":
            ends = np.array([shape["min"], shape["max"]], float)
            points = np.array([[ends[i >> axis & 1][axis] for axis in range(3)] for i in range(8)])
            quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
            triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
        else:
            assert kind == "mesh"
            mesh = self.scene["mesh"][shape] if isinstance(shape, str) else shape
            points, normals, triangles = read_obj(self.folder / mesh["obj"])
        words = ['Shape "trianglemesh"', f'"point3 P" {numbers(points @ turn.T + move)}']
        if normals is not None:
            words.append(f'"normal N" {numbers(normals @ turn.T)}')
        return "\n        ".join([*words, f'"integer indices" {numbers(triangles)}'])

    def text(self, image, size, seed, integrator):
        """The whole file; `integrator` with its settings."""
        eye, target = numbers(self.camera["eye"])[1:-1], numbers(self.camera["target"])[1:-1]
        # pbrt is left-handed; its angle is that of the shorter side
        assert size[0] >= size[1]
        return f"""Option "seed" {seed}
Scale -1 1 1
LookAt {eye}  {target}  0 1 0
Camera "perspective" "float fov" {self.camera["fov_deg"]}
Film "rgb" "string filename" "{image}" "integer xresolution" {size[0]} "integer yresolution" {size[1]} "bool savefp16" false
PixelFilter "box" "float xradius" 0.5 "float yradius" 0.5
{integrator} "integer maxdepth" {self.depth}
WorldBegin
{self.world}
"""


def placement(steps):
    """Matrix and translation of steps that are taken in turn."""
    turn, move = np.eye(3), np.zeros(3)
    for step in steps:
        ((kind, value),) = step.items()
        if kind == "translate":
            move = move + value
            continue
        assert kind == "rotate"
        x, y, z = np.array(value["axis"], float) / np.linalg.norm(value["axis"])
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        angle = math.radians(value["deg"])
        rotation = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
        turn, move = rotation @ turn, rotation @ move
    return turn, move


def round_shape(kind, shape):
    if kind == "sphere":
        return [f"Translate {numbers(shape['center'])[1:-1]}", f'Shape "sphere" "float radius" {shape["radius"]}']
    normal = np.array(shape["normal"], float) / np.linalg.norm(shape["normal"])
    u = np.cross(normal, np.eye(3)[np.argmin(abs(normal))])
    u /= np.linalg.norm(u)
    # column by column: the disk of pbrt faces +z
    columns = [[*u, 0], [*np.cross(normal, u), 0], [*normal, 0], [*shape["center"], 1]]
    return [f"ConcatTransform {numbers(columns)}", f'Shape "disk" "float radius" {shape["radius"]}']


def read_obj(file):
    """Points, normals of the same indices (or None), and triangles."""
    points, normals, triangles = [], [], []
    for line in file.read_text().splitlines():
        word, *rest = line.split() or [""]
        if word in ("v", "vn"):
            (points if word == "v" else normals).append([float(x) for x in rest])
        elif word == "f":
            corners = [[int(x) - 1 for x in corner.split("/") if x] for corner in rest]
            assert all(len(set(c)) == 1 for c in corners)
            first, *others = [c[0] for c in corners]
            triangles += [(first, a, b) for a, b in zip(others, others[1:])]
    assert not normals or len(normals) == len(points)
    return np.array(points), np.array(normals) if normals else None, triangles


class Bench:
    def __init__(self, arguments, folder, name):
        file, self.independent = SCENES[name]
        self.program, self.translation = arguments.pbrt, Translation(ROOT / file)
        self.size = [int(n) for n in arguments.size.split(",")]
        self.image, self.file = folder / "image.exr", folder / f"{name}.pbrt"

    def render(self, integrator, seed):
        """Mean luminance and CPU seconds."""
        self.file.write_text(self.translation.text(self.image, self.size, seed, integrator))
        # a render that fails may say so in its log alone
        self.image.unlink(missing_ok=True)
        seconds = run(self.program, "--nthreads", 1, "--quiet", self.file)
        with OpenEXR.File(str(self.image)) as file:
            channels = file.channels()
            pixels = channels["RGB"].pixels if "RGB" in channels else np.stack([channels[c].pixels for c in "RGB"], -1)
        return float((pixels.astype(float) @ [0.2126, 0.7152, 0.0722]).mean()), seconds

    def chains(self, mutations, seed):
        return self.render(f'Integrator "mlt" "integer mutationsperpixel" {mutations}', seed)

    def samples(self, count, seed):
        return self.render(f'Sampler "independent" "integer pixelsamples" {count}\nIntegrator "{self.independent}"', seed)


def near(time, known):
    """The count whose render takes about that CPU time, from two (count, CPU seconds) that are known."""
    (few, start), (more, end) = known
    return max(1, few + round((time - start) / max((end - start) / (more - few), 1e-4)))


def mean_and_error(values):
    """Mean and its standard error from the spread."""
    error = statistics.stdev(values) / len(values) ** 0.5 if len(values) > 1 else math.nan
    return statistics.mean(values), error


def brightness(arguments, folder, name):
    bench = Bench(arguments, folder, name)
    times = [float(t) for t in arguments.times.split(",")]
    known = [(count, bench.samples(count, 1)[1]) for count in (4, 36)]
    count = near(arguments.independent or times[-1], known)
    independent = [bench.samples(count, seed) for seed in range(1, arguments.seeds + 1)]
    expected, expected_error = mean_and_error([mean for mean, _ in independent])
    seconds = statistics.median(seconds for _, seconds in independent)
    error = expected_error / expected
    print(f"{name}: {bench.independent} {count} samples per pixel, {seconds:.1f} s, mean Y {expected:.5g} (relative error {error:.4f})", flush=True)

    known = [(mutations, bench.chains(mutations, 1)[1]) for mutations in (1, 257)]
    plan = [(time, FIRST_SEED + arguments.seeds) for time in times]
    plan += [(arguments.long, FIRST_SEED + arguments.long_seeds)] if arguments.long else []
    for time, end in plan:
        mutations = near(time, known)
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
