#!/usr/bin/env python3
"""Renders the bench scenes with abbe, Mitsuba 3 and LuxCore in turn; prints samples per core-second and error at equal CPU time.

    cargo build --release && cargo run --release --example bench_meshes
    python3 tests/peers/compare.py [--scenes A,B,C,E] [--seconds 20] [--rounds 3] [--scale 0.5] [--work FOLDER]

Makes a Python environment in FOLDER (target/peers) and installs mitsuba and pyluxcore from PyPI into it, once. Run by hand on a
machine that is otherwise quiet; it is no part of the test suite. A peer that does not install or run is named and left out.

Each renderer is measured against a long render of its own (16 times the CPU time, another seed), because the peers differ in what
they compute: Mitsuba has neither dispersion nor bidirectional paths and is given the index of the glass at the d line, LuxCore
computes in RGB with light levels of its own and a sphere of triangles. So the columns say how fast each converges to its own
image; the mean of the image is printed beside, where it should agree between abbe and Mitsuba. Errors are of luminance after
scaling the reference to mean 1: relMSE = mean (I - R)^2 / (R^2 + 0.01), also without the worst 0.1 % of the pixels, and that in
exactly the CPU time asked for; the last columns compare each of abbe's methods with the row: below 1 abbe's error is smaller.
"""
import argparse
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


def mitsuba_render(scene, size, spp, seed):
    import mitsuba as mi
    import numpy as np

    mi.set_variant("scalar_spectral")

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
            sampler=dict(type="independent", sample_count=spp, seed=seed),
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
        "batch.haltspp": spp, "film.outputs.0.type": "RGB", "film.outputs.0.filename": "unused.exr",
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
    if renderer == "mitsuba":
        image, seconds = mitsuba_render(SCENES[scene], size, spp, seed)
    else:
        image, seconds = luxcore_render(SCENES[scene], size, spp, seed, renderer.split("-")[1].upper())
    np.save(out, image)
    print(json.dumps({"cpu_seconds": seconds}), flush=True)
    # LuxCore may crash when it is taken apart
    os._exit(0)


def render(renderer, scene, size, spp, seed, work):
    """One run: the luminance and the CPU seconds of rendering."""
    import numpy as np

    if renderer.startswith("abbe"):
        image, stats = work / "abbe.exr", work / "abbe.json"
        command = [ROOT / "target/release/abbe", "render", BENCH / SCENES[scene]["file"], "--spp", spp, "--seed", seed, "-q",
                   "--no-preview", "-o", image, "--stats", stats, "--set", f"sensor.0.resolution=[{size[0]}, {size[1]}]",
                   "--integrator", renderer.split("-")[1]]
        if renderer.endswith("unbiased"):
            command += ["--regularize", "off"]
        subprocess.run(list(map(str, command)), check=True)
        import OpenEXR

        with OpenEXR.File(str(image), separate_channels=True) as file:
            y = file.channels()["Y"].pixels.astype(float)
        return y, json.loads(stats.read_text())["sensors"][0]["cpu_seconds"]
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

    renderers = options.renderers.split(",")
    ours = [r for r in renderers if r.startswith("abbe")]
    names = ["scene", "renderer", "samples per pixel", "CPU s", "million samples per core-second", "mean Y", "relMSE", "trimmed",
             f"trimmed in {options.seconds:g} CPU s", *(f"that of {name} over it" for name in ours)]
    print(f"| {' | '.join(names)} |\n|{'---|' * len(names)}")
    for scene in options.scenes.split(","):
        size = tuple(max(1, round(options.scale * n)) for n in SCENES[scene]["size"])
        plans = {}
        for renderer in renderers:
            try:
                _, seconds = render(renderer, scene, size, 4, 7, options.work)
                spp = max(1, round(4 * options.seconds / max(seconds, 1e-3)))
                reference, _ = render(renderer, scene, size, 16 * spp, 1000, options.work)
                plans[renderer] = (spp, reference, [])
            except (subprocess.CalledProcessError, OSError) as error:
                detail = (getattr(error, "stderr", None) or str(error)).strip().splitlines()[-1:]
                print(f"{scene}: {renderer} not run: {' '.join(detail)}", file=sys.stderr)
        for turn in range(options.rounds):
            for renderer, (spp, reference, results) in plans.items():
                image, seconds = render(renderer, scene, size, spp, turn, options.work)
                full, trimmed = errors(image, reference)
                # squared errors fall as one over the time: to the time asked for, from the one that it took
                equal = trimmed * seconds / options.seconds
                results.append((seconds, image.size * spp / seconds * 1e-6, image.mean(), full, trimmed, equal))
        medians = {renderer: np.median(results, axis=0) for renderer, (_, _, results) in plans.items()}
        for renderer, (seconds, rate, mean, full, trimmed, equal) in medians.items():
            ratios = [f"{medians[name][-1] / equal:.2f}" if name in medians else "-" for name in ours]
            cells = [scene, renderer, plans[renderer][0], f"{seconds:.1f}", f"{rate:.3f}", f"{mean:.4f}", f"{full:.2e}", f"{trimmed:.2e}", f"{equal:.2e}", *ratios]
            print(f"| {' | '.join(map(str, cells))} |", flush=True)


def main():
    if sys.argv[1:2] == ["--worker"]:
        return worker(sys.argv[2:])
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default="A,B,C,E")
    parser.add_argument("--seconds", type=float, default=20, help="CPU seconds per run")
    parser.add_argument("--rounds", type=int, default=3, help="runs of each renderer, in turn; medians are printed")
    parser.add_argument("--scale", type=float, default=0.5, help="of the number of columns and rows")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "target" / "peers")
    parser.add_argument("--renderers", default="abbe-path,abbe-bdpt,abbe-bdpt-unbiased,mitsuba,luxcore-pathcpu,luxcore-bidircpu")
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
