#!/usr/bin/env python3
"""Renders the bench scenes with abbe, Mitsuba 3, pbrt-r4 and LuxCore in turn; prints samples per core-second and error at equal CPU time.

    cargo build --release && cargo run --release --example bench_meshes
    cargo install pbrt-r4 --version 4.5.2 --no-default-features --root target/pbrt --config 'profile.release.package.pbrt-r4.opt-level=3'
    python3 tests/peers/compare.py [--scenes A,B,C,E] [--seconds 8,30] [--rounds 3] [--scale 0.5] [--reference SECONDS]
        [--renderers NAME,NAME] [--abbe PROGRAM] [--pbrt PROGRAM] [--work FOLDER]

Makes a Python environment in FOLDER (target/peers) and installs mitsuba and pyluxcore from PyPI into it, once. Run by hand on a
machine that is otherwise quiet; it is no part of the test suite. A peer that does not install or run is named and left out.

`mitsuba` is its `scalar_spectral` with independent samples, `mitsuba-llvm` its `llvm_ad_spectral` with the sampler `multijitter`, of
square numbers of samples. The latter loads LLVM at run time; DRJIT_LIBLLVM_PATH names the library where there are several (with
Mitsuba 3.9.1, LLVM 14 and 15 end in "cannot select fminimum", 19 works). `pbrt-path` and `pbrt-bdpt` have pbrt's default sampler and
powers of two. Each run has one thread. CPU time is that of rendering, without reading the scene and building its hierarchy, with
abbe's pilots and Mitsuba's compiling; of abbe and pbrt-r4 that of the program without that of one sample of 4 x 3 pixels.

Each renderer is measured against a long render of its own (of --reference CPU seconds, by default 16 times the longest run; another
seed), because the peers differ in what they compute: Mitsuba has neither dispersion nor bidirectional paths and is given the index of
the glass at the d line, LuxCore computes in RGB with light levels of its own and a sphere of triangles. So the columns say how fast
each converges to its own image; the mean of the image is printed beside, where it should agree but for LuxCore. Errors are of
luminance after scaling the reference to mean 1: relMSE = mean (I - R)^2 / (R^2 + 0.01), also without the worst 0.1 % of the pixels, and
that in exactly the CPU time asked for, without the share of the reference, squared errors falling as one over the number of samples.
The last columns are the latter over that of each of abbe's methods: above 1 abbe's error is smaller. Single runs are told on stderr.
"""
import argparse
import functools
import itertools
import json
import math
import os
import pathlib
import subprocess
import sys
import time
import venv

ROOT = pathlib.Path(__file__).resolve().parents[2]
BENCH = ROOT / "scenes" / "bench"
FLOOR = dict(quad=((0, 0, 0), (0, 0, 5), (5, 0, 0)), diffuse=0.6)
# the same scenes as scenes/bench/*.toml: lights are quads (center, half edges u and v, radiance) that shine towards u x v
SCENES = {
    "A": dict(
        file="caustic_lens.toml", size=(400, 300), camera=((0, 4, 8), (0, 0.5, 0), 40),
        light=((-3, 6, 0), (0, 0, 0.1), (-0.084799915, -0.052999947, 0), 6600),
        objects=[FLOOR, dict(sphere=((0, 1.2, 0), 1), glass=1.78472, cauchy_b=0.016)],
    ),
    "B": dict(
        file="torus_glass_cube.toml", size=(400, 300), camera=((0, 2.6, 6.5), (0, 0.9, 0), 35),
        light=((0.8, 4.5, 0.6), (0.075, 0, 0), (0, 0, 0.075), 5000),
        objects=[FLOOR, dict(box=((-1, 0.05, -1), (1, 2.05, 1)), glass=1.5),
                 dict(obj="generated/torus.obj", tilt=50, move=(0, 1.05, 0), metal=(0.2, 3.9, 0.05))],
    ),
    "C": dict(
        file="cornell_diffuse.toml", size=(300, 300), camera=((2.75, 2.75, -8), (2.75, 2.75, 0), 39),
        light=((2.75, 5.49, 2.75), (0.65, 0, 0), (0, 0, 0.55), 17),
        objects=[dict(quad=((2.75, 0, 2.75), (0, 0, 2.75), (2.75, 0, 0)), diffuse=0.73),
                 dict(quad=((2.75, 5.5, 2.75), (2.75, 0, 0), (0, 0, 2.75)), diffuse=0.73),
                 dict(quad=((2.75, 2.75, 5.5), (0, 2.75, 0), (2.75, 0, 0)), diffuse=0.73),
                 dict(quad=((5.5, 2.75, 2.75), (0, 0, 2.75), (0, 2.75, 0)), diffuse=(0.57, 0.05, 0.05)),
                 dict(quad=((0, 2.75, 2.75), (0, 2.75, 0), (0, 0, 2.75)), diffuse=(0.07, 0.43, 0.07)),
                 dict(obj="cornell_blocks.obj", diffuse=0.73)],
    ),
    "E": dict(
        file="mesh.toml", size=(400, 300), camera=((0, 1.9, 4.5), (0, 1.1, 0), 38),
        light=((2, 5, 3), (0.5, 0, 0), (0, 0, 0.5), 200),
        objects=[FLOOR, dict(obj="generated/bumpy_sphere.obj", move=(0, 1.15, 0), diffuse=0.7)],
    ),
}
DEPTH = 8
# variant and sampler
MITSUBA = {"mitsuba": ("scalar_spectral", "independent"), "mitsuba-llvm": ("llvm_ad_spectral", "multijitter")}


def mesh_of(thing):
    """Vertices and triangles of anything but a sphere in its own place."""
    import numpy as np

    if "quad" in thing:
        c, u, v = (np.array(x, float) for x in thing["quad"])
        return np.array([c - u - v, c + u - v, c + u + v, c - u + v]), np.array([[0, 1, 2], [0, 2, 3]])
    if "box" in thing:
        low, high = (np.array(x, float) for x in thing["box"])
        points = np.array([[(low, high)[i >> a & 1][a] for a in range(3)] for i in range(8)])
        quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
        return points, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    if "sphere" in thing:
        center, radius = thing["sphere"]
        rows, columns = 256, 512
        theta = np.pi * np.arange(rows + 1) / rows
        phi = 2 * np.pi * np.arange(columns) / columns
        t, p = np.meshgrid(theta, phi, indexing="ij")
        points = np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], -1).reshape(-1, 3)
        triangles = []
        for i in range(rows):
            for j in range(columns):
                a, b = i * columns + j, i * columns + (j + 1) % columns
                c, d = a + columns, b + columns
                triangles += [(a, b, d)] * (i > 0) + [(a, d, c)] * (i < rows - 1)
        return np.array(center) + radius * points, np.array(triangles)
    points, triangles = [], []
    for line in (BENCH / thing["obj"]).open():
        if line.startswith("v "):
            points.append([float(x) for x in line.split()[1:4]])
        elif line.startswith("f "):
            corners = [int(x.split("/")[0]) - 1 for x in line.split()[1:]]
            triangles += [(corners[0], corners[i], corners[i + 1]) for i in range(1, len(corners) - 1)]
    points = np.array(points)
    angle = math.radians(thing.get("tilt", 0))
    turn = np.array([[1, 0, 0], [0, math.cos(angle), -math.sin(angle)], [0, math.sin(angle), math.cos(angle)]])
    return points @ turn.T + np.array(thing.get("move", (0, 0, 0))), np.array(triangles)


def mitsuba_render(scene, size, spp, seed, variant, sampler):
    import drjit
    import mitsuba as mi
    import numpy as np

    mi.set_variant(variant)
    drjit.set_thread_count(1)

    def bsdf(thing):
        if "glass" in thing:
            return dict(type="dielectric", int_ior=thing["glass"], ext_ior=1.0)
        if "metal" in thing:
            eta, k, alpha = thing["metal"]
            flat = lambda v: dict(type="uniform", value=v)
            return dict(type="roughconductor", distribution="ggx", alpha=alpha, eta=flat(eta), k=flat(k))
        value = thing["diffuse"]
        color = dict(type="uniform", value=value) if isinstance(value, float) else dict(type="rgb", value=value)
        return dict(type="twosided", bsdf=dict(type="diffuse", reflectance=color))

    def shape(thing, name):
        if "sphere" in thing:
            return dict(type="sphere", center=thing["sphere"][0], radius=thing["sphere"][1], bsdf=bsdf(thing))
        points, triangles = mesh_of(thing)
        properties = mi.Properties()
        extra = thing.get("emitter")
        properties["bsdf"] = mi.load_dict(bsdf(thing))
        if extra:
            properties["emitter"] = mi.load_dict(extra)
        mesh = mi.Mesh(name, len(points), len(triangles), props=properties)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = np.ravel(points).astype(np.float32)
        parameters["faces"] = np.ravel(triangles).astype(np.uint32)
        parameters.update()
        return mesh

    eye, target, fov = scene["camera"]
    center, u, v, radiance = scene["light"]
    description = dict(
        type="scene",
        integrator=dict(type="path", max_depth=DEPTH + 1, rr_depth=5),
        sensor=dict(
            type="perspective", fov=fov, fov_axis="y",
            to_world=mi.ScalarTransform4f().look_at(origin=eye, target=target, up=(0, 1, 0)),
            film=dict(type="hdrfilm", width=size[0], height=size[1], pixel_format="luminance", rfilter=dict(type="box")),
            sampler=dict(type=sampler, sample_count=spp, seed=seed),
        ),
        light=shape(dict(quad=(center, u, v), diffuse=0.0, emitter=dict(type="area", radiance=dict(type="uniform", value=float(radiance)))), "light"),
    )
    for i, thing in enumerate(scene["objects"]):
        description[f"object{i}"] = shape(thing, f"object{i}")
    loaded = mi.load_dict(description)
    start = time.process_time()
    image = np.array(mi.render(loaded, spp=spp, seed=seed))
    return image.reshape(size[1], size[0]), time.process_time() - start


def luxcore_render(scene, size, spp, seed, engine):
    import numpy as np
    import pyluxcore

    pyluxcore.Init(lambda message: None)
    properties = pyluxcore.Properties()
    built = pyluxcore.Scene()

    def put(key, value):
        properties.Set(pyluxcore.Property(key, value))

    def define(name, thing):
        points, triangles = mesh_of(thing)
        corners = [[tuple(x) for x in array.tolist()] for array in (points, triangles)]
        built.DefineMesh(name, *corners, None, None, None, None)
        put(f"scene.objects.{name}.shape", name)
        put(f"scene.objects.{name}.material", name)

    for i, thing in enumerate(scene["objects"]):
        name = f"object{i}"
        key = f"scene.materials.{name}"
        if "glass" in thing:
            put(f"{key}.type", "glass")
            put(f"{key}.interiorior", thing["glass"])
            put(f"{key}.cauchyb", thing.get("cauchy_b", 0.0))
            put(f"{key}.kr", [1.0] * 3)
            put(f"{key}.kt", [1.0] * 3)
        elif "metal" in thing:
            eta, k, alpha = thing["metal"]
            put("scene.textures.metal.type", "fresnelconst")
            put("scene.textures.metal.n", [eta] * 3)
            put("scene.textures.metal.k", [k] * 3)
            put(f"{key}.type", "metal2")
            put(f"{key}.fresnel", "metal")
            put(f"{key}.uroughness", alpha)
            put(f"{key}.vroughness", alpha)
        else:
            value = thing["diffuse"]
            put(f"{key}.type", "matte")
            put(f"{key}.kd", [value] * 3 if isinstance(value, float) else list(value))
        define(name, thing)
    center, u, v, radiance = scene["light"]
    put("scene.materials.light.type", "matte")
    put("scene.materials.light.kd", [0.0] * 3)
    put("scene.materials.light.emission", [float(radiance)] * 3)
    define("light", dict(quad=(center, u, v)))
    eye, target, fov = scene["camera"]
    put("scene.camera.type", "perspective")
    put("scene.camera.lookat.orig", list(map(float, eye)))
    put("scene.camera.lookat.target", list(map(float, target)))
    put("scene.camera.up", [0.0, 1.0, 0.0])
    # theirs is the angle of the width of wide images
    across = 2 * math.degrees(math.atan(math.tan(math.radians(fov) / 2) * max(1.0, size[0] / size[1])))
    put("scene.camera.fieldofview", across)
    put("scene.camera.autofocus.enable", False)
    built.Parse(properties)
    config = pyluxcore.Properties()
    settings = {
        "renderengine.type": engine, "sampler.type": "SOBOL", "renderengine.seed": seed,
        "film.width": size[0], "film.height": size[1], "film.filter.type": "NONE",
        "path.pathdepth.total": DEPTH + 1, "light.maxdepth": DEPTH, "path.maxdepth": DEPTH,
        "native.threads.count": 1, "batch.haltspp": spp, "film.outputs.0.type": "RGB", "film.outputs.0.filename": "unused.exr",
    }
    for key, value in settings.items():
        config.Set(pyluxcore.Property(key, value))
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(config, built))
    start = time.process_time()
    session.Start()
    while not session.HasDone():
        time.sleep(0.05)
        session.UpdateStats()
    session.Stop()
    seconds = time.process_time() - start
    pixels = np.zeros(size[0] * size[1] * 3, dtype=np.float32)
    session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB, pixels, 0)
    rgb = pixels.reshape(size[1], size[0], 3)[::-1]
    return rgb @ np.array([0.2126, 0.7152, 0.0722]), seconds


def worker(arguments):
    import numpy as np

    renderer, scene, width, height, spp, seed, out = arguments
    size, spp, seed = (int(width), int(height)), int(spp), int(seed)
    if renderer in MITSUBA:
        image, seconds = mitsuba_render(SCENES[scene], size, spp, seed, *MITSUBA[renderer])
    else:
        image, seconds = luxcore_render(SCENES[scene], size, spp, seed, renderer.split("-")[1].upper())
    np.save(out, image)
    print(json.dumps({"cpu_seconds": seconds}), flush=True)
    # LuxCore may crash when it is taken apart
    os._exit(0)


def possible(renderer, spp):
    """The number of samples nearest to `spp` that its sampler knows."""
    if renderer == "mitsuba-llvm":
        return max(1, round(spp**0.5)) ** 2
    if renderer.startswith("pbrt"):
        return 2 ** max(0, round(math.log2(spp)))
    return max(1, round(spp))


@functools.cache
def pbrt_scene(program, scene, size, work):
    import pbrt

    return pbrt.Renderer(program, BENCH / SCENES[scene]["file"], size, work)


def abbe_run(program, work, renderer, scene, size, spp, seed):
    """CPU seconds of a run of abbe, its start included."""
    import pbrt

    image = work / "abbe.exr"
    image.unlink(missing_ok=True)
    command = ["render", BENCH / SCENES[scene]["file"], "--spp", spp, "--seed", seed, "-q", "--threads", 1, "--no-preview", "-o", image,
               "--set", f"sensor.0.resolution=[{size[0]}, {size[1]}]", "--integrator", renderer.split("-")[1]]
    if renderer.endswith("unbiased"):
        command += ["--regularize", "off"]
    return pbrt.run(program, *command)


@functools.cache
def abbe_start(program, work, renderer, scene):
    """CPU seconds of a run of one sample of few pixels: the median of three."""
    return sorted(abbe_run(program, work, renderer, scene, (4, 3), 1, 0) for _ in range(3))[1]


def render(renderer, scene, size, spp, seed, options):
    """One run: the luminance and the CPU seconds of rendering."""
    import numpy as np

    work = options.work
    if renderer.startswith("pbrt"):
        bench, integrator = pbrt_scene(options.pbrt, scene, size, work), renderer.split("-")[1]
        samples = lambda count: f'Sampler "zsobol" "integer pixelsamples" {count}\nIntegrator "{integrator}"'
        _, start = bench.render(samples(1), seed, (4, 3))
        image, seconds = bench.render(samples(spp), seed)
        return image, seconds - start
    if renderer.startswith("abbe"):
        import OpenEXR

        start = abbe_start(options.abbe, work, renderer, scene)
        seconds = abbe_run(options.abbe, work, renderer, scene, size, spp, seed)
        with OpenEXR.File(str(work / "abbe.exr"), separate_channels=True) as file:
            y = file.channels()["Y"].pixels.astype(float)
        return y, seconds - start
    out = work / "peer.npy"
    command = [sys.executable, __file__, "--worker", renderer, scene, *size, spp, seed, out]
    done = subprocess.run(list(map(str, command)), check=True, capture_output=True, text=True)
    return np.load(out).astype(float), json.loads(done.stdout.strip().splitlines()[-1])["cpu_seconds"]


def errors(image, reference):
    import numpy as np

    scale = reference.mean()
    image, reference = image / scale, reference / scale
    terms = np.sort(((image - reference) ** 2 / (reference**2 + 0.01)).ravel())
    return terms.mean(), terms[: len(terms) - int(0.001 * len(terms))].mean()


def compare(options):
    import numpy as np
    import pbrt

    renderers, times = options.renderers.split(","), [float(s) for s in options.seconds.split(",")]
    ours = [r for r in renderers if r.startswith("abbe")]
    names = ["scene", "renderer", "samples per pixel", "CPU s", "million samples per core-second", "mean Y", "relMSE", "trimmed",
             "trimmed in CPU s", *(f"over that of {name}" for name in ours)]
    print(f"| {' | '.join(names)} |\n|{'---|' * len(names)}")
    for scene in options.scenes.split(","):
        size = tuple(max(1, round(options.scale * n)) for n in SCENES[scene]["size"])
        plans, results = {}, {}
        for renderer in renderers:
            try:
                known = [(count, render(renderer, scene, size, count, 7, options)[1]) for count in (4, 16)]
                counts = [possible(renderer, pbrt.near(t, known)) for t in times]
                spp = possible(renderer, pbrt.near(options.reference or 16 * max(times), known))
                plans[renderer] = (counts, spp, render(renderer, scene, size, spp, 1000, options)[0])
            except (subprocess.CalledProcessError, OSError) as error:
                detail = (getattr(error, "stderr", None) or str(error)).strip().splitlines()[-1:]
                print(f"{scene}: {renderer} not run: {' '.join(detail)}", file=sys.stderr)
        for turn, (i, asked) in itertools.product(range(options.rounds), enumerate(times)):
            for renderer, (counts, longest, reference) in plans.items():
                spp = counts[i]
                image, seconds = render(renderer, scene, size, spp, turn, options)
                full, trimmed = errors(image, reference)
                # that at the time asked for, from the one that it took; the reference errs as a run of so many samples
                equal = trimmed * seconds / asked / (1 + spp / longest)
                row = (spp, seconds, image.size * spp / seconds * 1e-6, image.mean(), full, trimmed, equal)
                results.setdefault((asked, renderer), []).append(row)
                print(scene, renderer, *(f"{x:.4g}" for x in row), file=sys.stderr, flush=True)
        medians = {key: np.median(rows, axis=0) for key, rows in results.items()}
        for (asked, renderer), (spp, seconds, rate, mean, full, trimmed, equal) in medians.items():
            ratios = [f"{equal / medians[asked, name][-1]:.2f}" if name in plans else "-" for name in ours]
            cells = [scene, renderer, f"{spp:.0f}", f"{seconds:.1f}", f"{rate:.3f}", f"{mean:.4f}", f"{full:.2e}", f"{trimmed:.2e}"]
            print(f"| {' | '.join([*cells, f'{equal:.2e} in {asked:g}', *ratios])} |", flush=True)


def main():
    if sys.argv[1:2] == ["--worker"]:
        return worker(sys.argv[2:])
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default="A,B,C,E")
    parser.add_argument("--seconds", default="20", help="CPU seconds per run")
    parser.add_argument("--reference", type=float, help="CPU seconds of the run that each is measured against")
    parser.add_argument("--rounds", type=int, default=3, help="runs of each renderer, in turn; medians are printed")
    parser.add_argument("--scale", type=float, default=0.5, help="of the number of columns and rows")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "target" / "peers")
    parser.add_argument("--abbe", type=pathlib.Path, default=ROOT / "target/release/abbe")
    parser.add_argument("--pbrt", type=pathlib.Path, default=ROOT / "target/pbrt/bin/pbrt-r4")
    parser.add_argument("--renderers", default="abbe-path,abbe-bdpt,abbe-bdpt-unbiased,mitsuba,mitsuba-llvm,pbrt-path,pbrt-bdpt,"
                                               "luxcore-pathcpu,luxcore-bidircpu")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    python = options.work / "venv" / "bin" / "python"
    if pathlib.Path(sys.executable) != python and pathlib.Path(sys.prefix) != options.work / "venv":
        if not python.exists():
            venv.create(options.work / "venv", with_pip=True)
        for packages in (["numpy", "openexr"], ["mitsuba"], ["pyluxcore"]):
            done = subprocess.run([python, "-m", "pip", "install", "-q", *packages])
            if done.returncode:
                print(f"{packages[-1]} does not install and is left out", file=sys.stderr)
        return subprocess.run([python, __file__, *sys.argv[1:]]).returncode
    return compare(options)


if __name__ == "__main__":
    sys.exit(main())
