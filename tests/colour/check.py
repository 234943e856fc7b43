"""Compare XYZ values of abbe (JSON on standard input) with colour-science; one JSON line per check.

Method: colour.sd_to_XYZ(..., method="Integration") with the CIE 1931 2 degree observer at 1 nm over 360..830 nm.
Tables of 5 nm are interpolated linearly and their end values held, as abbe documents.
"""
import json
import sys
import warnings

warnings.filterwarnings("ignore")

import colour
import numpy as np

SHAPE = colour.SpectralShape(360, 830, 1)
NM = np.arange(360, 831, dtype=float)
CMFS = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(SHAPE)
D65_XY = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]


def at_1nm(sd):
    return np.interp(NM, sd.wavelengths, sd.values)


def distribution(values):
    return colour.SpectralDistribution(values, NM)


def to_xyz(values, illuminant=None):
    """XYZ with Y = 1 for the illuminant (or for the spectrum itself if there is none)."""
    if illuminant is None:
        xyz = colour.sd_to_XYZ(distribution(values), CMFS, k=1, method="Integration", shape=SHAPE)
        return np.asarray(xyz) / xyz[1]
    xyz = colour.sd_to_XYZ(distribution(values), CMFS, distribution(illuminant), method="Integration", shape=SHAPE)
    return np.asarray(xyz) / 100


def illuminant(name):
    if name == "A":
        return at_1nm(colour.sd_CIE_standard_illuminant_A(SHAPE))
    return at_1nm(colour.SDS_ILLUMINANTS[{"F2": "FL2", "F11": "FL11"}.get(name, name)])


PATCHES = [at_1nm(sd) for sd in colour.SDS_COLOURCHECKERS["ISO 17321-1"].values()]


def reference(case):
    kind = case["kind"]
    if kind == "illuminant":
        return to_xyz(illuminant(case["illuminant"]))
    if kind == "blackbody":
        return to_xyz(colour.sd_blackbody(case["temp_k"], SHAPE).values)
    if kind == "patch":
        return to_xyz(PATCHES[case["index"]], illuminant(case["illuminant"]))
    if kind == "samples":
        return to_xyz(np.array(case["values"]))
    if kind == "srgb":
        return np.asarray(colour.RGB_to_XYZ(np.array(case["rgb"]), "sRGB"))
    raise ValueError(kind)


def lab(xyz, white):
    return colour.XYZ_to_Lab(np.asarray(xyz), white)


for case in json.load(sys.stdin):
    want = reference(case)
    white = colour.XYZ_to_xy(to_xyz(illuminant(case["illuminant"]))) if case.get("own_white") else D65_XY
    print(json.dumps({
        "name": case["name"],
        "kind": case["kind"],
        "delta_e": float(colour.delta_E(lab(case["xyz"], white), lab(want, white), method="CIE 2000")),
        "relative": float(np.max(np.abs(np.array(case["xyz"]) - want)) / np.max(np.abs(want))),
        "want": [float(v) for v in want],
    }))
