"""Renders: all at once, or pass by pass."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Literal, Optional, TextIO, TypedDict, Union

from . import _abbe
from ._image import Image
from ._scene import Scene, Source, load, overrides

if TYPE_CHECKING:
    from typing_extensions import Unpack

Tell = Callable[[Optional[float], int, Optional[float], float], None]


class Settings(TypedDict, total=False):
    """Keys of the table ``[render]`` of scenes; ``abbe keys`` says what they mean."""

    integrator: Literal["path", "light", "bdpt", "vcm", "bpm", "ppm"]
    lanes: Literal[1, 4, 8]
    max_depth: int
    weights: Literal["variance-aware", "balance", "power2"]
    pair_probability: Union[float, Literal["auto"]]
    light_paths: Union[float, Literal["auto"]]
    regularize: Literal["auto", "off", "single", "mis"]
    aim: Literal["off", "auto", "all"]
    epsilon: Union[float, Literal["auto"]]
    epsilon_min: float
    single_rule: Literal["shortest-edge", "camera", "light"]
    bias_weight: float
    bias_estimate: bool
    show_point_lights: bool
    filter: Literal["box", "tent", "gaussian"]
    filter_radius: float
    wavelengths: Union[str, dict[str, Any]]
    fresnel: Literal["average", "s", "p"]
    units: Literal["radiance", "photometric"]
    merge_radius: float
    merge_alpha: float
    sharing: Literal["hero", "set", "stratified"]


class Options(Settings, total=False):
    """Options of :func:`render` and :func:`passes`, besides settings. None is as good as nothing."""

    spp: Optional[int]
    time: Optional[float]
    target_error: Optional[float]
    seed: Optional[int]
    sensor: Optional[str]
    passes: Optional[tuple[int, int]]
    crop: Optional[tuple[int, int, int, int]]
    layers: Sequence[str]
    spectral: Union[int, bool, None]
    threads: Optional[int]


_OWN = Options.__annotations__.keys() - Settings.__annotations__.keys()


def _session(scene: Scene | Source, options: Options) -> _abbe.Session:
    if not isinstance(scene, Scene):
        scene = load(scene)
    layers, spectral = options.get("layers", ()), options.get("spectral")
    # keys that are newer than these lists are settings, too
    settings = {f"render.{key}": value for key, value in options.items() if key not in _OWN}
    return _abbe.Session(
        scene._scene,
        overrides(settings),
        spp=options.get("spp"),
        seed=options.get("seed"),
        sensor=options.get("sensor"),
        passes=options.get("passes"),
        time=options.get("time"),
        target_error=options.get("target_error"),
        crop=options.get("crop"),
        layers=[layers] if isinstance(layers, str) else list(layers),
        spectral=47 if spectral is True else spectral or None,
        threads=options.get("threads") or 0,
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


def render(scene: Scene | Source, *, progress: bool | Tell = False, **options: Unpack[Options]) -> Image:
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
        Extra layers: error, noise, strategies, regularized, unbiased, bias, depth, normal,
        albedo, direct, ghosts, class:REGEX.
    spectral
        Bins of a spectral image; True for 47. Emission lines have channels of their own.
    threads
        Threads; one per core without.
    progress
        True for a line on stderr, or a function that is called about five times a second with the
        share done (0 to 1, or None), whole passes, relative error (or None) and seconds.
    options
        Any key of the table ``[render]``, too: ``integrator="path"``, ``regularize="off"``.

    An interrupt (Ctrl-C, or a notebook's stop button) ends the render within a pixel. Its whole
    passes are returned as an image whose ``stop`` is "interrupted"; without one, KeyboardInterrupt
    is raised.
    """
    session = _session(scene, options)
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


def passes(scene: Scene | Source, *, every: int = 1, **options: Unpack[Options]) -> Iterator[Image]:
    """Renders one sensor of a scene, and gives its image after every so many passes and at the end.

    Parameters are those of :func:`render`. Each image holds all passes so far and is a copy of its
    own. An interrupt raises KeyboardInterrupt; the image given last is whole.
    """
    if every < 1:
        raise ValueError(f"every {every} passes (allowed: 1 or more)")
    session = _session(scene, options)
    shown = 0
    while session.stop is None:
        session.run(passes=every)
        if session.passes > shown:
            shown = session.passes
            yield Image(session.image())
