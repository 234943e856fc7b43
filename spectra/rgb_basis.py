"""Writes reflectance/srgb.csv: three smooth reflectances that add up to 1 and have the primaries of linear sRGB under D65.

The criterion is that of Mallett and Yuksel, "Spectral Primary Decomposition for Rendering with sRGB Reflectance" (EGSR
2019): the smoothest curves in 0..1 that sum to 1. Needs numpy, scipy and osqp.
"""

import csv
import pathlib

import numpy as np
import osqp
import scipy.sparse as sp

HERE = pathlib.Path(__file__).parent
STEP = 5
XYZ_TO_RGB = np.linalg.inv(np.array([
    [0.4124564, 0.3575761, 0.1804375],
    [0.2126729, 0.7151522, 0.0721750],
    [0.0193339, 0.1191920, 0.9503041],
]))


def table(name):
    rows = [r for r in csv.reader(open(HERE / name)) if r and not r[0].startswith("#")][1:]
    return np.array(rows, dtype=float)


cmf, d65 = table("cie/cmf_1931_2deg.csv"), table("cie/D65.csv")
nm = np.arange(360, 831)
white = np.interp(nm, d65[:, 0], d65[:, 1])
weights = (XYZ_TO_RGB @ (cmf[:, 1:].T * white)).T
weights /= weights.sum(axis=0)

knots = np.arange(360, 831, STEP)
n = len(knots)
# linear interpolation from the knots to every nanometer
at = np.array([np.interp(nm, knots, np.eye(n)[i]) for i in range(n)]).T
response = weights.T @ at

difference = sp.diags([1, -1], [0, 1], shape=(n - 1, n))
smooth = difference.T @ difference
# unknowns are red and green; blue is what they leave of 1
cost = sp.bmat([[2 * smooth, smooth], [smooth, 2 * smooth]]).tocsc()
identity = sp.eye(n)
constraints = sp.bmat([
    [sp.csc_matrix(response), None],
    [None, sp.csc_matrix(response)],
    [identity, None],
    [None, identity],
    [identity, identity],
]).tocsc()
low = np.concatenate([[1, 0, 0], [0, 1, 0], np.zeros(3 * n)])
high = np.concatenate([[1, 0, 0], [0, 1, 0], np.ones(3 * n)])
solver = osqp.OSQP()
solver.setup(2 * cost, np.zeros(2 * n), constraints, low, high, verbose=False, eps_abs=1e-9, eps_rel=1e-9,
             max_iter=2_000_000, polishing=True)
x = solver.solve().x.clip(0, 1)
red, green = x[:n].round(6), x[n:].round(6)
blue = (1 - red - green).round(6)
assert blue.min() > -1e-5
blue = blue.clip(0)
print(np.abs(np.stack([response @ c for c in (red, green, blue)]) - np.eye(3)).max())

with open(HERE / "reflectance/srgb.csv", "w") as file:
    file.write("# Smooth reflectances that add up to 1 and have the primaries of linear sRGB under D65, 5 nm.\n")
    file.write("# Source: computed by rgb_basis.py, after the criterion of Mallett and Yuksel (EGSR 2019). Unit: 1.\n")
    file.write("nm,red,green,blue\n")
    for row in zip(knots, red, green, blue):
        file.write(",".join(f"{v:g}" for v in row) + "\n")
