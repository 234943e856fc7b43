#!/usr/bin/env python3
"""1,000 to 100,000 workers on one folder, simulated: where the disk, the claims or the merging becomes the limit.

    python3 tests/jobs/simulate.py [--svg docs/many-machines.svg]

Events are those of `abbe job run`: a worker reads the scene, claims a chunk, renders it, writes its part, merges the blocks that
it completes, and claims the next one; it shows that it lives four times a lease. The folder is a server that carries out so many
operations and moves so many bytes a second, one request after another. Machines differ in speed (log-normal, 20 %), 1 % of them are
four times slower, each dies once a day and is replaced after five minutes, its chunk is free after a lease. The size of
a part (8 MB, of 640 x 400 pixels, 6.1 MB where `tests/jobs/measure.py` measures one of a single pass) and half a second for a merge
are assumed, as is the server, a plain NFS server. The same numbers come out each time.

The efficiency is the rate of chunks, while 30 to 70 % of them are done, over that of workers who never wait or die. The end is the time
from the last claim to the last merge, in chunks.
"""

import argparse
import heapq
import math
import random

OPERATIONS = 10_000.0  # of the server, a second
BYTES = 1.0e9  # a second
PART = 8.0e6  # a packed part of 640 x 400 pixels, 24.6 MB of sums, of many passes
SCENE = 20.0e6  # read by each worker when it starts
BEGIN = 40  # operations to do so
MERGE = 0.5  # seconds of a processor to merge four parts
LEASE, SIGNS = 60.0, 4
CLAIM = 14  # operations: two tries, and whether one of up to ten blocks exists already
PUT = 6  # create, write, lock, sync, permissions, rename
RAMP = 600.0  # workers start within this time
DAY, REPLACED = 86_400.0, 300.0
RADIX = 4
SPREAD, STRAGGLERS, SLOW = 0.2, 0.01, 4.0
# seconds of a chunk, lease, folders: chunks a worker, most workers
CASES = {
    "chunks of 1 min": (60.0, LEASE, 1, 20, 30_000),
    "chunks of 10 min": (600.0, LEASE, 1, 6, 100_000),
    "chunks of 10 min, lease of 10 min": (600.0, 600.0, 1, 6, 100_000),
    "chunks of 1 h, lease of 10 min": (3600.0, 600.0, 1, 4, 100_000),
    "chunks of 10 min, ten folders": (600.0, LEASE, 10, 6, 100_000),
}
WORKERS = [1000, 3000, 10_000, 30_000, 60_000, 100_000]


class Server:
    """A server with two queues. What all workers show of themselves takes its share of the operations."""

    def __init__(self, signs):
        self.operations, self.bytes = max(OPERATIONS - signs, OPERATIONS / 100), BYTES
        self.busy = [0.0, 0.0]

    def request(self, now, operations, size=0.0):
        self.busy[0] = max(self.busy[0], now) + operations / self.operations
        self.busy[1] = max(self.busy[1], now) + size / self.bytes if size else self.busy[1]
        return max(self.busy[0], self.busy[1] if size else 0.0)


class Tree:
    """Blocks of chunks: how many of the four below each are complete."""

    def __init__(self, count):
        self.width, self.complete = [count], {}
        while self.width[-1] > 1:
            self.width.append(math.ceil(self.width[-1] / RADIX))

    def merges(self, chunk):
        """Number of parts of each merge that a chunk completes."""
        for level in range(1, len(self.width)):
            place = chunk // RADIX**level
            key = (level, place)
            self.complete[key] = self.complete.get(key, 0) + 1
            children = min(RADIX, self.width[level - 1] - place * RADIX)
            if self.complete[key] < children:
                return
            if children > 1:
                yield children


def simulate(workers, seconds, lease, per_worker):
    """Efficiency and end."""
    rng = random.Random(7)
    count = per_worker * workers
    slow = [rng.lognormvariate(0, SPREAD) * (SLOW if rng.random() < STRAGGLERS else 1) for _ in range(workers)]
    ideal = sum(1 / (seconds * s) for s in slow)
    server, tree = Server(workers * SIGNS / lease), Tree(count)
    events = [(rng.uniform(0, RAMP), worker, "begin", worker, None) for worker in range(workers)]
    heapq.heapify(events)
    order, fresh, back, done, times, waiting, last_claim, end = workers, 0, [], 0, [], [], 0.0, 0.0

    def later(time, what, worker, chunk=None):
        nonlocal order
        order += 1
        heapq.heappush(events, (time, order, what, worker, chunk))

    while events:
        now, _, what, worker, chunk = heapq.heappop(events)
        if what == "free":
            back.append(chunk)
            if waiting:
                later(now + lease / SIGNS, "claim", waiting.pop())
            continue
        if what == "begin":
            later(server.request(now, BEGIN, SCENE), "claim", worker)
            continue
        if what == "done":
            later(server.request(now, PUT, PART), "put", worker, tree.merges(chunk))
            done += 1
            times.append(now)
            continue
        if what == "put":
            # one merge after the other, each when the one before is there
            children, end = next(chunk, None), max(end, now)
            if children is None:
                later(now, "claim", worker)
            else:
                later(server.request(now, 20, (children + 1) * PART) + MERGE, "put", worker, chunk)
            continue
        # a claim
        if back:
            chunk = back.pop()
        elif fresh < count:
            chunk, fresh = fresh, fresh + 1
        else:
            # others work on the last chunks: one of them may die
            waiting.append(worker)
            continue
        now = server.request(now, CLAIM)
        if fresh < count or not last_claim:
            last_claim = now
        time = seconds * slow[worker] * rng.lognormvariate(0, 0.05)
        dies = rng.expovariate(1 / DAY)
        if dies < time:
            later(now + dies + lease, "free", worker, chunk)
            later(now + dies + REPLACED, "begin", worker)
        else:
            later(now + time, "done", worker, chunk)
    a, b = times[int(0.3 * count)], times[int(0.7 * count)]
    return 0.4 * count / (b - a) / ideal, (end - last_claim) / seconds


def plot(path, found):
    """The efficiencies as an SVG."""
    width, height, left, top, bottom = 720, 380, 56, 16, 44
    colors = ["#c0392b", "#2471a3", "#148f77", "#7d3c98", "#b9770e"]

    def x(workers):
        return left + (width - left - 20) * math.log10(workers / 1000) / 2

    def y(efficiency):
        return top + (height - top - bottom) * (1 - efficiency)

    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12">',
        f'<rect width="{width}" height="{height}" fill="white"/>',
    ]
    for i in range(6):
        out.append(f'<path d="M{left} {y(i / 5):.1f}H{width - 20}" stroke="#ddd"/><text x="{left - 8}" y="{y(i / 5) + 4:.1f}" text-anchor="end">{20 * i} %</text>')
    for workers in [1000, 3000, 10_000, 30_000, 100_000]:
        out.append(f'<path d="M{x(workers):.1f} {top}V{height - bottom}" stroke="#eee"/><text x="{x(workers):.1f}" y="{height - bottom + 18}" text-anchor="middle">{workers:,}</text>')
    out.append(f'<text x="{(left + width) / 2}" y="{height - 8}" text-anchor="middle">workers</text>')
    for i, (name, points) in enumerate(found.items()):
        line = " ".join(f"{x(w):.1f},{y(min(1, e)):.1f}" for w, e, _ in points)
        out.append(f'<polyline points="{line}" fill="none" stroke="{colors[i]}" stroke-width="2"/>')
        out.append(f'<text x="{left + 12}" y="{height - bottom - 14 - 17 * (len(found) - 1 - i)}" fill="{colors[i]}">{name}</text>')
    out.append("</svg>\n")
    with open(path, "w") as file:
        file.write("\n".join(out))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--svg")
    options = parser.parse_args()
    found = {}
    for name, (seconds, lease, folders, per_worker, most) in CASES.items():
        for workers in (w for w in WORKERS if w <= most):
            # folders do not know each other; a server each
            efficiency, end = simulate(workers // folders, seconds, lease, per_worker)
            found.setdefault(name, []).append((workers, efficiency, end))
            print(f"{name}: {workers:,} workers: efficiency {100 * efficiency:.1f} %, end {end:.2f} chunks", flush=True)
    if options.svg:
        plot(options.svg, found)


if __name__ == "__main__":
    main()
