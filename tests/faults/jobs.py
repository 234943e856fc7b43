#!/usr/bin/env python3
"""A job whose workers are killed, stopped and fed damaged parts comes to the bytes of one render.

    python3 tests/faults/jobs.py ABBE [--kills 50] [--workers 2,8] [--seed 1]

For each number of workers: so many processes work on one folder, each with one thread; one after another is ended by SIGKILL
at random moments and another one started in its place, until as many kills have been made; one is stopped (SIGSTOP) for longer
than a lease and goes on. Between kills a part is damaged now and then. Then the rest is rendered undisturbed, and image and
part are compared byte for byte with those of `abbe render`. Before that, what must be refused: another version, another scene,
links, copies that are not what they were; and a job on a small disk (tmpfs, where it can be mounted) that is full for a
while. Run by hand; the clock decides nothing but how far the workers come.
"""

import argparse
import contextlib
import json
import os
import pathlib
import random
import shutil
import signal
import subprocess
import tempfile
import time

SCENE = """
[render]
spp = 600
regularize = "off"
max_depth = 12
[[sensor]]
resolution = [96, 72]
perspective = { eye = [0, 0, 4], target = [0, 0, 0], fov_deg = 40 }
[medium.crown]
glass = "N-BK7"
[material.white]
diffuse = { reflectance = 0.7 }
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


def run(*command, **options):
    return subprocess.run([str(c) for c in command], capture_output=True, text=True, **options)


def worker(abbe, job):
    command = [abbe, "job", "run", job, "--threads", "1", "-q"]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def damage(job, rng):
    """Turns a byte of a part, as a bad disk does."""
    parts = sorted((job / "parts").glob("*.part"))
    if not parts:
        return None
    part = rng.choice(parts)
    try:
        with open(part, "r+b") as file:
            file.seek(rng.randrange(part.stat().st_size))
            byte = file.read(1)
            file.seek(-1, os.SEEK_CUR)
            file.write(bytes([byte[0] ^ 1]))
    except OSError:
        return None
    return part.name


def killed(abbe, folder, count, workers, rng):
    job = folder / f"job{workers}"
    run(abbe, "job", "new", folder / "scene.toml", "-o", job, "--chunk", "4", "--lease", "2s", check=True)
    alive = [worker(abbe, job) for _ in range(workers)]
    kills, stopped, damaged, done_early = 0, 0, 0, 0
    while kills < count:
        time.sleep(rng.uniform(0.02, 0.5))
        i = rng.randrange(workers)
        if alive[i].poll() is not None:
            assert alive[i].returncode == 0, alive[i].stderr.read()
            done_early += 1
            # all is done: damage, so that there is work for the next
            if damage(job, rng):
                damaged += 1
            alive[i] = worker(abbe, job)
            continue
        if kills % 25 == 12:
            alive[i].send_signal(signal.SIGSTOP)
            time.sleep(3)
            alive[i].send_signal(signal.SIGCONT)
            stopped += 1
        alive[i].kill()
        alive[i].wait()
        kills += 1
        if kills % 10 == 5 and damage(job, rng):
            damaged += 1
        alive[i] = worker(abbe, job)
    hung = alive[0]
    hung.send_signal(signal.SIGSTOP)
    for process in alive[1:]:
        process.wait()
    run(abbe, "job", "run", job, "--threads", "2", "-q", check=True)
    hung.send_signal(signal.SIGCONT)
    hung.wait()
    collected = folder / f"c{workers}.exr"
    # what was damaged last shows now, and is rendered again
    for _ in range(5):
        seen = run(abbe, "job", "collect", job, "-o", collected, "--part", folder / f"c{workers}.part", check=True)
        if "600 passes\n" in seen.stdout:
            break
        run(abbe, "job", "run", job, "-q", check=True)
    status = json.loads(run(abbe, "job", "status", job, "--json", check=True).stdout)
    assert status["done"] == status["chunks"] and status["running"] == 0, status
    for name in ["exr", "part"]:
        same = (folder / f"c{workers}.{name}").read_bytes() == (folder / f"r.{name}").read_bytes()
        print(f"{workers} workers, {kills} kills, {stopped + 1} stops, {damaged} bytes turned, {status['damaged']} parts set aside: "
              f"the {name} is {'the same' if same else 'ANOTHER'}", flush=True)
        assert same
    secrets = [str(folder), os.environ.get("USER", "no user"), os.uname().nodename]
    for path in [job / "job.json", *(job / "claims").iterdir(), *(job / "workers").iterdir(), *(job / "parts").glob("*.part")]:
        data = path.read_bytes()
        # of a part its header: sums may spell anything
        text = data[16 : 16 + int.from_bytes(data[12:16], "little")] if path.suffix == ".part" else data
        assert not any(secret.encode() in text for secret in secrets), path


def refused(abbe, folder):
    def job(change):
        place = folder / "bad"
        shutil.rmtree(place, ignore_errors=True)
        run(abbe, "job", "new", folder / "scene.toml", "-o", place, "--chunk", "200", check=True)
        change(place)
        seen = run(abbe, "job", "run", place)
        assert seen.returncode in (1, 2), seen
        return seen.stderr

    def manifest(place, edit):
        path = place / "job.json"
        data = json.loads(path.read_text())
        edit(data)
        path.write_text(json.dumps(data))

    def link(place):
        copy = next(p for p in (place / "files").iterdir())
        shutil.move(copy, folder / "elsewhere")
        copy.symlink_to(folder / "elsewhere")

    def other_bytes(place):
        for copy in (place / "files").iterdir():
            data = bytearray(copy.read_bytes())
            data[len(data) // 2] ^= 1
            copy.write_bytes(data)

    def linked_folder(place):
        shutil.move(place / "parts", folder / "parts-elsewhere")
        (place / "parts").symlink_to(folder / "parts-elsewhere")

    cases = {
        "another version": (lambda p: manifest(p, lambda m: m.update(version="0.0.9")), ["0.0.9", "this is abbe"]),
        "another scene": (lambda p: manifest(p, lambda m: m["header"].update(scene_hash=7)), ["scene (hash)", f"{7:016x}"]),
        "other settings": (lambda p: manifest(p, lambda m: m["overrides"].append(["render.max_depth", "3"])), ["hash"]),
        "a path out": (lambda p: manifest(p, lambda m: m["files"][0].update(name="../../x")), ["leads out of the job"]),
        "a link": (link, ["links are not followed"]),
        "a linked folder": (linked_folder, ["is no folder"]),
        "other bytes": (other_bytes, ["is damaged"]),
    }
    for what, (change, expected) in cases.items():
        text = job(change)
        assert all(e in text for e in expected), f"{what}: {text}"
        print(f"{what} is refused: {text.strip()}")


def full_disk(abbe, folder):
    """A job on a disk that is full goes on when there is room again."""
    small = folder / "small"
    small.mkdir()
    if run("mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", small).returncode != 0:
        print("a full disk: not tried (tmpfs cannot be mounted here)")
        return
    try:
        job = small / "job"
        run(abbe, "job", "new", folder / "scene.toml", "-o", job, "--chunk", "20", check=True)
        at_work = worker(abbe, job)
        while not any((job / "parts").glob("*.part")):
            time.sleep(0.02)
        with contextlib.suppress(OSError), open(small / "ballast", "wb") as ballast:
            while True:
                ballast.write(bytes(4096))
                ballast.flush()
        said = at_work.stderr.readline()
        assert "paused until it works again" in said, said
        time.sleep(3)
        assert at_work.poll() is None, "the worker has given up"
        (small / "ballast").unlink()
        said = at_work.stderr.readline()
        assert "it works again" in said, said
        assert at_work.wait() == 0
        run(abbe, "job", "collect", job, "-o", folder / "f.exr", "--part", folder / "f.part", check=True)
        for name in ["exr", "part"]:
            assert (folder / f"f.{name}").read_bytes() == (folder / f"r.{name}").read_bytes(), name
        print("a full disk: the worker paused and went on; image and part are the same")
    finally:
        run("umount", small)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("abbe")
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--workers", default="2,8")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    abbe, rng = str(pathlib.Path(options.abbe).resolve()), random.Random(options.seed)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "scene.toml").write_text(SCENE)
        refused(abbe, folder)
        run(abbe, "render", folder / "scene.toml", "-o", folder / "r.exr", "--part", folder / "r.part", "-q", check=True)
        full_disk(abbe, folder)
        for workers in map(int, options.workers.split(",")):
            killed(abbe, folder, options.kills, workers, rng)


if __name__ == "__main__":
    main()
