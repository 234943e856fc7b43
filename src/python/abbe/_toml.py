"""TOML of Python values: what dictionaries become before they are read as scenes."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any


def _string(text: str) -> str:
    # strings of JSON are those of TOML but for the one control character that JSON leaves alone
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def value(of: Any) -> str:
    """A value as TOML on one line: numbers, strings, paths, booleans, lists, arrays, dictionaries."""
    if hasattr(of, "tolist") and not isinstance(of, (bool, int, float)):
        of = of.tolist()
    if isinstance(of, bool):
        return "true" if of else "false"
    if isinstance(of, (int, float)):
        return repr(of)
    if isinstance(of, str):
        return _string(of)
    if isinstance(of, os.PathLike):
        return _string(os.fspath(of))
    if isinstance(of, Mapping):
        entries = (f"{_string(str(key))} = {value(v)}" for key, v in of.items())
        return "{ " + ", ".join(entries) + " }"
    if isinstance(of, Sequence):
        return "[" + ", ".join(map(value, of)) + "]"
    raise TypeError(f"{type(of).__name__} has no place in a scene (allowed: numbers, strings, lists, dictionaries)")


def document(of: Mapping[str, Any]) -> str:
    """A dictionary as a TOML document, one line for each key or element of a list of tables."""
    lines = []
    for key, v in of.items():
        if isinstance(v, Sequence) and v and all(isinstance(item, Mapping) for item in v):
            rows = ",\n  ".join(map(value, v))
            lines.append(f"{_string(key)} = [\n  {rows},\n]")
        else:
            lines.append(f"{_string(key)} = {value(v)}")
    return "\n".join(lines) + "\n"
