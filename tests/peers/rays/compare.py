#!/usr/bin/env python3
"""Rays per CPU second of abbe and of Embree, the same rays in turn on one thread; prints medians of the ratio.

    apt install libembree-dev                     # Embree 3, and a C++ compiler
    python3 tests/peers/rays/compare.py [--rounds 21] [--only TEXT] [--base PROGRAM] [--streams] [--markdown]

Builds `cargo bench --bench traverse`, has it write its scenes and rays to target/peers/rays, builds `embree.cpp` against the
library of the system and asks both about each set alternately; set for set, the ratio of one round is the CPU time of Embree over
that of abbe (above 1, abbe is faster). Embree runs in robust mode with single rays in f32, as a renderer written for it would;
abbe answers in f64. Rays that leave a face name it in abbe and begin 1e-4 later in Embree, so the numbers of hits differ a little:
both are printed. Where abbe is asked about occlusion in batches (of 8 rays, as a sample may have that joins two sub-paths, or of 32),
Embree is asked about single rays, or with --streams about streams of as many. With --base, an older bench program takes the place of
Embree. Run by hand; it is no part of the test suite.
"""
import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[3]
HERE = pathlib.Path(__file__).resolve().parent
SETS = {
    "million": ["bounces", "chords", "camera", "shadows"],
    "cornell": ["camera", "bounces", "pairs"],
    "instances": ["camera", "chords"],
    "moving": ["chords"],
    "spheres": ["camera", "chords"],
}
# what is asked, and what the peer is asked
QUERIES = {"closest": "closest", "occluded": "occluded", "batched8": "occluded", "batched32": "occluded"}


def bench_program():
    """Builds the bench; its path."""
    command = ["cargo", "bench", "--bench", "traverse", "--no-run", "--message-format", "json"]
    build = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True)
    messages = [json.loads(line) for line in build.stdout.splitlines() if line.startswith("{")]
    found = [m["executable"] for m in messages if m.get("target", {}).get("name") == "traverse" and m.get("executable")]
    return found[-1]


def embree_program(folder):
    """Builds the peer; its path."""
    out = folder / "embree"
    compiler = os.environ.get("CXX", "g++")
    command = [compiler, "-O3", "-march=native", str(HERE / "embree.cpp"), "-o", str(out), "-lembree3"]
    if subprocess.run(command, check=False).returncode != 0:
        sys.exit("embree.cpp does not build: is libembree-dev (Embree 3) there?")
    return out


class Server:
    """A program that answers questions line by line."""

    def __init__(self, *command):
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1)

    def ask(self, scene, rays, query):
        self.process.stdin.write(f"{scene} {rays} {query}\n")
        answer = self.process.stdout.readline().split()
        if len(answer) != 2:
            sys.exit(f"{self.process.args}: no answer")
        return int(answer[0]), float(answer[1])

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=21)
    parser.add_argument("--only", default="")
    parser.add_argument("--base")
    parser.add_argument("--streams", action="store_true")
    parser.add_argument("--markdown", action="store_true")
    args = parser.parse_args()
    folder = ROOT / "target" / "peers" / "rays"
    folder.mkdir(parents=True, exist_ok=True)
    bench = bench_program()
    subprocess.run([bench, "--export", str(folder)], check=True)
    ours = Server(bench, "--serve")
    peer = Server(args.base, "--serve") if args.base else Server(str(embree_program(folder)), str(folder))
    asked = {query: query if args.streams else partner for query, partner in QUERIES.items()}
    head = ["set", "query", "hits", "hits of the peer", "Mrays/s", "of the peer", "ratio", "quartiles"]
    line = "| " + " | ".join(["{}"] * len(head)) + " |" if args.markdown else "{:18} {:9} {:>7} {:>16} {:>8} {:>11} {:>6}  {}"
    print(line.format(*head))
    if args.markdown:
        print("|" + "---|" * len(head))
    for scene, sets in SETS.items():
        for rays in sets:
            if args.only not in f"{scene}/{rays}":
                continue
            # in turn over all queries, so that caches know nothing of the question before
            rounds = {query: [] for query in QUERIES}
            for _ in range(args.rounds + 1):
                for query, times in rounds.items():
                    times.append((ours.ask(scene, rays, query), peer.ask(scene, rays, asked[query])))
            for query, times in rounds.items():
                times = times[1:]
                count = (folder / f"{scene}-{rays}.rays").stat().st_size // 36
                ratios = [theirs[1] / own[1] for own, theirs in times]
                low, median, high = statistics.quantiles(ratios, n=4)
                rate = [count / statistics.median(t[i][1] for t in times) / 1e6 for i in (0, 1)]
                share = [f"{100 * times[0][i][0] / count:.2f} %" for i in (0, 1)]
                print(line.format(f"{scene}/{rays}", query, *share, *(f"{r:.2f}" for r in rate), f"{median:.2f}",
                                  f"{low:.2f} to {high:.2f}"), flush=True)
    ours.close()
    peer.close()


if __name__ == "__main__":
    main()
