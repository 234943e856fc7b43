#!/usr/bin/env python3
"""The recipes of `docs/recipes` render a job to the bytes of one `abbe render`.

    PYTHON tests/jobs/recipes.py ABBE [--only openjd,slurm,parallel]

PYTHON is that of an environment with the package `openjd-cli`, whose checker and local runner take the template. The array of
Slurm is run by a stand-in for `sbatch` that starts the tasks of an array at once, kills one of them, and keeps dependencies;
GNU parallel by a stand-in for `ssh` that runs the command here. A recipe whose program is not there is an error.
"""

import argparse
import os
import pathlib
import stat
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
RECIPES = ROOT / "docs" / "recipes"
sys.path.insert(0, str(ROOT / "tests" / "faults"))
from jobs import SCENE  # noqa: E402

# `sbatch [--parsable] [--array=A-B] [--dependency=...] (--wrap=COMMAND | SCRIPT ARGUMENTS)`: runs it to the end
SBATCH = '''#!%s
import os, re, subprocess, sys, time
options = [a for a in sys.argv[1:] if a.startswith("--")]
rest = [a for a in sys.argv[1:] if not a.startswith("--")]
values = dict(o[2:].split("=", 1) for o in options if "=" in o)
if "wrap" in values:
    sys.exit(subprocess.call(values["wrap"], shell=True))
said = dict(re.findall(r"^#SBATCH --([a-z-]+)=(\\S+)$", open(rest[0]).read(), re.M)) | values
first, last = map(int, said["array"].split("-"))
def task(i):
    named = {"SLURM_ARRAY_JOB_ID": "7", "SLURM_ARRAY_TASK_ID": str(i), "SLURM_CPUS_PER_TASK": said["cpus-per-task"]}
    return subprocess.Popen(rest, env=os.environ | named, stdout=subprocess.DEVNULL)
tasks = [task(i) for i in range(first, last + 1)]
time.sleep(0.3)
tasks[0].kill()
for t in tasks:
    t.wait()
print(7)
'''
SSH = '''#!/bin/sh
# the last argument is the command
for last; do :; done
exec sh -c "$last"
'''


def program(path, text):
    path.write_text(text)
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("abbe")
    parser.add_argument("--only", default="openjd,slurm,parallel")
    options = parser.parse_args()
    abbe = pathlib.Path(options.abbe).resolve()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        programs = folder / "programs"
        programs.mkdir()
        (programs / "abbe").symlink_to(abbe)
        program(programs / "sbatch", SBATCH % sys.executable)
        program(programs / "ssh", SSH)
        path = f"{programs}:{pathlib.Path(sys.executable).parent}:{os.environ['PATH']}"
        environment = os.environ | {"PATH": path, "PARALLEL_SSH": str(programs / "ssh"), "HOME": str(folder)}

        def run(*command):
            done = subprocess.run([str(c) for c in command], cwd=folder, env=environment, capture_output=True, text=True)
            assert done.returncode == 0, f"{command}: {done.stdout}\n{done.stderr}"
            return done.stdout

        scene = SCENE.replace("spp = 600", "spp = 80").replace("[96, 72]", "[48, 36]")
        (folder / "scene.toml").write_text(scene)
        run("abbe", "render", "scene.toml", "-o", "r.exr", "-q")

        def openjd():
            run("openjd", "check", RECIPES / "openjd.yaml")
            job, image = folder / "openjd", folder / "openjd.exr"
            run("openjd", "run", RECIPES / "openjd.yaml", "-p", f"Job={job}", "-p", f"Image={image}", "-p", "Workers=3")

        def slurm():
            run("sbatch", "--parsable", "--array=1-3", RECIPES / "slurm.sh", "slurm")
            run("sbatch", "--dependency=afterany:7", "--wrap=abbe job run slurm && abbe job collect slurm -o slurm.exr")

        def parallel():
            (folder / "hosts").write_text("one\ntwo\n:\n")
            run(RECIPES / "parallel.sh", folder / "parallel", folder / "hosts", "parallel.exr")

        for recipe in [openjd, slurm, parallel]:
            name = recipe.__name__
            if name in options.only.split(","):
                run("abbe", "job", "new", "scene.toml", "-o", name, "--chunk", "4", "--lease", "1s")
                recipe()
                same = (folder / f"{name}.exr").read_bytes() == (folder / "r.exr").read_bytes()
                print(f"{name}: the image is {'the same' if same else 'ANOTHER'}", flush=True)
                assert same


if __name__ == "__main__":
    main()
