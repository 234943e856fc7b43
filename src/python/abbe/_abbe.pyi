"""The extension module: what the package's own modules make friendlier."""

from typing import Any, Callable, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

Overrides = list[tuple[str, str]]

class SceneError(ValueError):
    """A scene with problems, one line each: file, line, column, what is wrong, what is allowed."""

class Scene:
    @staticmethod
    def from_file(path: str, overrides: Overrides) -> Scene: ...
    @staticmethod
    def from_text(text: str, folder: str, overrides: Overrides) -> Scene: ...
    def set(self, more: Overrides) -> None: ...
    @property
    def overrides(self) -> Overrides: ...
    @property
    def sensors(self) -> list[tuple[str, int, int]]: ...
    @property
    def effects(self) -> list[tuple[str, bool, str]]: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def files(self) -> list[Any]: ...
    @property
    def hash(self) -> str: ...

class Session:
    def __init__(
        self,
        scene: Scene,
        settings: Overrides,
        *,
        spp: Optional[int],
        seed: Optional[int],
        sensor: Optional[str],
        passes: Optional[tuple[int, int]],
        time: Optional[float],
        target_error: Optional[float],
        crop: Optional[tuple[int, int, int, int]],
        layers: Sequence[str],
        spectral: Optional[int],
        threads: int,
    ) -> None: ...
    def run(
        self,
        passes: Optional[int] = None,
        tell: Optional[Callable[[Optional[float], int, Optional[float], float], None]] = None,
    ) -> None: ...
    @property
    def stop(self) -> Optional[str]: ...
    @property
    def passes(self) -> int: ...
    def image(self) -> Image: ...

class Image:
    @staticmethod
    def read(path: str) -> Image: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def origin(self) -> tuple[int, int]: ...
    @property
    def channels(self) -> list[str]: ...
    def stack(self, names: Sequence[str]) -> NDArray[np.float32]: ...
    @property
    def wavelengths(self) -> Optional[tuple[list[float], list[float]]]: ...
    def spectrum(self, lines: bool) -> NDArray[np.float32]: ...
    @property
    def attributes(self) -> dict[str, Any]: ...
    @property
    def error(self) -> Optional[float]: ...
    @property
    def statistics(self) -> str: ...
    def replaced(self, xyz: NDArray[np.float32], attributes: Overrides) -> Image: ...
    def save(self, path: str) -> None: ...
    def develop(
        self,
        exposure: Optional[float],
        tone: Optional[str],
        white: str,
        display: str,
        depth: int,
        layer: Optional[str],
    ) -> tuple[bytes, NDArray[np.uint16], float, float]: ...
    def figure(
        self,
        title: str,
        exposure: Optional[float],
        tone: Optional[str],
        layer: Optional[str],
        at: Optional[tuple[int, int]],
    ) -> str: ...

class Glass:
    @property
    def name(self) -> str: ...
    @property
    def source(self) -> str: ...
    @property
    def n_d(self) -> float: ...
    @property
    def abbe_number(self) -> float: ...
    @property
    def range_nm(self) -> Optional[tuple[float, float]]: ...
    def n_at(self, nm: float) -> float: ...
    def k_at(self, nm: float) -> float: ...
    def n_of(self, nm: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def k_of(self, nm: NDArray[np.float64]) -> NDArray[np.float64]: ...

class Lens:
    """A lens prescription. Lengths are millimeters, wavelengths nanometers."""

    def __init__(self, path: str) -> None: ...
    @property
    def name(self) -> str:
        """Title."""

    @property
    def notes(self) -> list[str]:
        """Decisions of the reader: model glasses, things passed over."""

    @property
    def wavelengths(self) -> list[float]:
        """Wavelengths of the file in nm."""

    @property
    def fields(self) -> list[tuple[float, float]]:
        """Fields of the file, x and y, in degrees or mm."""

    @property
    def field_unit(self) -> str:
        """Unit of the fields: "deg", or "mm" of the object or image."""

    def first_order(self, nm: Optional[float] = None) -> dict[str, Optional[float]]:
        """Paraxial data at a wavelength in nm (the primary one without): lengths in mm."""

    def spot(
        self,
        field: tuple[float, float] = (0.0, 0.0),
        nm: Optional[float] = None,
        rings: int = 16,
    ) -> NDArray[np.float64]:
        """Where rays that fill the stop evenly meet the image: x and y in mm, a row each."""

def glass(name: str) -> Glass: ...
def glass_names() -> list[str]: ...
def write_bytes(path: str, data: bytes) -> None: ...
def compare(
    image: NDArray[np.float64], reference: NDArray[np.float64]
) -> list[tuple[float, float, float, float, float, int]]: ...
def command(arguments: Sequence[str]) -> int: ...
def version() -> str: ...
