"""Jobs on Dask: the chunks of a job as tasks of a cluster.

    python -m abbe.dask JOB [--scheduler tcp://HOST:PORT | --workers N] [-o IMAGE]

Each task is ``abbe job run JOB --chunks I..I+1`` on a worker that sees the folder. What is done is what the folder holds, never
what Dask says: tasks may be lost, repeated, or end on a worker that nobody hears any more, and the scheduler may go and come
back; the driver then hands out what is missing. Nothing is counted twice, since a chunk that is rendered twice is the same file.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import re
import subprocess
import sys
import time
from concurrent.futures import CancelledError
from typing import Any

# of a package of its own, which types are checked without
import dask  # type: ignore[import-not-found, import-untyped, unused-ignore]
from distributed import Client, LocalCluster, wait  # type: ignore[import-not-found, import-untyped, unused-ignore]

PART = re.compile(r"(\d{8,})-(\d{8,})\.part")
#: Seconds between two looks at the folder, and until a scheduler that is gone is tried again.
LOOK, RETRY = 0.5, 2.0
#: Tasks in flight for each thread of the cluster.
AHEAD = 2


class Over(Exception):
    """The job ends before its last chunk: the target error is reached."""


def done(job: pathlib.Path) -> set[int]:
    """Chunks of which the folder holds a part."""
    names = (PART.fullmatch(p.name) for p in (job / "parts").iterdir())
    return {chunk for name in names if name for chunk in range(int(name[1]), int(name[2]))}


def chunk_count(job: pathlib.Path) -> int:
    """Number of chunks of a job."""
    manifest = json.loads((job / "job.json").read_text())
    passes, chunk = int(manifest["passes"]), int(manifest["chunk"])
    return -(-passes // chunk)


def render(abbe: str, job: str, chunk: int, threads: int) -> int:
    """Task: renders a chunk, unless it is done. The exit code."""
    command = [abbe, "job", "run", job, "--chunks", f"{chunk}..{chunk + 1}", "--threads", str(threads), "-q"]
    finished = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    if finished.returncode != 0:
        raise subprocess.CalledProcessError(finished.returncode, command, finished.stdout, finished.stderr)
    return finished.returncode


def missing(job: pathlib.Path, count: int, most: int, skip: set[int]) -> list[int]:
    """The first chunks that are neither done nor among those to skip."""
    there = done(job)
    found: list[int] = []
    for chunk in range(count):
        if len(found) == most:
            break
        if chunk not in there and chunk not in skip:
            found.append(chunk)
    return found


def drive(client: Client, job: pathlib.Path, abbe: str, threads: int, retries: int) -> None:
    """Hands out chunks until the folder holds all of them.

    :raises Over: where a task ended well and its chunk is not there.
    """
    count = chunk_count(job)
    flying: dict[int, Any] = {}
    while len(done(job)) < count:
        slots = max(1, sum(w["nthreads"] for w in client.scheduler_info(n_workers=-1)["workers"].values()))
        for chunk in missing(job, count, AHEAD * slots - len(flying), set(flying)):
            # a task of its own each time: the folder knows whether there is anything to do
            flying[chunk] = client.submit(render, abbe, str(job), chunk, threads, retries=retries, pure=False, key=f"chunk-{chunk}-{time.time_ns()}")
        if flying:
            try:
                wait(list(flying.values()), timeout=LOOK, return_when="FIRST_COMPLETED")
            except TimeoutError:
                pass
        there = done(job)
        for chunk, future in list(flying.items()):
            if chunk in there:
                # whether or not anybody still works on it
                future.release()
            elif future.status == "finished":
                raise Over
            elif future.status == "error":
                future.result()
            elif future.status in ("cancelled", "lost"):
                # a scheduler that was restarted knows nothing of it
                raise ConnectionError("the scheduler has forgotten its tasks")
            else:
                continue
            del flying[chunk]


def connect(options: argparse.Namespace) -> Client:
    """A client of the scheduler that was named, or of a cluster on this machine."""
    if options.scheduler:
        return Client(options.scheduler, timeout=10)
    cluster = LocalCluster(n_workers=options.workers, threads_per_worker=1, dashboard_address=options.dashboard)
    if options.most:
        cluster.adapt(minimum=options.workers, maximum=options.most)
    return Client(cluster)


def main(arguments: list[str] | None = None) -> int:
    """Runs the driver and returns its exit code."""
    parser = argparse.ArgumentParser(prog="python -m abbe.dask", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("job", type=pathlib.Path, help="the job, at the same path on all workers")
    parser.add_argument("--scheduler", help="address of the scheduler; a cluster on this machine otherwise")
    parser.add_argument("--workers", type=int, default=2, help="processes of a cluster on this machine")
    parser.add_argument("--most", type=int, help="lets it grow up to so many")
    parser.add_argument("--dashboard", default=None, help="address of its dashboard, such as :8787")
    parser.add_argument("--threads", type=int, default=1, help="threads of a chunk")
    parser.add_argument("--retries", type=int, default=10, help="how often a chunk that fails is tried again")
    parser.add_argument("--silence", default="60s", help="a Dask worker that is silent for so long is given up")
    parser.add_argument("--abbe", default="abbe", help="the program")
    parser.add_argument("-o", "--output", type=pathlib.Path, help="the image to write when all is done")
    options = parser.parse_args(arguments)
    job = options.job.resolve()
    dask.config.set({"distributed.scheduler.worker-ttl": options.silence, "distributed.scheduler.allowed-failures": 100})
    while True:
        try:
            with connect(options) as client:
                drive(client, job, options.abbe, options.threads, options.retries)
                break
        except Over:
            break
        except subprocess.CalledProcessError as error:
            print(error.stderr.strip() or f"error: {error}", file=sys.stderr)
            return 1
        # a client whose scheduler is gone fails in many ways
        except (Exception, CancelledError) as error:
            if not options.scheduler:
                raise
            print(f"warning: the scheduler does not answer ({error}); tried again", file=sys.stderr)
            time.sleep(RETRY)
    if options.output:
        return subprocess.run([options.abbe, "job", "collect", str(job), "-o", str(options.output)], check=False).returncode
    return 0


if __name__ == "__main__":
    sys.exit(main())
