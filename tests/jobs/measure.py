#!/usr/bin/env python3
"""Figures of `docs/many-machines.md`: merging many parts, what claims and parts cost, and two workers against one.

    python3 tests/jobs/measure.py ABBE [--only merge,overhead,scaling] [--rounds 5]

Times are of this machine, and of whoever else uses it: two workers and one alternate, and processor time is told beside the
time on the wall.
"""

import argparse
import json
import pathlib
import re
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "faults"))
from jobs import SCENE  # noqa: E402


def measured(*command):
    """Output, seconds, processor seconds and peak memory in MB of a command."""
    code = (
        "import resource, subprocess, sys, time, json\n"
        "began = time.monotonic()\n"
        "done = subprocess.run(sys.argv[1:], capture_output=True, text=True)\n"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(json.dumps([done.returncode, done.stdout, done.stderr, time.monotonic() - began, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024]))"
    )
    text = subprocess.run([sys.executable, "-c", code, *map(str, command)], capture_output=True, text=True, check=True).stdout
    returncode, out, err, wall, cpu, memory = json.loads(text)
    assert returncode == 0, f"{command}: {err}"
    return out, wall, cpu, memory


def scene(folder, width, height, spp):
    text = SCENE.replace("[96, 72]", f"[{width}, {height}]").replace("spp = 600", f"spp = {spp}")
    path = folder / f"{width}.toml"
    path.write_text(text)
    return path


def merge(abbe, folder, count, width, height):
    job = folder / f"merge{width}"
    # nothing is removed before it is a day old
    measured(abbe, "job", "new", scene(folder, width, height, count), "-o", job, "--chunk", "1", "--lease", "24h")
    measured(abbe, "job", "run", job, "-q")
    singles = [p for p in (job / "parts").glob("*.part") if int(p.name[9:17]) - int(p.name[:8]) == 1]
    assert len(singles) == count, len(singles)
    disk = sum(p.stat().st_size for p in singles)
    whole = folder / f"{width}.whole"
    _, wall, cpu, memory = measured(abbe, "merge", *sorted(singles), "-o", folder / f"{width}.exr", "--part", whole)
    plain = whole.stat().st_size
    print(
        f"merge of {count} parts of {width} x {height}: {wall:.2f} s, {count / wall:.0f} parts/s, {count * plain / wall / 1e6:.0f} MB/s of sums, "
        f"{cpu:.2f} s of a processor, {memory:.0f} MB of memory; {disk / count / 1e3:.1f} kB a part on disk, {disk / count / plain:.2f} of {plain / 1e3:.1f} kB"
    )
    for part in (job / "parts").glob("*.part"):
        if part not in singles:
            part.unlink()
    image = folder / f"{width}.collected.exr"
    _, wall, cpu, memory = measured(abbe, "job", "collect", job, "-o", image)
    print(f"collect of the same: {wall:.2f} s, {cpu:.2f} s of a processor, {memory:.0f} MB of memory")
    assert image.read_bytes() == (folder / f"{width}.exr").read_bytes()
    shutil.rmtree(job)


def overhead(abbe, folder, rounds):
    for chunk in ["1", "10", "100"]:
        shares = []
        for i in range(rounds):
            job = folder / f"overhead{chunk}-{i}"
            measured(abbe, "job", "new", scene(folder, 96, 72, 400), "-o", job, "--chunk", chunk)
            out, wall, _, _ = measured(abbe, "job", "run", job, "--threads", "1")
            shares.append(float(re.search(r"([\d.]+) % for claims", out)[1]))
            seconds = wall / (400 / int(chunk))
        print(f"chunks of {chunk} passes ({seconds:.2f} s): {statistics.median(shares):.2f} % for claims, parts and merging (median of {rounds})")


def scaling(abbe, folder, rounds):
    path = scene(folder, 96, 72, 120)

    def work(name, workers):
        job = folder / name
        measured(abbe, "job", "new", path, "-o", job, "--chunk", "10")
        before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
        processes = [subprocess.Popen([abbe, "job", "run", job, "--threads", "1", "-q", "--no-wait"]) for _ in range(workers)]
        assert all(p.wait() == 0 for p in processes)
        wall, after = time.monotonic() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
        shutil.rmtree(job)
        return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    pairs = []
    for i in range(rounds):
        pairs.append((work(f"one{i}", 1), work(f"two{i}", 2)))
        print(f"one, two: {pairs[-1]}", flush=True)
    walls = [one[0] / two[0] for one, two in pairs]
    processors = [one[1] / two[1] for one, two in pairs]
    print(f"two workers of one thread against one, {rounds} pairs: {statistics.median(walls):.2f} times as fast ({min(walls):.2f} to {max(walls):.2f}); "
          f"processor time of one over that of two {statistics.median(processors):.3f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("abbe")
    parser.add_argument("--only", default="merge,overhead,scaling")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    abbe, only = str(pathlib.Path(options.abbe).resolve()), options.only.split(",")
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        if "merge" in only:
            merge(abbe, folder, 1000, 64, 40)
            merge(abbe, folder, 100, 640, 400)
        if "overhead" in only:
            overhead(abbe, folder, options.rounds)
        if "scaling" in only:
            scaling(abbe, folder, options.rounds)


if __name__ == "__main__":
    main()
