"""Lens prescriptions."""

from __future__ import annotations

import os

from ._abbe import Lens


def lens(path: str | os.PathLike[str]) -> Lens:
    """Reads a lens prescription: Zemax (.zmx), CODE V (.seq) or optiland (.json).

    Lengths are millimeters, wavelengths nanometers.
    """
    return Lens(os.fspath(path))
