"""Reads the test files of other programs and compares texels and triangles with what those programs see.

    cargo build --release --example corpus
    python3 tests/corpus/run.py target/release/examples/corpus FOLDER [--list]

FOLDER takes the packages. Fetched by name: Debian source packages (libpng1.6 has PngSuite, openexr, libjpeg-turbo, pillow,
assimp, tinygltf and tinyobjloader their test files) and crates (obj-rs, easy-gltf, ply-rs). Needs apt-get with Debian's
keyring, cargo, and the Python packages numpy, Pillow (libpng, libjpeg-turbo) and OpenEXR. The crates of jpeg-decoder and
zune leave their test images out of their packages, and OpenEXR's folder Damaged is in a repository of its own: their kinds
are made here instead (`made`): JPEG of all samplings, sizes and scans, and every file of the corpora cut and flipped.

Prints a row per kind of file: right, refused, vague, wrong, panic. Fails where wrong or panic is not 0. `wrong`: other
texels (more than 2/255, in OpenEXR 1 %) or another number of triangles than the reference, or damage that passed for an image
where the reference reports it. `vague`: refused without a cause.
"""

import collections
import io
import os
import pathlib
import random
import re
import subprocess
import sys
import tarfile
import warnings

import numpy as np
from PIL import Image

warnings.filterwarnings("ignore")
Image.MAX_IMAGE_PIXELS = None

DEBIAN = ["libpng1.6", "openexr", "libjpeg-turbo", "pillow", "assimp", "tinygltf", "tinyobjloader"]
CRATES = ["obj-rs@=0.7.4", "easy-gltf@=1.1.5", "ply-rs@=0.1.3"]
KINDS = {
    ".png": "png", ".jpg": "jpeg", ".jpeg": "jpeg", ".exr": "exr", ".hdr": "hdr",
    ".obj": "obj", ".ply": "ply", ".gltf": "gltf", ".glb": "gltf",
}
KEYRING = "/usr/share/keyrings/debian-archive-keyring.gpg"


def fetch_debian(folder):
    apt = folder / "apt"
    for part in ["lists/partial", "cache/archives/partial"]:
        (apt / part).mkdir(parents=True, exist_ok=True)
    (apt / "sources.list").write_text(f"deb-src [signed-by={KEYRING}] http://deb.debian.org/debian bookworm main\n")
    (apt / "apt.conf").write_text(
        f'Dir::Etc::sourcelist "{apt}/sources.list";\nDir::Etc::sourceparts "/nonexistent";\n'
        f'Dir::State::lists "{apt}/lists";\nDir::Cache "{apt}/cache";\n'
    )
    environment = {**os.environ, "APT_CONFIG": str(apt / "apt.conf")}
    subprocess.check_call(["apt-get", "update", "-q"], env=environment, stdout=subprocess.DEVNULL)
    for package in DEBIAN:
        place = folder / package
        if place.exists():
            continue
        work = folder / "work" / package
        work.mkdir(parents=True, exist_ok=True)
        command = ["apt-get", "source", "-q", "--download-only", package]
        subprocess.check_call(command, cwd=work, env=environment, stdout=subprocess.DEVNULL)
        for archive in work.glob("*.orig.tar.*"):
            if archive.suffix != ".asc":
                with tarfile.open(archive) as tar:
                    tar.extractall(place, filter="data")


def fetch_crates(folder):
    place = folder / "crates"
    if place.exists():
        return
    project = folder / "work" / "fetch"
    subprocess.check_call(["cargo", "init", "-q", "--name", "fetch", project])
    for crate in CRATES:
        subprocess.check_call(["cargo", "add", "-q", "--no-default-features", crate], cwd=project)
    subprocess.check_call(["cargo", "vendor", "-q", place], cwd=project, stdout=subprocess.DEVNULL)


def make(folder, files):
    """JPEG of many kinds by Pillow, and damaged copies of small files."""
    place = folder / "made"
    if not place.exists():
        place.mkdir()
        rng = np.random.default_rng(1)
        sizes = [(1, 1), (2, 1), (1, 2), (3, 3), (5, 7), (8, 8), (9, 9), (15, 16), (17, 17), (33, 31), (100, 75),
                 (1, 40), (40, 1), (2, 40), (40, 2), (3, 50), (50, 3)]
        for w, h in sizes:
            y, x = np.mgrid[0:h, 0:w]
            base = np.stack([128 + 100 * np.sin(x / 5 + y / 9), 128 + 100 * np.cos(x / 7), 255 * (x + y) / (w + h)], -1)
            image = Image.fromarray(np.clip(base + rng.normal(0, 8, base.shape), 0, 255).astype(np.uint8))
            for progressive in (False, True):
                for sampling in (0, 1, 2):
                    for restart in (0, 2):
                        name = f"rgb_{w}x{h}_{sampling}_{progressive}_{restart}.jpg"
                        image.save(place / name, quality=85, subsampling=sampling, progressive=progressive,
                                   restart_marker_blocks=restart)
                for mode in ("L", "CMYK"):
                    image.convert(mode).save(place / f"{mode}_{w}x{h}_{progressive}.jpg", progressive=progressive)
        random.seed(2)
        small = [f for f in files if f.stat().st_size < 60_000]
        for i, path in enumerate(random.sample(small, min(300, len(small)))):
            data = bytearray(path.read_bytes())
            if i % 2:
                data = data[: random.randrange(len(data) // 2, len(data))] if len(data) > 2 else data
            else:
                for _ in range(3):
                    data[random.randrange(len(data))] ^= 1 << random.randrange(8)
            (place / f"damaged_{i}{path.suffix.lower()}").write_bytes(data)
    return sorted(p for p in place.iterdir())


def encoded(linear):
    linear = np.clip(linear, 0, 1)
    return 255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.power(linear, 1 / 2.4) - 0.055)


def says_something_of_colors(image):
    """Pillow ignores what abbe follows: profiles and gamma."""
    info = image.info
    return "icc_profile" in info or info.get("gamma") not in (None, 0.45455) or "chromaticity" in info


def reference(path, kind):
    """Red, green, blue, coverage as 0..255 (None: not comparable), or the reason why the reference refuses."""
    data = path.read_bytes()
    if kind in ("png", "jpeg"):
        with Image.open(io.BytesIO(data)) as image:
            image.load()
            if says_something_of_colors(image):
                return None
            if kind == "png" and data[25] == 0 and isinstance(image.info.get("transparency"), int):
                # Pillow compares the transparent gray with samples that it has scaled to 8 bits, or not at all
                most = 2 ** data[24] - 1
                gray = np.asarray(image).astype(float) * {"1": 255, "L": 1}.get(image.mode, 255 / 65535)
                clear = image.info["transparency"]
                # of one bit it may be in bytes
                clear = clear if clear <= most else 1
                opaque = np.where(np.round(gray * most / 255) == clear, 0.0, 255.0)
                return np.dstack([gray, gray, gray, opaque])
            if image.mode.startswith("I"):
                gray = np.asarray(image).astype(float)[..., None] / 257
                return np.dstack([gray, gray, gray, np.full(gray.shape[:2], 255.0)])
            return np.asarray(image.convert("RGBA")).astype(float)
    if kind == "exr":
        import OpenEXR

        with OpenEXR.File(str(path), separate_channels=True) as file:
            part = file.parts[0]
            header, channels = part.header, part.channels
            windows = [header["displayWindow"], header["dataWindow"]]
            same = all((a == b).all() for a, b in zip(*windows))
            if not same or "chromaticities" in header or not {"R", "G", "B"} <= set(channels):
                return None
            return np.dstack([np.asarray(channels[c].pixels).astype(float) for c in "RGB"])
    return None


def statements(text):
    """The faces of an OBJ text, in triangles."""
    joined = text.replace("\\\r\n", " ").replace("\\\n", " ")
    faces = (line.split("#")[0].split() for line in joined.splitlines())
    return sum(max(0, len(words) - 3) for words in faces if words and words[0] in ("f", "fo"))


def outcome(program, path, kind, work):
    """One of right, refused, vague, wrong, panic, and the message."""
    command = [program, work, path]
    try:
        run = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=120)
    except subprocess.TimeoutExpired:
        return "panic", "more than 120 s"
    if run.returncode != 0 or not run.stdout:
        return "panic", run.stderr[-200:]
    _, result, known, message = (run.stdout.rstrip("\n").split("\t") + ["", "", ""])[:4]
    if result == "panic":
        return "panic", run.stderr[-200:]
    if result == "refused":
        vague = not any(c in message for c in "(:\"") or len(message) < 10
        return ("vague" if vague else "refused"), message
    try:
        expected = reference(path, kind)
    except Exception as error:  # whatever the reference says
        # not every program knows every kind: only damage counts
        damage = any(w in str(error).lower() for w in ("truncat", "broken", "corrupt", "crc"))
        # a chunk that begins with a small letter may be passed over (PNG, 5.4), as libpng does
        damage = damage and not re.search(r"Truncated [a-z]\w{3} chunk", str(error))
        return ("wrong" if damage else "right"), f"the reference: {error}"
    if kind == "obj":
        there = statements(path.read_text(errors="replace"))
        return ("right" if int(known) == there else "wrong"), f"{known} of {there} triangles"
    if expected is None:
        return "right", message
    width, height = map(int, known.split())
    texels = np.fromfile(work / "0.f32", np.float32).reshape(height, width, 4).astype(float)
    if kind == "exr":
        found = texels[..., :3]
        expected = np.maximum(expected, 0)
        if found.shape != expected.shape:
            return "wrong", f"{found.shape} for {expected.shape}"
        worst = np.abs(found - expected).max()
        return ("right" if worst <= 0.01 * max(1.0, expected.max()) else "wrong"), f"differs by {worst:.3g}"
    found = np.dstack([encoded(texels[..., :3]), 255 * texels[..., 3]])
    if found.shape != expected.shape:
        return "wrong", f"{found.shape} for {expected.shape}"
    worst = np.abs(found - expected).max()
    return ("right" if worst <= 2.02 else "wrong"), f"differs by {worst:.2f} of 255"


def main():
    program, folder = sys.argv[1], pathlib.Path(sys.argv[2]).resolve()
    listed = "--list" in sys.argv
    folder.mkdir(parents=True, exist_ok=True)
    fetch_debian(folder)
    fetch_crates(folder)
    skip = ("work", "apt", "made")
    places = [p for p in sorted(folder.iterdir()) if p.is_dir() and p.name not in skip]
    files = [f for p in places for f in sorted(p.rglob("*")) if f.is_file() and f.suffix.lower() in KINDS]
    files += make(folder, files)
    totals = collections.defaultdict(collections.Counter)
    for path in files:
        kind = KINDS[path.suffix.lower()]
        result, message = outcome(program, path, kind, folder / "work")
        totals[kind][result] += 1
        if listed or result in ("wrong", "panic", "vague"):
            print(f"{result}: {path.relative_to(folder)}: {message}")
    columns = ["right", "refused", "vague", "wrong", "panic"]
    print("| kind | " + " | ".join(columns) + " |\n|---|" + "---:|" * len(columns))
    for kind in sorted(totals):
        print(f"| {kind} | " + " | ".join(str(totals[kind][c]) for c in columns) + " |")
    sys.exit(any(totals[kind][c] for kind in totals for c in ("wrong", "panic")))


if __name__ == "__main__":
    main()
