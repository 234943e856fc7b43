"""Denoising with Intel Open Image Denoise, through the optional package pyoidn."""

from __future__ import annotations

from ._image import Image


def denoise(image: Image) -> Image:
    """The image with its noise removed by Intel Open Image Denoise: for looking at, not for measuring.

    The image must have the layers albedo and normal (``abbe.render(..., layers=["albedo",
    "normal"])``), which tell edges and textures from noise. X, Y and Z stand for the three colors
    that the filter expects: unlike red, green and blue they are never negative. The attribute
    ``denoised`` of the outcome names the filter; errors and spectra are left out.

    Needs the package pyoidn (``pip install abbe[denoise]``).
    """
    try:
        import pyoidn  # type: ignore[import-untyped,unused-ignore]
    except ImportError as error:
        raise ImportError("abbe.denoise needs the package pyoidn: pip install pyoidn") from error
    import numpy as np

    layers = image.layers
    missing = [name for name in ("albedo", "normal") if name not in layers]
    if missing:
        raise ValueError(f"the image has no layer {' and no layer '.join(missing)}: render with layers=['albedo', 'normal']")
    xyz = np.nan_to_num(image.xyz, nan=0.0, posinf=0.0, neginf=0.0)
    clean = pyoidn.denoise(
        np.ascontiguousarray(np.maximum(xyz, 0.0)),
        np.ascontiguousarray(np.clip(layers["albedo"], 0.0, 1.0)),
        np.ascontiguousarray(layers["normal"]),
        hdr=True,
        clean_aux=True,
    )
    version = getattr(getattr(pyoidn, "version", None), "oidn_version", "")
    note = f"Open Image Denoise by pyoidn {version}".strip()
    return Image(image._image.replaced(np.ascontiguousarray(clean), [("denoised", note)]))
