#!/usr/bin/env python3
"""Measures what each effect costs a scene that does not use it: the program of now against that of the commit before the effect.

Both programs are built from git (worktrees under target/effects, one after the other), then render the same scene in turn, each with
one thread. Printed are the median of the ratios of user CPU seconds, neighbor by neighbor, with its 95 % bootstrap interval.

    tests/benches/effects.py                          # the commits of EFFECTS, 61 pairs
    tests/benches/effects.py --effects motion --pairs 11
    tests/benches/effects.py --effects motion --program target/release/abbe      # what has come since, too
"""
import argparse
import os
import pathlib
import random
import statistics
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
BENCH = ROOT / "scenes" / "bench"
WORK = ROOT / "target" / "effects"
# the commit before, the commit with all of it, and options of the program with it that keep it unused
EFFECTS = {
    "regularization": ("d0b98ce^2", "e9adc59", ["--regularize", "off"]),
    "motion": ("d82bac0^1", "d82bac0", []),
    "merging": ("280c345^1", "280c345", []),
    "models and textures": ("48fbac8^1", "48fbac8", []),
}


def build(commit):
    """The program of a commit."""
    full = subprocess.run(["git", "rev-parse", "--short=12", f"{commit}^{{commit}}"], cwd=ROOT, check=True, capture_output=True, text=True)
    name = full.stdout.strip()
    program = WORK / f"abbe-{name}"
    if not program.exists():
        tree = WORK / "tree"
        if tree.exists():
            subprocess.run(["git", "worktree", "remove", "--force", tree], cwd=ROOT, check=True)
        print(f"building {name}", file=sys.stderr)
        subprocess.run(["git", "worktree", "add", "--quiet", "--detach", tree, name], cwd=ROOT, check=True)
        environment = dict(os.environ, CARGO_TARGET_DIR=str(WORK / "target"))
        subprocess.run(["cargo", "build", "--release", "--quiet", "--locked"], cwd=tree, check=True, env=environment)
        (WORK / "target/release/abbe").rename(program)
        subprocess.run(["git", "worktree", "remove", "--force", tree], cwd=ROOT, check=True)
    return program


def user_seconds(program, scene, arguments):
    image = WORK / "image.exr"
    command = [program, "render", scene, "--threads", "1", "-q", "--no-preview", "-o", image, *arguments]
    child = subprocess.Popen(list(map(str, command)), stderr=subprocess.PIPE)
    message = child.stderr.read().decode()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        sys.exit(f"{program.name}: {message}")
    return usage.ru_utime


def interval(values, share=0.95, draws=10_000):
    """Bootstrap interval of the median."""
    source = random.Random(1)
    medians = sorted(statistics.median(source.choices(values, k=len(values))) for _ in range(draws))
    cut = round((1 - share) / 2 * draws)
    return medians[cut], medians[-cut - 1]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--effects", default=",".join(EFFECTS), help="some of " + ", ".join(EFFECTS))
    parser.add_argument("--pairs", type=int, default=61)
    parser.add_argument("--spp", type=int, default=4)
    parser.add_argument("--pixels", type=int, default=150, help="of a side of the image: short runs in turn meet the same machine")
    parser.add_argument("--after", help="a commit instead of the one with the effect, such as HEAD")
    parser.add_argument("--scene", default="cornell_diffuse,caustic_lens", help="of scenes/bench")
    parser.add_argument("--program", type=pathlib.Path, help="a program instead of a commit to compare with those before")
    options = parser.parse_args()
    size = f"sensor.0.resolution=[{options.pixels},{options.pixels}]"
    WORK.mkdir(parents=True, exist_ok=True)
    print("| effect, not used | scene | pairs | CPU time with / before: median | 95 % interval |")
    print("|---|---|---|---|---|")
    for effect in options.effects.split(","):
        before, after, arguments = EFFECTS[effect]
        programs = build(before), options.program or build(options.after or after)
        for name in options.scene.split(","):
            scene = BENCH / f"{name}.toml"
            ratios = []
            for turn in range(options.pairs + 1):
                # in turns, so that neither always comes first
                order = (0, 1) if turn % 2 else (1, 0)
                own = ([], arguments)
                seconds = {i: user_seconds(programs[i], scene, ["--spp", options.spp, "--set", size, *own[i]]) for i in order}
                # the first pair warms up
                if turn:
                    ratios.append(seconds[1] / seconds[0])
            low, high = interval(ratios)
            print(f"| {effect} | `{name}` | {len(ratios)} | {statistics.median(ratios):.3f} | {low:.3f} to {high:.3f} |", flush=True)


if __name__ == "__main__":
    main()
