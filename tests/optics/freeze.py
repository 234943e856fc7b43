#!/usr/bin/env python3
"""Write frozen.json: paraxial data and real rays of the lenses of scenes/lenses by optiland, coatings by tmm.

    pip install optiland==0.6.3 tmm==0.2.0
    python3 freeze.py

Every lens is read by optiland's own reader of Zemax files, with optiland's own copy of the glass database. Rays are given
in the coordinates of the system and met at every surface, on and off axis, at F, d and C.
"""
import json
import math
import os

import numpy as np
import optiland
import tmm
from optiland.fileio import load_zemax_file
from optiland.materials import MaterialFile
from optiland.rays import RealRays

HERE = os.path.dirname(os.path.abspath(__file__))
LENSES = os.path.join(HERE, "..", "..", "scenes", "lenses")
# optiland's reader takes N-SF5 for SF5 and another maker's F5: these are given by file
GLASSES = os.path.join(os.path.dirname(optiland.__file__), "database", "data-nk", "glass", "schott")
EXACT = ["SF5", "F5", "F2", "SF2"]
UM = [0.4861327, 0.5875618, 0.6562725]


def rays_of(optic, um):
    out = []
    for degrees in (0.0, 1.5, 3.0):
        for px, py in ((0.0, 0.0), (0.0, 1.0), (0.7, -0.3), (-0.4, 0.6)):
            u, v = math.tan(math.radians(degrees)), 0.4 * math.tan(math.radians(degrees))
            norm = math.sqrt(1 + u * u + v * v)
            radius = 4.0
            d = [v / norm, u / norm, 1 / norm]
            o = [px * radius - 10 * v, py * radius - 10 * u, -10.0]
            rays = RealRays(*[np.array([c]) for c in (*o, *d)], np.array([1.0]), np.array([um]))
            optic.surfaces.trace(rays)
            points = [[float(np.ravel(s.x)[0]), float(np.ravel(s.y)[0]), float(np.ravel(s.z)[0])] for s in list(optic.surfaces)[1:]]
            out.append({"o": o, "d": d, "points": points})
    return out


def lens(name):
    optic = load_zemax_file(os.path.join(LENSES, name))
    for surface in optic.surfaces:
        if hasattr(surface.geometry, "tol"):
            # its iteration ends 1e-9 mm before the surface otherwise
            surface.geometry.tol = 1e-14
        glass = getattr(surface.material_post, "name", None)
        if glass in EXACT:
            surface.material_post = MaterialFile(os.path.join(GLASSES, f"{glass}.yml"))
    result = {"file": name, "first_order": [], "rays": []}
    for um in UM:
        result["rays"].append({"nm": um * 1e3, "rays": rays_of(optic, um)})
    for surface in optic.surfaces:
        # paraxial rays of optiland leave out the term in r^2, which is curvature of the vertex
        terms = list(np.ravel(getattr(surface.geometry, "coefficients", [])))
        if terms and terms[0] != 0:
            surface.geometry.radius = 1 / (1 / float(surface.geometry.radius) + 2 * float(terms[0]))
    for um in UM:
        y, u = optic.paraxial.trace_generic(1.0, 0.0, -1.0, um)
        y, u = np.ravel(y), np.ravel(u)
        result["first_order"].append({"nm": um * 1e3, "efl": float(-y[0] / u[-1]), "bfl": float(-y[-2] / u[-1])})
    result["entrance_pupil"] = float(np.ravel(optic.paraxial.EPL())[0])
    return result


def coatings():
    out = []
    stacks = [
        ([1.38], [99.6], 1.52),
        ([1.38, 2.1, 1.62], [99.6, 131.0, 84.9], 1.52),
        ([1.38, 0.05 + 3.4j, 2.3 + 0.01j], [99.6, 12.0, 60.0], 1.52),
        ([1.46, 0.96 + 6.69j], [188.0, 80.0], 1.52),
        ([1.46], [188.0], 0.96 + 6.69j),
    ]
    for n, d, substrate in stacks:
        for nm in (450.0, 550.0, 680.0):
            for degrees in (0.0, 25.0, 60.0, 85.0):
                row = {"n": [[complex(v).real, complex(v).imag] for v in n], "nm_thick": d,
                       "substrate": [complex(substrate).real, complex(substrate).imag], "nm": nm, "degrees": degrees}
                for p in "sp":
                    r = tmm.coh_tmm(p, [1.0] + n + [substrate], [np.inf] + d + [np.inf], math.radians(degrees), nm)
                    row[p] = [float(r["R"]), float(r["T"])]
                out.append(row)
    return out


names = sorted(f for f in os.listdir(LENSES) if f.endswith(".zmx"))
data = {"versions": "optiland 0.6.3, tmm 0.2.0", "lenses": [lens(n) for n in names], "coatings": coatings()}
with open(os.path.join(HERE, "frozen.json"), "w") as file:
    json.dump(data, file, separators=(",", ":"))
