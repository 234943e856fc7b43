"""Scenes of abbe as scenes of pbrt, and renders of them by pbrt-r4: what compare.py and mlt.py share."""

import csv
import math
import os
import subprocess
import tempfile
import tomllib

import numpy as np
import OpenEXR


def run(*command):
    """CPU seconds of a command."""
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen([str(c) for c in command], stdout=log, stderr=log)
        _, status, usage = os.wait4(process.pid, 0)
        log.seek(0)
        if status:
            raise OSError(f"{' '.join(map(str, command))}\n{log.read().decode()}")
        return usage.ru_utime + usage.ru_stime


def numbers(values):
    return f"[{' '.join(f'{v:.9g}' for v in np.ravel(values))}]"


def near(time, known):
    """The count whose render takes about that CPU time, from two (count, CPU seconds) that are known."""
    (few, start), (more, end) = known
    return max(1, few + round((time - start) / max((end - start) / (more - few), 1e-4)))


class Translation:
    """A scene file of abbe as directives of pbrt. What it has no word for is an error, not left out."""

    def __init__(self, file):
        self.folder, self.scene = file.parent, tomllib.loads(file.read_text())
        self.depth = self.scene["render"]["max_depth"]
        self.camera = self.scene["sensor"][0]["perspective"]
        self.world = "\n".join(self.object(o) for o in self.scene["object"])

    def spectrum(self, key, value):
        if isinstance(value, list):
            return f'"rgb {key}" {numbers(value)}'
        if isinstance(value, str):
            # comments, then a line of names
            lines = (self.folder / self.scene["spectrum"][value]["file"]).read_text().splitlines()
            rows = list(csv.reader(line for line in lines if not line.startswith("#")))[1:]
            return f'"spectrum {key}" {numbers([[float(x) for x in row] for row in rows])}'
        return f'"spectrum {key}" {numbers([360, value, 830, value])}'

    def material(self, thing):
        ((kind, keys),) = self.scene["material"][thing["material"]].items()
        if kind == "diffuse":
            return f'Material "diffuse" {self.spectrum("reflectance", keys["reflectance"])}'
        if kind == "conductor":
            metal = f'"spectrum eta" "metal-{keys["metal"]}-eta" "spectrum k" "metal-{keys["metal"]}-k"'
            return f'Material "conductor" {metal} "float roughness" {keys["roughness"]} "bool remaproughness" false'
        assert (kind, keys) == ("dielectric", {})
        medium = self.scene["medium"][thing["interior"]]
        if "ior" in medium:
            return f'Material "dielectric" "float eta" {medium["ior"]}'
        assert medium["sellmeier"][0][0] == 1.73759695
        return 'Material "dielectric" "spectrum eta" "glass-F11"'

    def light(self, emission):
        """Flat, or as a named illuminant; pbrt scales either to the luminance."""
        if isinstance(emission, dict):
            return f'AreaLightSource "diffuse" "spectrum L" "stdillum-{emission["name"]}" "float scale" {emission["luminance"]}'
        return f'AreaLightSource "diffuse" "spectrum L" [360 1 830 1] "float scale" {emission}'

    def object(self, thing):
        thing = dict(thing)
        if "emission" in thing:
            # lamps of abbe reflect nothing
            words = ['Material "diffuse" "spectrum reflectance" [360 0 830 0]', self.light(thing.pop("emission"))]
        else:
            words = [self.material(thing)]
        turn, move = placement(thing.pop("transform", []))
        for key in ("name", "material", "interior"):
            thing.pop(key, None)
        ((kind, shape),) = thing.items()
        if kind in ("sphere", "disk"):
            assert not move.any() and np.array_equal(turn, np.eye(3))
            words += round_shape(kind, shape)
        else:
            words.append(self.mesh(kind, shape, turn, move))
        return "\n    ".join(["AttributeBegin", *words]) + "\nAttributeEnd"

    def mesh(self, kind, shape, turn, move):
        normals = None
        if kind == "quad":
            c, u, v = (np.array(shape[k], float) for k in ("center", "u", "v"))
            # shines toward u x v, as seen from where the corners run counterclockwise
            points, triangles = np.array([c - u - v, c + u - v, c + u + v, c - u + v]), [(0, 1, 2), (0, 2, 3)]
        elif kind == "box":
            ends = np.array([shape["min"], shape["max"]], float)
            points = np.array([[ends[i >> axis & 1][axis] for axis in range(3)] for i in range(8)])
            quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
            triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
        else:
            assert kind == "mesh"
            mesh = self.scene["mesh"][shape] if isinstance(shape, str) else shape
            points, normals, triangles = read_obj(self.folder / mesh["obj"])
        words = ['Shape "trianglemesh"', f'"point3 P" {numbers(points @ turn.T + move)}']
        if normals is not None:
            words.append(f'"normal N" {numbers(normals @ turn.T)}')
        return "\n        ".join([*words, f'"integer indices" {numbers(triangles)}'])

    def text(self, image, size, seed, integrator):
        """The whole file; `integrator` with its settings."""
        eye, target = numbers(self.camera["eye"])[1:-1], numbers(self.camera["target"])[1:-1]
        # pbrt is left-handed; its angle is that of the shorter side
        assert size[0] >= size[1]
        return f"""Option "seed" {seed}
Scale -1 1 1
LookAt {eye}  {target}  0 1 0
Camera "perspective" "float fov" {self.camera["fov_deg"]}
Film "rgb" "string filename" "{image}" "integer xresolution" {size[0]} "integer yresolution" {size[1]} "bool savefp16" false
PixelFilter "box" "float xradius" 0.5 "float yradius" 0.5
{integrator} "integer maxdepth" {self.depth}
WorldBegin
{self.world}
"""


def placement(steps):
    """Matrix and translation of steps that are taken in turn."""
    turn, move = np.eye(3), np.zeros(3)
    for step in steps:
        ((kind, value),) = step.items()
        if kind == "translate":
            move = move + value
            continue
        assert kind == "rotate"
        x, y, z = np.array(value["axis"], float) / np.linalg.norm(value["axis"])
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        angle = math.radians(value["deg"])
        rotation = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
        turn, move = rotation @ turn, rotation @ move
    return turn, move


def round_shape(kind, shape):
    if kind == "sphere":
        return [f"Translate {numbers(shape['center'])[1:-1]}", f'Shape "sphere" "float radius" {shape["radius"]}']
    normal = np.array(shape["normal"], float) / np.linalg.norm(shape["normal"])
    u = np.cross(normal, np.eye(3)[np.argmin(abs(normal))])
    u /= np.linalg.norm(u)
    # column by column: the disk of pbrt faces +z
    columns = [[*u, 0], [*np.cross(normal, u), 0], [*normal, 0], [*shape["center"], 1]]
    return [f"ConcatTransform {numbers(columns)}", f'Shape "disk" "float radius" {shape["radius"]}']


def read_obj(file):
    """Points, normals of the same indices (or None), and triangles."""
    points, normals, triangles = [], [], []
    for line in file.read_text().splitlines():
        word, *rest = line.split() or [""]
        if word in ("v", "vn"):
            (points if word == "v" else normals).append([float(x) for x in rest])
        elif word == "f":
            corners = [[int(x) - 1 for x in corner.split("/") if x] for corner in rest]
            assert all(len(set(c)) == 1 for c in corners)
            first, *others = [c[0] for c in corners]
            triangles += [(first, a, b) for a, b in zip(others, others[1:])]
    assert not normals or len(normals) == len(points)
    return np.array(points), np.array(normals) if normals else None, triangles


class Renderer:
    """Renders of one scene by one program, on one thread."""

    def __init__(self, program, scene, size, folder):
        self.program, self.translation, self.size = program, Translation(scene), size
        self.image, self.file = folder / "image.exr", folder / f"{scene.stem}.pbrt"

    def render(self, integrator, seed, size=None):
        """Luminance of the pixels, and CPU seconds of the program, its start included."""
        self.file.write_text(self.translation.text(self.image, size or self.size, seed, integrator))
        # a render that fails may say so in its log alone
        self.image.unlink(missing_ok=True)
        seconds = run(self.program, "--nthreads", 1, "--quiet", self.file)
        with OpenEXR.File(str(self.image)) as file:
            channels = file.channels()
            pixels = channels["RGB"].pixels if "RGB" in channels else np.stack([channels[c].pixels for c in "RGB"], -1)
        return pixels.astype(float) @ [0.2126, 0.7152, 0.0722], seconds
