"""The picture of the sources is what the program draws from them, and no modules import each other in a circle."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

PROGRAM = Path(__file__).resolve().parents[2] / "docs" / "draw_house.py"


@pytest.fixture(scope="module")
def program() -> ModuleType:
    spec = importlib.util.spec_from_file_location("draw_house", PROGRAM)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_no_modules_import_each_other_in_a_circle_and_the_committed_picture_is_the_present_one(
    program: ModuleType,
) -> None:
    arrows, loops = program.house()
    assert loops == []
    assert program.PICTURE.read_text(encoding="utf-8") == program.drawn(arrows, loops), "python docs/draw_house.py"


def test_circles_are_found(program: ModuleType) -> None:
    graph = {"a": {"b"}, "b": {"c"}, "c": {"a", "d"}, "d": set(), "e": {"d"}}
    assert program.circles(graph) == [["a", "b", "c"]]
    assert program.reduced({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == {"a": {"b"}, "b": {"c"}, "c": set()}
