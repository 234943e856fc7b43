#!/usr/bin/env python3
"""Measures how good the closing line of `abbe render` is: the time that half the error would take, against the time then needed.

Every scene is rendered with each seed for a few passes, then again until `--target-error` stops it at what the first run forecast.
Passes tell how good the forecast is on a machine that others use, too; times are CPU seconds, of which the forecast ones are the
passes forecast at the pace of the first run. A run that says "unsteady" makes no forecast and is counted.

    cargo build --release && tests/benches/forecast.py
"""
import argparse
import json
import pathlib
import statistics
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENES = "bench/caustic_lens,bench/cornell_diffuse,dispersive_lens,glass_ball,moving_lens,torus_in_glass_cube"


def render(options, scene, seed, *arguments):
    with tempfile.TemporaryDirectory() as folder:
        stats = pathlib.Path(folder) / "stats.json"
        command = [options.abbe, "render", ROOT / "scenes" / f"{scene}.toml", "--seed", seed, "--threads", options.threads, "-q",
                   "--no-preview", "-o", pathlib.Path(folder) / "image.exr", "--stats", stats, *arguments,
                   "--set", f"sensor.0.resolution=[{options.size}]"]
        subprocess.run(list(map(str, command)), check=True)
        return json.loads(stats.read_text())["sensors"][0]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--abbe", type=pathlib.Path, default=ROOT / "target/release/abbe")
    parser.add_argument("--scenes", default=SCENES)
    parser.add_argument("--passes", type=int, default=16, help="of the run that makes the forecast")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--size", default="160,120", help="columns,rows")
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    print("| scene | error after the first run | passes forecast / needed: median (least to most) | CPU time, likewise | unsteady |")
    print("|---|---|---|---|---|")
    for scene in options.scenes.split(","):
        errors, passes, seconds, unsteady = [], [], [], 0
        for seed in range(1, options.seeds + 1):
            first = render(options, scene, seed, "--spp", options.passes)
            forecast = first["forecast"]
            errors.append(first["relative_error"])
            if forecast["passes"] is None:
                unsteady += 1
                continue
            # far more than forecast: whatever it needs
            limit = round(16 * forecast["passes"])
            then = render(options, scene, seed, "--spp", limit, "--target-error", forecast["relative_error"])
            passes.append(forecast["passes"] / then["passes"])
            pace = first["cpu_seconds"] / first["passes"]
            seconds.append(forecast["passes"] * pace / then["cpu_seconds"])
        ratio = lambda r: f"{statistics.median(r):.2f} ({min(r):.2f} to {max(r):.2f})" if r else "-"
        error = 100 * statistics.median(errors)
        print(f"| `{scene}` | {error:.1f} % | {ratio(passes)} | {ratio(seconds)} | {unsteady} of {options.seeds} |", flush=True)


if __name__ == "__main__":
    main()
