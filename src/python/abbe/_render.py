"""Renders: all at once, or pass by pass."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Optional, TextIO, Union

from . import _abbe
from ._image import Image
from ._scene import Scene, Source, load, overrides

Tell = Callable[[Optional[float], int, Optional[float], float], None]


def _session(
    scene: Scene | Source,
    *,
    spp: int | None,
    time: float | None,
    target_error: float | None,
    seed: int | None,
    sensor: str | None,
    passes: tuple[int, int] | None,
    crop: tuple[int, int, int, int] | None,
    layers: Sequence[str],
    spectral: int | bool | None,
    threads: int | None,
    settings: dict[str, Any],
) -> _abbe.Session:
    if not isinstance(scene, Scene):
        scene = load(scene)
    bins = 47 if spectral is True else spectral or None
    return _abbe.Session(
        scene._scene,
        overrides({f"render.{key}": value for key, value in settings.items()}),
        spp=spp,
        seed=seed,
        sensor=sensor,
        passes=passes,
        time=time,
        target_error=target_error,
        crop=crop,
        layers=[layers] if isinstance(layers, str) else list(layers),
        spectral=bins,
        threads=threads or 0,
    )


class _Line:
    """A line of progress that is written over itself, and taken away at the end."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._width = 0

    def __call__(self, share: float | None, passes: int, error: float | None, seconds: float) -> None:
        done = "" if share is None else f"{100 * share:3.0f} % "
        left = "" if not share else f", {seconds * (1 - share) / share:.0f} s left"
        known = "" if error is None else f", error {100 * error:.2g} %"
        text = f"{done}{passes} passes{known}, {seconds:.0f} s{left}"
        self._write(text)

    def _write(self, text: str) -> None:
        self._stream.write("\r" + text.ljust(self._width))
        self._width = len(text)
        self._stream.flush()

    def clear(self) -> None:
        if self._width:
            self._write("")
            self._stream.write("\r")


def render(
    scene: Scene | Source,
    *,
    spp: int | None = None,
    time: float | None = None,
    target_error: float | None = None,
    seed: int | None = None,
    sensor: str | None = None,
    passes: tuple[int, int] | None = None,
    crop: tuple[int, int, int, int] | None = None,
    layers: Sequence[str] = (),
    spectral: int | bool | None = None,
    threads: int | None = None,
    progress: bool | Tell = False,
    **settings: Any,
) -> Image:
    """Renders one sensor of a scene.

    Parameters
    ----------
    scene
        A scene, or what :func:`load` takes.
    spp
        Passes, one sample per pixel each; as the scene says without. With ``time`` or
        ``target_error`` alone, as many as it takes.
    time
        Seconds after which no pass begins.
    target_error
        Estimated relative error of the image at which to stop.
    seed
        Seed of all random numbers, 0 or more.
    sensor
        Name of the sensor; the first without.
    passes
        ``(A, B)``: the passes A, A+1, ..., B-1 alone.
    crop
        ``(x0, y0, x1, y1)``: the pixels x0 <= x < x1, y0 <= y < y1 alone.
    layers
        Extra layers: error, strategies, regularized, unbiased, bias, depth, normal, albedo,
        direct, ghosts, class:REGEX.
    spectral
        Bins of a spectral image; True for 47. Emission lines have channels of their own.
    threads
        Threads; one per core without.
    progress
        True for a line on stderr, or a function that is called about five times a second with the
        share done (0 to 1, or None), whole passes, relative error (or None) and seconds.
    settings
        Any key of the table ``[render]``: ``integrator="path"``, ``regularize="off"``.

    An interrupt (Ctrl-C, or a notebook's stop button) ends the render within a pixel. Its whole
    passes are returned as an image whose ``stop`` is "interrupted"; without one, KeyboardInterrupt
    is raised.
    """
    session = _session(
        scene,
        spp=spp,
        time=time,
        target_error=target_error,
        seed=seed,
        sensor=sensor,
        passes=passes,
        crop=crop,
        layers=layers,
        spectral=spectral,
        threads=threads,
        settings=settings,
    )
    line = _Line(sys.stderr) if progress is True else None
    tell: Union[Tell, None] = line or (progress if callable(progress) else None)
    try:
        session.run(tell=tell)
    except KeyboardInterrupt:
        if session.passes == 0:
            raise
    finally:
        if line:
            line.clear()
    return Image(session.image())


def passes(
    scene: Scene | Source,
    *,
    every: int = 1,
    spp: int | None = None,
    time: float | None = None,
    target_error: float | None = None,
    seed: int | None = None,
    sensor: str | None = None,
    crop: tuple[int, int, int, int] | None = None,
    layers: Sequence[str] = (),
    spectral: int | bool | None = None,
    threads: int | None = None,
    **settings: Any,
) -> Iterator[Image]:
    """Renders one sensor of a scene, and gives its image after every so many passes and at the end.

    Parameters are those of :func:`render`. Each image holds all passes so far and is a copy of its
    own. An interrupt raises KeyboardInterrupt; the image given last is whole.
    """
    if every < 1:
        raise ValueError(f"every {every} passes (allowed: 1 or more)")
    session = _session(
        scene,
        spp=spp,
        time=time,
        target_error=target_error,
        seed=seed,
        sensor=sensor,
        passes=None,
        crop=crop,
        layers=layers,
        spectral=spectral,
        threads=threads,
        settings=settings,
    )
    shown = 0
    while session.stop is None:
        session.run(passes=every)
        if session.passes > shown:
            shown = session.passes
            yield Image(session.image())
