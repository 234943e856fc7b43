"""Images: values as arrays, pictures of them, files, and how far they are from another."""

from __future__ import annotations

import json
import os
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Union

from . import _abbe

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float32]


class Figure:
    """A drawing as SVG. A notebook shows it."""

    def __init__(self, svg: str) -> None:
        self.svg = svg
        """Text of an SVG file."""

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes an SVG file."""
        _abbe.write_bytes(os.fspath(path), self.svg.encode())

    def _repr_svg_(self) -> str:
        return self.svg


class Picture:
    """A developed image, for looking at. A notebook shows it."""

    def __init__(self, png: bytes, pixels: NDArray[Any], stops: float, clipped: float) -> None:
        self.png = png
        """Bytes of a PNG file."""
        self.pixels = pixels
        """Encoded red, green and blue: rows x columns x 3, of 8 or 16 bits."""
        self.stops = stops
        """Exposure: values were multiplied by 2 to this power."""
        self.clipped = clipped
        """Share of the pixels that are brighter than the tone curve can show."""

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes a PNG file."""
        _abbe.write_bytes(os.fspath(path), self.png)

    def _repr_png_(self) -> bytes:
        return self.png

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return self.pixels if dtype is None else self.pixels.astype(dtype)

    def __repr__(self) -> str:
        rows, columns, _ = self.pixels.shape
        return f"<abbe.Picture {columns} x {rows}, exposure {self.stops:+.2f} EV>"


class Image:
    """An image of CIE XYZ values with its layers, spectra and how it was made.

    Made by :func:`render`, :func:`passes` and :func:`read`. Arrays are made when they are asked for.
    """

    _image: _abbe.Image

    def __init__(self, image: _abbe.Image) -> None:
        self._image = image

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self._image.shape

    @property
    def origin(self) -> tuple[int, int]:
        """Column and row of the film at which the image begins: not (0, 0) for a crop."""
        return self._image.origin

    @cached_property
    def xyz(self) -> Floats:
        """X, Y and Z: rows x columns x 3. See ``unit``."""
        return self._image.stack(["X", "Y", "Z"])

    @property
    def unit(self) -> str:
        """Quantity and unit of the values."""
        return str(self.attributes.get("unit", ""))

    @property
    def attributes(self) -> dict[str, Any]:
        """How the image was made: scene, passes, seed, integrator and so on."""
        return self._image.attributes

    @cached_property
    def layers(self) -> dict[str, Floats]:
        """Extra layers by name: rows x columns x 3, or rows x columns for one channel.

        An attribute ``layer:NAME`` says what each holds.
        """
        names: dict[str, list[str]] = {}
        for channel in self._image.channels:
            layer, dot, _ = channel.rpartition(".")
            if dot:
                names.setdefault(layer, []).append(channel)
        arrays = {layer: self._image.stack(sorted(channels)) for layer, channels in names.items()}
        return {layer: a[..., 0] if a.shape[2] == 1 else a for layer, a in arrays.items()}

    @cached_property
    def wavelengths(self) -> NDArray[np.float64]:
        """Centers of the spectral bins in nm; empty without a spectral image."""
        import numpy as np

        return np.asarray((self._image.wavelengths or ((), ()))[0], dtype=float)

    @cached_property
    def spectrum(self) -> Floats:
        """The spectral image: rows x columns x bins, the mean per nm within each bin.

        Radiance of cameras in W/(m2 sr nm), irradiance of detectors in W/(m2 nm).
        """
        return self._image.spectrum(False)

    @cached_property
    def line_wavelengths(self) -> NDArray[np.float64]:
        """Wavelengths of the scene's emission lines in nm, where there is a spectral image."""
        import numpy as np

        return np.asarray((self._image.wavelengths or ((), ()))[1], dtype=float)

    @cached_property
    def lines(self) -> Floats:
        """Power of each emission line: rows x columns x lines, W/(m2 sr) or W/m2."""
        return self._image.spectrum(True)

    @property
    def error(self) -> float | None:
        """Estimated error relative to the mean of Y (0.01 for 1 %), or None while it is unknown."""
        return self._image.error

    @cached_property
    def statistics(self) -> dict[str, Any]:
        """Passes, seconds, rays, flux, forecast: as ``abbe render --stats`` writes them.

        Empty for an image of a file.
        """
        statistics: dict[str, Any] = json.loads(self._image.statistics)
        return statistics

    @property
    def passes(self) -> int:
        """Number of passes of a render, 0 for an image of a file."""
        return int(self.statistics.get("passes", 0))

    @property
    def stop(self) -> str | None:
        """Why the render ended, such as "interrupted"; None for an image of a file."""
        return self.statistics.get("stopped_because")

    @property
    def flux(self) -> dict[str, Any] | None:
        """Flux through a detector with its standard error, in lm and W; None for a camera."""
        return self.statistics.get("flux")

    def develop(
        self,
        *,
        exposure: float | None = None,
        tone: str | None = None,
        white: str = "none",
        display: str = "srgb",
        depth: int = 8,
        layer: str | None = None,
    ) -> Picture:
        """A picture for looking at, as ``abbe develop`` makes it.

        Parameters
        ----------
        exposure
            Stops (EV); by the picture itself without.
        tone
            linear, filmic or agx; filmic without, of detectors linear.
        white
            The color that is to be white: none (D65), scene, "R,G,B" in linear sRGB, a temperature
            such as "3200K", or a spectrum such as "D50".
        display
            srgb or p3.
        depth
            8 or 16 bits.
        layer
            A layer instead of the image itself.
        """
        import numpy as np

        png, pixels, stops, clipped = self._image.develop(exposure, tone, white, display, depth, layer)
        return Picture(png, pixels.astype(np.uint8) if depth == 8 else pixels, stops, clipped)

    def figure(
        self,
        *,
        title: str = "",
        exposure: float | None = None,
        tone: str | None = None,
        layer: str | None = None,
        at: tuple[int, int] | None = None,
    ) -> Figure:
        """A figure: the picture with its scale, values along a row and a column, flux.

        Lengths are millimeters on a detector and pixels of a camera, values lux and cd/m2; the flux
        is that through a detector, with its standard error.

        Parameters
        ----------
        title
            Text above the picture.
        exposure, tone, layer
            As of ``develop``.
        at
            Column and row of the film that are shown; those of the centroid of the light without.
        """
        return Figure(self._image.figure(title, exposure, tone, layer, at))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the image: as EXR (the spectral image beside it as NAME.spectral.exr), or developed as PNG.

        The EXR file has the bytes that ``abbe render`` writes.
        """
        path = os.fspath(path)
        if path.lower().endswith(".png"):
            self.develop().save(path)
        elif path.lower().endswith(".exr"):
            self._image.save(path)
        else:
            raise ValueError(f"{path}: unknown kind of image (allowed: .exr, .png)")

    def to_xarray(self) -> Any:
        """The image as an xarray.Dataset: xyz and each layer over y, x in pixels, spectrum over nm.

        Needs the optional package xarray.
        """
        import xarray

        data: dict[str, Any] = {"xyz": (("y", "x", "channel"), self.xyz)}
        for name, values in self.layers.items():
            data[name] = (("y", "x", "channel") if values.ndim == 3 else ("y", "x"), values)
        rows, columns = self.shape
        x0, y0 = self.origin
        coordinates: dict[str, Any] = {
            "y": range(y0, y0 + rows),
            "x": range(x0, x0 + columns),
            "channel": ["X", "Y", "Z"],
        }
        if self.wavelengths.size:
            data["spectrum"] = (("y", "x", "nm"), self.spectrum)
            coordinates["nm"] = self.wavelengths
        return xarray.Dataset(data, coords=coordinates, attrs=self.attributes)

    def _repr_png_(self) -> bytes:
        return self.develop().png

    def __repr__(self) -> str:
        rows, columns = self.shape
        passes = f", {self.passes} passes" if self.passes else ""
        error = "" if self.error is None else f", error {100 * self.error:.2g} %"
        return f"<abbe.Image {columns} x {rows}{passes}{error}>"


def read(path: str | os.PathLike[str]) -> Image:
    """Reads an EXR image, or the image of a part file."""
    return Image(_abbe.Image.read(os.fspath(path)))


class Errors(NamedTuple):
    """How far a channel is from a reference: the measures of ``abbe compare``."""

    rel_mse: float
    """Mean of (I - R)^2/(R^2 + 0.01)."""
    trimmed_rel_mse: float
    """The same without the worst 0.1 % of the pixels."""
    rmse: float
    """Root of the mean of (I - R)^2."""
    log_rmse: float
    """Root of the mean of (ln(I + 0.01) - ln(R + 0.01))^2."""
    mean_ratio: float
    """Mean of I over mean of R."""
    fireflies: int
    """Pixels that are far brighter than the reference around them."""


def compare(image: Union[Image, ArrayLike], reference: Union[Image, ArrayLike]) -> dict[str, Errors]:
    """Errors of X, Y and Z of an image against a reference: images, or arrays rows x columns x 3."""
    import numpy as np

    pair = [np.asarray(i.xyz if isinstance(i, Image) else i, dtype=float) for i in (image, reference)]
    for array in pair:
        if array.ndim != 3 or not np.isfinite(array).all():
            raise ValueError("expected rows x columns x 3 finite values")
    return dict(zip("XYZ", (Errors(*errors) for errors in _abbe.compare(*pair))))
