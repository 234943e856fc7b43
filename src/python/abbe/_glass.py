"""Glasses, crystals, liquids and metals of the built-in library."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, overload

from . import _abbe

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class Glass:
    """A refractive index as a function of the vacuum wavelength. Made by :func:`glass`."""

    _glass: _abbe.Glass

    def __init__(self, glass: _abbe.Glass) -> None:
        self._glass = glass

    @property
    def name(self) -> str:
        """Name with its catalog, such as "schott:N-SF11"."""
        return self._glass.name

    @property
    def source(self) -> str:
        """Where the data come from."""
        return self._glass.source

    @property
    def n_d(self) -> float:
        """Index at the d line of helium, 587.5618 nm."""
        return self._glass.n_d

    @property
    def abbe_number(self) -> float:
        """V_d = (n_d - 1)/(n_F - n_C)."""
        return self._glass.abbe_number

    @property
    def range_nm(self) -> tuple[float, float] | None:
        """Wavelengths in nm over which the data were fitted; None where there is no such range."""
        return self._glass.range_nm

    @overload
    def n(self, nm: float) -> float: ...
    @overload
    def n(self, nm: Any) -> NDArray[np.float64]: ...

    def n(self, nm: Any) -> Any:
        """Index of refraction relative to vacuum at a wavelength in nm, or at each of an array."""
        return _each(nm, self._glass.n_at, self._glass.n_of)

    @overload
    def k(self, nm: float) -> float: ...
    @overload
    def k(self, nm: Any) -> NDArray[np.float64]: ...

    def k(self, nm: Any) -> Any:
        """Extinction coefficient at a wavelength in nm, or at each of an array; 0 without data."""
        return _each(nm, self._glass.k_at, self._glass.k_of)

    def __repr__(self) -> str:
        return repr(self._glass)


def _each(nm: Any, at: Any, of: Any) -> Any:
    if isinstance(nm, (int, float)):
        return at(float(nm))
    import numpy as np

    array = np.asarray(nm, dtype=float)
    return of(np.ascontiguousarray(array).ravel()).reshape(array.shape)


def glass(name: str) -> Glass:
    """A glass by catalog and name, such as "schott:N-SF11"; the catalog may be left out where it is clear.

    Raises LookupError, with names that are near.
    """
    return Glass(_abbe.glass(name))


def glasses() -> list[str]:
    """Names of all of them."""
    return _abbe.glass_names()
