#!/usr/bin/env python3
"""A job on Dask whose workers are killed and stopped, and whose scheduler is restarted, comes to the bytes of one render.

    PYTHON tests/jobs/dask_faults.py ABBE [--kills 10] [--seed 1]

PYTHON has the package `distributed`. A scheduler and four worker processes run on this machine; `abbe/dask.py` drives a job on
them while workers are ended by SIGKILL at random moments, one is stopped (SIGSTOP) and stays so, and the scheduler is killed and
started again. Image and part are compared byte for byte with those of `abbe render`.
"""

import argparse
import pathlib
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "faults"))
from jobs import SCENE, run  # noqa: E402

WORKERS = 4


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("abbe")
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    abbe, rng = str(pathlib.Path(options.abbe).resolve()), random.Random(options.seed)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "scene.toml").write_text(SCENE.replace("spp = 600", "spp = 400"))
        run(abbe, "render", folder / "scene.toml", "-o", folder / "r.exr", "--part", folder / "r.part", "-q", check=True)
        run(abbe, "job", "new", folder / "scene.toml", "-o", folder / "job", "--chunk", "8", "--lease", "2s", check=True)
        port, log = free_port(), (folder / "log").open("w")
        address = f"tcp://127.0.0.1:{port}"

        def start(*command, to=log):
            return subprocess.Popen([sys.executable, "-P", *command], stdout=to, stderr=to, cwd=folder)

        def scheduler():
            return start("-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard")

        def worker():
            return start("-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--death-timeout", "60")

        head, workers, hung = scheduler(), [worker() for _ in range(WORKERS)], None
        driver = start(ROOT / "src/python/abbe/dask.py", folder / "job", "--scheduler", address, "--abbe", abbe, "-o", folder / "d.exr", to=(folder / "driver").open("w"))
        kills, restarts, parts = 0, 0, folder / "job/parts"
        while not any(parts.glob("*.part")):
            time.sleep(0.1)
        while kills < options.kills:
            time.sleep(rng.uniform(0.1, 0.6))
            assert driver.poll() is None, f"the driver ended with {driver.returncode} after {kills} kills\n{(folder / 'driver').read_text()[-2000:]}"
            i = rng.randrange(WORKERS)
            if kills == options.kills // 3 and hung is None:
                hung = workers[i]
                hung.send_signal(signal.SIGSTOP)
                workers[i] = worker()
                continue
            workers[i].kill()
            workers[i].wait()
            kills += 1
            workers[i] = worker()
            if kills == options.kills // 2:
                head.kill()
                head.wait()
                time.sleep(1)
                head, restarts = scheduler(), restarts + 1
                workers = [w if w.poll() is None else worker() for w in workers]
        began = time.monotonic()
        while driver.poll() is None:
            workers = [w if w.poll() is None else worker() for w in workers]
            time.sleep(1)
            if time.monotonic() - began > 300:
                print((folder / "driver").read_text()[-4000:])
                raise SystemExit("the driver does not end")
        assert driver.returncode == 0, (folder / "driver").read_text()[-4000:]
        run(abbe, "job", "collect", folder / "job", "-o", folder / "d.exr", "--part", folder / "d.part", check=True)
        for process in [*workers, head, *([hung] if hung else [])]:
            process.kill()
            process.wait()
        for name in ["exr", "part"]:
            same = (folder / f"d.{name}").read_bytes() == (folder / f"r.{name}").read_bytes()
            print(f"{kills} kills, 1 stop, {restarts} restart of the scheduler: the {name} is {'the same' if same else 'ANOTHER'}")
            assert same


if __name__ == "__main__":
    main()
