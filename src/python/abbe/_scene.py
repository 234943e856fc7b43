"""Scenes: files, models or dictionaries, with keys set over what they say."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, NamedTuple, Union, overload

from . import _abbe, _toml

Source = Union[str, "os.PathLike[str]", Mapping[str, Any]]


class Sensor(NamedTuple):
    """A camera or detector of a scene."""

    name: str
    columns: int
    rows: int


class Effect(NamedTuple):
    """A phenomenon that costs time where a scene has it, and what in the scene calls for it."""

    name: str
    on: bool
    reason: str


def overrides(keys: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Keys and values as the command line's ``--set`` takes them."""
    return [(key, _toml.value(value)) for key, value in keys.items()]


class Scene:
    """A scene, read and built. Made by :func:`load`."""

    _scene: _abbe.Scene

    def __init__(self, scene: _abbe.Scene) -> None:
        self._scene = scene

    @overload
    def set(self, key: str, value: Any, /) -> Scene: ...
    @overload
    def set(self, keys: Mapping[str, Any], /) -> Scene: ...

    def set(self, key: str | Mapping[str, Any], value: Any = None, /) -> Scene:
        """Replaces any key of the scene, or several at once, and returns the scene.

        A key is dotted; an element of a list is named by its index or its name:
        ``scene.set("object.lens.material", "glass")``, ``scene.set({"render.spp": 16,
        "sensor.0.resolution": [320, 240]})``. The scene is read and built anew: set several keys of
        a large one together.

        Raises SceneError where the outcome is no scene, which then stays as it was.
        """
        keys = {key: value} if isinstance(key, str) else key
        self._scene.set(overrides(keys))
        return self

    @property
    def keys_set(self) -> dict[str, str]:
        """Keys that were set, with their values as TOML."""
        return dict(self._scene.overrides)

    @property
    def sensors(self) -> list[Sensor]:
        """Cameras and detectors, in the order of the file."""
        return [Sensor(*sensor) for sensor in self._scene.sensors]

    @property
    def effects(self) -> list[Effect]:
        """What the scene calls for, and why."""
        return [Effect(*effect) for effect in self._scene.effects]

    @property
    def warnings(self) -> list[str]:
        """Things that are legal but surely not meant."""
        return self._scene.warnings

    @property
    def files(self) -> list[os.PathLike[str]]:
        """Files that were read."""
        return self._scene.files

    @property
    def hash(self) -> str:
        """Hash of the scene, which its images carry as ``sceneHash``."""
        return self._scene.hash

    def __repr__(self) -> str:
        return repr(self._scene)


def load(source: Source, *, folder: str | os.PathLike[str] = ".") -> Scene:
    """Reads a scene: a scene file (.toml), a model (.gltf, .glb, .obj, .ply), or a dictionary.

    A dictionary has the keys of scene files (``abbe keys`` prints them); files it names are looked
    for in ``folder``.

    Raises SceneError, with all problems and their places.
    """
    if isinstance(source, Mapping):
        text = _toml.document(source)
        return Scene(_abbe.Scene.from_text(text, os.fspath(folder), []))
    return Scene(_abbe.Scene.from_file(os.fspath(source), []))
