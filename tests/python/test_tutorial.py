"""The code of docs/python.md, from top to bottom, as a reader would run it."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TUTORIAL = ROOT / "docs/python.md"


def test_the_tutorial_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for package in ("matplotlib", "colour", "pyoidn"):
        pytest.importorskip(package)
    text = TUTORIAL.read_text(encoding="utf-8")
    cells = [(m.start(), m[1]) for m in re.finditer(r"```python\n(.*?)```", text, re.DOTALL)]
    assert len(cells) >= 8
    # what it writes goes elsewhere
    shutil.copytree(ROOT / "scenes", tmp_path / "scenes", ignore=shutil.ignore_patterns("gallery", "bench"))
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for start, code in cells:
        # lines of a traceback are those of the page
        before = text[:start].count("\n") + 1
        exec(compile("\n" * before + code, str(TUTORIAL), "exec"), names)
    assert {"prism.exr", "prism.png", "error.png"} <= set(os.listdir(tmp_path))
