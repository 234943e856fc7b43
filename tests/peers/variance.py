#!/usr/bin/env python3
"""Measures variance times CPU time of weights and programs over the bench scenes.

    cargo build --release && cargo run --release --example bench_meshes
    python3 -m venv target/variance && target/variance/bin/pip install -r tests/colour/requirements.txt
    target/variance/bin/python tests/peers/variance.py --base PROGRAM [--scenes mesh,motion] [--spp 16,64] [--seeds 4]
        [--base-options OPTIONS] [--modes off,auto] [--rows 150] [--variant NAME=OPTIONS]... [--work FOLDER] [--json FILE]
        [--instructions]
    target/variance/bin/python tests/peers/variance.py --seconds 5,30 --seeds 16 --reference-spp 512 [--scenes ...] [--rows 75]

The second form compares errors of `bdpt` and `path` after the same CPU seconds.

PROGRAM is an older abbe to compare with; without it, this one is, under the balance heuristic or with --base-options. Every variant renders every scene
with the same seeds in turn, box filter, one thread. CPU time is the user time of the process less that of loading the scene, so
other load on the machine matters little; of the seeds the least time counts. Figures are variances over the seeds, per pixel over (reference^2 + .01) of an image
scaled to mean 1, times CPU seconds (with --instructions, times those of the passes without pilots: 80 less 64 passes, counted by
valgrind, so that load changes nothing; of programs that were built alike): of all pixels, of all but the worst .1 %, of the median pixel; and of the paths of direct and
once scattered light (LDE, LDDE) alone, mean and median. The reference is the mean of all images of this program but those of
`path`. Printed are the ratios of each variant to the base and to `path`; below 1 the variant is better. Run by hand; it is no
part of the test suite. Means over few seeds are ruled by few pixels where light is found by luck.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys

import numpy as np
import OpenEXR

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENES = "caustic_lens,torus_glass_cube,cornell_diffuse,motion,mesh,sds_point,closed_room"
DIRECT = "class:^LDD?E$"
FIGURES = ["mean", "trimmed", "median", "LD(D)E mean", "LD(D)E median"]


def user_seconds(command):
    """Runs a command; user time of it alone."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    message = process.stderr.read().decode()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: {message}")
    return usage.ru_utime


def luminances(path):
    """Y of the image and of its direct light."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        return [channels[name].pixels.astype(float) for name in ("Y", "class0.Y")]


def scene_file(scene):
    """A scene of scenes/bench, or else of scenes."""
    bench = ROOT / "scenes" / "bench" / f"{scene}.toml"
    return bench if bench.exists() else ROOT / "scenes" / f"{scene}.toml"


class Variant:
    def __init__(self, name, program, options):
        self.name, self.program, self.options = name, program, options


def render(variant, scene, mode, spp, seed, args, crop=None):
    name = "-".join(str(v) for v in (scene, mode, spp, args.rows, variant.name, seed))
    out = args.work / f"{name}.exr"
    note = args.work / f"{name}.seconds"
    if not note.exists() or crop:
        width, height = args.size[scene]
        command = [variant.program, "render", scene_file(scene), "-o", out, "--seed", str(seed)]
        command += ["--spp", str(spp), "--threads", "1", "-q", "--filter", "box", "--regularize", mode, "--no-preview"]
        command += ["--set", f"sensor.0.resolution=[{width}, {height}]", "--aov", DIRECT] + variant.options
        if crop:
            return user_seconds(command + ["--crop", crop, "--integrator", "path"])
        note.write_text(str(user_seconds(command)))
    return luminances(out), float(note.read_text())


def instructions(variant, scene, mode, args):
    """Those of a sample."""
    counts, (width, height) = [], args.size[scene]
    for spp in (64, 80):
        command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", variant.program, "render", scene_file(scene)]
        command += ["-o", args.work / "counted.exr", "--spp", str(spp), "--threads", "1", "-q", "--filter", "box", "--no-preview"]
        command += ["--regularize", mode, "--set", f"sensor.0.resolution=[{width}, {height}]"] + variant.options
        message = subprocess.run(command, capture_output=True, text=True, check=True).stderr
        counts.append(int(message.split("Collected :")[1].split()[0]))
    return (counts[1] - counts[0]) / (16 * width * height)


def size_of(scene, rows):
    text = scene_file(scene).read_text()
    line = next(line for line in text.splitlines() if line.startswith("resolution"))
    width, height = json.loads(line.split("=")[1].split("#")[0])
    return round(width * rows / height), rows


def figures(images, reference, direct_reference, seconds):
    out = []
    for layer, expected in ((0, reference), (1, direct_reference)):
        values = np.array([image[layer] for image in images])
        variance = values.var(axis=0, ddof=1) / (expected**2 + 0.01 * np.mean(expected) ** 2)
        sorted_ = np.sort(variance.ravel())
        kept = sorted_[: len(sorted_) - max(1, len(sorted_) // 1000)]
        every = [variance.mean(), kept.mean(), np.median(variance)]
        out += every if layer == 0 else [every[0], every[2]]
    return [value * seconds for value in out], seconds


def root_error(images, reference):
    """Root of the mean relative square error of each image, without its worst thousandth of the pixels too."""
    out = []
    for image in images:
        square = np.sort(((image - reference) ** 2 / (reference**2 + 0.01 * np.mean(reference) ** 2)).ravel())
        out.append([np.sqrt(square.mean()), np.sqrt(square[: len(square) - max(1, len(square) // 1000)].mean())])
    return np.array(out)


def ratio_with_interval(ours, theirs, generator):
    """Ratio of two root mean errors, with the 95 % interval of a bootstrap over seeds."""
    def mean(values):
        return np.sqrt((values**2).mean())
    draws = [mean(generator.choice(ours, len(ours))) / mean(generator.choice(theirs, len(theirs))) for _ in range(4000)]
    return [mean(ours) / mean(theirs), *np.quantile(draws, [0.025, 0.975])]


def equal_times(args):
    """Errors of `bdpt` over those of `path` after the same CPU seconds, seed by seed.

    The reference is the mean of long renders by `bdpt` with other seeds, so it has the light that `path` does not find; the passes of a
    time follow from what 64 and 192 of them take, so that pilots count once.
    """
    programs = [Variant("this", args.program, []), Variant("path", args.program, ["--integrator", "path"])]
    generator = np.random.default_rng(1)
    print(f"{'scene':26}{'s':>4}{'passes bdpt':>13}{'path':>8}{'s bdpt':>8}{'path':>7}   error bdpt / path (95 %), without .1 % of the pixels (95 %)")
    found = []
    for scene in args.scenes.split(","):
        loading = min(render(programs[0], scene, "off", 1, 0, args, "0,0,1,1") for _ in range(2))
        long = [render(programs[0], scene, "auto", args.reference_spp, seed, args)[0][0] for seed in range(101, 101 + args.references)]
        reference = np.mean(long, axis=0)
        taken = [[min(render(v, scene, "auto", spp, seed, args)[1] for seed in (201, 202)) - loading for spp in (64, 192)]
                 for v in programs]
        rates = [max(long - short, 0.01) / 128 for short, long in taken]
        starts = [max(short - 64 * rate, 0) for (short, _), rate in zip(taken, rates)]
        for seconds in map(float, args.seconds.split(",")):
            errors, spp, times = [], [], []
            for variant, rate, start in zip(programs, rates, starts):
                passes = max(1, round((seconds - start) / rate))
                runs = [render(variant, scene, "auto", passes, seed, args) for seed in range(1, args.seeds + 1)]
                errors.append(root_error([images[0] for images, _ in runs], reference))
                times.append(np.median([s - loading for _, s in runs]))
                spp.append(passes)
            ratios = [ratio_with_interval(errors[0][:, i], errors[1][:, i], generator) for i in (0, 1)]
            found.append(dict(scene=scene, seconds=seconds, passes=spp, times=times, ratios=ratios))
            print(f"{scene:26}{seconds:4g}{spp[0]:13}{spp[1]:8}{times[0]:8.2f}{times[1]:7.2f}   "
                  + "   ".join("{:.3f} ({:.3f} to {:.3f})".format(*r) for r in ratios), flush=True)
    return found


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", default=ROOT / "target" / "release" / "abbe")
    parser.add_argument("--base")
    parser.add_argument("--base-options", default="", help="options of the base")
    parser.add_argument("--scenes", default=SCENES)
    parser.add_argument("--spp", default="16,64")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--modes", default="off,auto")
    parser.add_argument("--rows", type=int, default=150)
    parser.add_argument("--variant", action="append", default=[], help="NAME=OPTIONS or NAME@PROGRAM=OPTIONS")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "target" / "variance" / "images")
    parser.add_argument("--json", type=pathlib.Path)
    parser.add_argument("--seconds", help="CPU seconds after which errors of bdpt and path are compared")
    parser.add_argument("--reference-spp", type=int, default=512)
    parser.add_argument("--instructions", action="store_true", help="count them in place of CPU seconds")
    parser.add_argument("--references", type=int, default=4, help="seeds of the reference")
    args = parser.parse_args()
    args.work.mkdir(parents=True, exist_ok=True)
    balance = "" if args.base else "--heuristic balance"
    base = Variant("base", args.base or args.program, (args.base_options or balance).split())
    variants = [base, Variant("path", args.program, ["--integrator", "path"]), Variant("this", args.program, [])]
    for text in args.variant:
        name, options = text.split("=", 1)
        name, _, program = name.partition("@")
        variants.append(Variant(name, program or args.program, options.split()))
    args.size = {scene: size_of(scene, args.rows) for scene in args.scenes.split(",")}
    if args.seconds:
        found = equal_times(args)
        if args.json:
            args.json.write_text(json.dumps(found, indent=1))
        return
    found = []
    print(f"{'scene':26}{'mode':6}{'spp':>4} {'variant':9}{'CPU s':>7}  " + "".join(f"{'/base ' + f:>20}" for f in FIGURES)
          + "".join(f"{'/path ' + f:>20}" for f in FIGURES))
    for scene in args.scenes.split(","):
        loading = min(render(variants[2], scene, "off", 1, 0, args, "0,0,1,1") for _ in range(2))
        for mode in args.modes.split(","):
            counted = {v.name: instructions(v, scene, mode, args) for v in variants if args.instructions}
            for spp in map(int, args.spp.split(",")):
                results = {v.name: ([], []) for v in variants}
                for seed in range(1, args.seeds + 1):
                    for variant in variants:
                        images, seconds = render(variant, scene, mode, spp, seed, args)
                        results[variant.name][0].append(images)
                        results[variant.name][1].append(seconds - loading)
                whole = [images for v in variants if v.name not in ("base", "path") for images in results[v.name][0]]
                references = [np.mean([images[layer] for images in whole], axis=0) for layer in (0, 1)]
                # ten billion instructions are about a second
                pixels = args.size[scene][0] * args.size[scene][1]
                costs = {name: counted[name] * spp * pixels * 1e-10 if counted else min(times) for name, (_, times) in results.items()}
                rows = {name: figures(images, *references, costs[name]) for name, (images, _) in results.items()}
                for name, (values, seconds) in rows.items():
                    ratios = [[v / o if o else float("nan") for v, o in zip(values, rows[other][0])] for other in ("base", "path")]
                    found.append(dict(scene=scene, mode=mode, spp=spp, variant=name, seconds=seconds, values=values, ratios=ratios))
                    print(f"{scene:26}{mode:6}{spp:4} {name:9}{seconds:7.2f}  "
                          + "".join(f"{r:20.3f}" for r in ratios[0] + ratios[1]), flush=True)
    if args.json:
        args.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
