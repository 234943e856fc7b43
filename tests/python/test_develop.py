"""The transforms of `develop` against colour-science: displays, white adaptation, hue and lightness of the gamut mapping."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import abbe

warnings.filterwarnings("ignore", category=Warning, module="colour")
colour = pytest.importorskip("colour")

# a lamp for each pixel: colors inside of the displays' gamuts, and lines of the spectrum beyond them
WIDTH, HEIGHT = 12, 6
LINES = [{"lines": [[float(nm), 30.0]]} for nm in np.linspace(430, 650, 36)]
COLORS = [{"rgb": list(map(float, rgb))} for rgb in np.random.default_rng(3).uniform(0.05, 0.6, (36, 3))]


@pytest.fixture(scope="module")
def lamps():
    def lamp(i, emission):
        x, y = i % WIDTH - WIDTH / 2 + 0.5, i // WIDTH - HEIGHT / 2 + 0.5
        return {"quad": {"center": [x, y, 0], "u": [0.5, 0, 0], "v": [0, 0.5, 0]}, "emission": emission}

    scene = {
        "render": {"spp": 256, "lanes": 8},
        "sensor": [
            {
                "resolution": [WIDTH, HEIGHT],
                "filter": "box",
                "orthographic": {"eye": [0, 0, 5], "target": [0, 0, 0], "height": HEIGHT},
            }
        ],
        "object": [lamp(i, emission) for i, emission in enumerate(COLORS + LINES)],
    }
    return abbe.render(abbe.load(scene))


def space(display):
    found = colour.RGB_COLOURSPACES[{"srgb": "sRGB", "p3": "Display P3"}[display]].copy()
    # by primaries and white; the published matrices have four digits
    found.use_derived_matrix_RGB_to_XYZ = found.use_derived_matrix_XYZ_to_RGB = True
    return found


def shown(image, **options):
    picture = image.develop(tone="linear", depth=16, **options)
    return np.asarray(picture).reshape(-1, 3) / 65535


def linear(xyz, display):
    return colour.XYZ_to_RGB(xyz, space(display), apply_cctf_encoding=False)


def turn(a, b):
    """Angle between the hues of two arrays of Oklab colors, radians."""
    return np.angle((a[:, 1] + 1j * a[:, 2]) * np.conj(b[:, 1] + 1j * b[:, 2]))


@pytest.mark.parametrize("display", ["srgb", "p3"])
def test_colors_of_a_display_are_encoded_as_its_standard_says(lamps, display):
    xyz = np.asarray(lamps.xyz, dtype=float).reshape(-1, 3)
    rgb = linear(xyz, display)
    inside = (rgb > 0.0).all(1) & (rgb < 1.0).all(1)
    assert inside.sum() >= 36
    expected = colour.RGB_COLOURSPACES["sRGB"].cctf_encoding(rgb[inside])
    assert np.abs(shown(lamps, exposure=0.0, display=display)[inside] - expected).max() < 1e-4


@pytest.mark.parametrize("display", ["srgb", "p3"])
def test_other_colors_keep_hue_and_lightness(lamps, display):
    xyz = np.asarray(lamps.xyz, dtype=float).reshape(-1, 3)
    outside = (linear(xyz, display) < -0.01).any(1) & (xyz[:, 1] < 1.0)
    assert outside.sum() >= 20
    rgb = colour.RGB_COLOURSPACES["sRGB"].cctf_decoding(shown(lamps, exposure=0.0, display=display))
    found = colour.XYZ_to_Oklab(colour.RGB_to_XYZ(rgb, space(display), apply_cctf_decoding=False))[outside]
    expected = colour.XYZ_to_Oklab(xyz[outside])
    assert np.abs(found[:, 0] - expected[:, 0]).max() < 0.01
    assert np.abs(turn(found, expected)).max() < 0.02
    # and less chroma, of course
    assert (np.hypot(*found[:, 1:].T) < np.hypot(*expected[:, 1:].T)).all()


@pytest.mark.parametrize("name, xy", [("A", None), ("D50", None), ("3200K", colour.temperature.CCT_to_xy_Kang2002(3200))])
def test_another_white_is_adapted_by_bradford(lamps, name, xy):
    xyz = np.asarray(lamps.xyz, dtype=float).reshape(-1, 3)
    illuminants = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]
    white = colour.xy_to_XYZ(illuminants[name] if xy is None else xy)
    adapted = colour.adaptation.chromatic_adaptation_VonKries(
        xyz, white, colour.xy_to_XYZ([0.3127, 0.3290]), transform="Bradford"
    )
    rgb = linear(adapted, "srgb")
    inside = (rgb > 0.0).all(1) & (rgb < 1.0).all(1)
    assert inside.sum() >= 10
    expected = colour.RGB_COLOURSPACES["sRGB"].cctf_encoding(rgb[inside])
    # chromaticities of whites are published with four digits or five; Kang's temperatures are a fit
    tolerance = 1e-3 if xy is None else 5e-3
    assert np.abs(shown(lamps, exposure=0.0, white=name)[inside] - expected).max() < tolerance
    plain = colour.RGB_COLOURSPACES["sRGB"].cctf_encoding(linear(xyz, "srgb"))
    assert np.abs(plain[inside] - expected).max() > 0.05
