"""A stranger's drawing that raises, or ends the process, ends in one line that names it."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from mathnavi.commands.cli import main

MODULE = """
from dataclasses import replace
from mathnavi.renders.flight.drawing import drawing as flight

def fails(*_):
    {body}

drawing = replace(flight, **{{{call!r}: fails}})
"""
BODIES = ["raise KeyError('gone')", "raise SystemExit(0)", "raise type('Own', (BaseException,), {})('mine')"]


@pytest.fixture
def drawn_by(run_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], list[str]]:
    """Writes the module of a drawing into the current folder, and a run that names it; the words that render it."""
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    monkeypatch.chdir(tmp_path)

    def write(source: str) -> list[str]:
        name = f"drawing_{tmp_path.name}"
        Path(f"{name}.py").write_text(source)
        folder = shutil.copytree(run_dir, tmp_path / "run")
        config = json.loads((folder / "config.json").read_text())
        (folder / "config.json").write_text(json.dumps({**config, "drawing": name}))
        return ["render", "run", "--trust"]

    return write


@pytest.mark.parametrize("call", ["load_run", "shot_list", "highlight", "annotations"])
@pytest.mark.parametrize("body", BODIES)
def test_a_drawing_that_fails_is_named(
    body: str, call: str, drawn_by: Callable[[str], list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    words = drawn_by(MODULE.format(body=body, call=call))
    kinds = {"highlight": ["--clip"], "shot_list": []}
    assert main([*words, *kinds.get(call, ["--clip"])]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"{call}() failed: " in line
    assert ".py:6)" in line
    assert not list(Path("run").glob("*.mp4")) + list(Path("run").glob("*.webp"))


@pytest.mark.parametrize("body", [*BODIES, "raise ValueError('no')", "import gone_for_good", "drawing = 3", ""])
def test_a_drawing_that_cannot_be_imported_is_named(
    body: str, drawn_by: Callable[[str], list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(drawn_by(f"{body}\n")) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "drawing = 'drawing_" in line
