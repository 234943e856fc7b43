#!/usr/bin/env python3
"""A render that is killed again and again comes to the bytes of one that is not.

    python3 tests/faults/kill.py ABBE [--kills 50] [--seed 1]

A render with passes that last longer than the interval of its saves is ended by SIGKILL at random moments, also within passes and saves, and
resumed each time; then it is left alone. Its part and its image are compared byte for byte with those of one run. Said are
also the passes and pixels that the kills have cost. Then renders with passes of minutes are interrupted once (SIGINT) at
random moments, from the start of the process on, and the time until they have ended is said, saving included. Run by hand.
"""

import argparse
import json
import pathlib
import random
import signal
import struct
import subprocess
import tempfile
import time

SCENE = """
[render]
spp = SPP
weights = "balance"
regularize = "off"
max_depth = 40
[[sensor]]
resolution = [WIDTH, HEIGHT]
perspective = { eye = [0, 0, 4], target = [0, 0, 0], fov_deg = 40 }
[medium.crown]
glass = "N-BK7"
[material.white]
diffuse = { reflectance = 0.9 }
[material.clear]
dielectric = {}
[[object]]
sphere = { radius = 6 }
material = "white"
[[object]]
sphere = { radius = 0.6 }
material = "clear"
interior = "crown"
[[object]]
quad = { center = [0, 2.5, 0], u = [0, 0, 0.5], v = [0.5, 0, 0] }
emission = 5.0
two_sided = true
"""


def scene(folder, spp, width, height):
    text = SCENE.replace("SPP", str(spp)).replace("WIDTH", str(width)).replace("HEIGHT", str(height))
    (folder / "scene.toml").write_text(text)


def held(path):
    """Passes and pixels of a pass in flight that a part holds."""
    if not path.exists():
        return 0, 0
    data = path.read_bytes()
    (length,) = struct.unpack("<I", data[12:16])
    header = json.loads(data[16 : 16 + length])
    passes = sum(p["end"] - p["start"] for p in header["passes"])
    if header["unfinished"] is None:
        return passes, 0
    x0, y0, x1, y1 = header["crop"]
    sums = (x1 - x0) * (y1 - y0) * header["channels"] * 3 * 16
    tiles = -(-(x1 - x0) // 16) * -(-(y1 - y0) // 16)
    done = struct.unpack(f"<{tiles}H", data[16 + length + sums :][: 2 * tiles])
    return passes, sum(done)


def kills(abbe, folder, count, rng):
    # without long pilots; passes are longer than the interval of saves
    scene(folder, 14, 480, 360)
    command = [abbe, "render", "scene.toml", "--part", "a.part", "-o", "a.exr", "--resume", "-q"]
    killed = 0
    while killed < count:
        process = subprocess.Popen(command, cwd=folder)
        moment = rng.uniform(0.0, 14.0)
        try:
            process.wait(moment)
            break
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            killed += 1
            print(f"kill {killed} after {moment:.1f} s: the part holds {held(folder / 'a.part')}", flush=True)
    subprocess.run(command, cwd=folder, check=True)
    subprocess.run([abbe, "render", "scene.toml", "--part", "b.part", "-o", "b.exr", "-q"], cwd=folder, check=True)
    for name in ["part", "exr"]:
        same = (folder / f"a.{name}").read_bytes() == (folder / f"b.{name}").read_bytes()
        print(f"after {killed} kills the {name} is {'the same' if same else 'ANOTHER'}")
        assert same
    left = sorted(p.name for p in folder.iterdir() if p.name.startswith(".abbe-"))
    print(f"{len(left)} temporary files are left for the next run")


def interrupts(abbe, folder, count, rng):
    scene(folder, 20, 2000, 1500)
    worst = 0.0
    for i in range(count):
        for old in folder.glob("c.*"):
            old.unlink()
        command = [abbe, "render", "scene.toml", "--part", "c.part", "-o", "c.exr", "-q"]
        process = subprocess.Popen(command, cwd=folder, stderr=subprocess.DEVNULL)
        moment = rng.uniform(0.0, 12.0)
        time.sleep(moment)
        began = time.monotonic()
        process.send_signal(signal.SIGINT)
        code = process.wait()
        took = time.monotonic() - began
        worst = max(worst, took)
        print(f"interrupt {i + 1} after {moment:.1f} s: code {code}, ended {took:.2f} s later, holds {held(folder / 'c.part')}", flush=True)
    print(f"the slowest of {count} interrupts took {worst:.2f} s, saving included")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("abbe")
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--interrupts", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    abbe, rng = str(pathlib.Path(options.abbe).resolve()), random.Random(options.seed)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        interrupts(abbe, folder, options.interrupts, rng)
        kills(abbe, folder, options.kills, rng)


if __name__ == "__main__":
    main()
