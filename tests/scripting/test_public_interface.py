"""``import mathnavi``: quick, whole, and the same to an interpreter, to a type checker and to a reader."""

from __future__ import annotations

import ast
import importlib
import importlib.metadata
import os
import subprocess
import sys
from pathlib import Path

import pytest

import mathnavi as mn
from tests.renders.drawn import needs_opengl

SOURCE = Path(mn.__file__)
HEAVY = ("numpy", "mujoco", "casadi", "matplotlib", "numba")


def typed() -> dict[str, str]:
    """Imports of the TYPE_CHECKING block: "module:name" by the name that it has here."""
    tree = ast.parse(SOURCE.read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"]
    return {
        alias.asname or alias.name: f"{node.module}:{alias.name}"
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def test_the_table_the_list_and_the_types_agree() -> None:
    places = {}
    for name, place in mn._PLACES.items():
        module, _, inside = place.partition(":")
        places[name] = f"mathnavi.{module}:{inside or name}"
    assert typed() == places
    assert mn.__all__ == list(mn._PLACES)
    assert set(mn.__all__) < set(dir(mn))


@pytest.mark.parametrize("name", mn.__all__)
def test_every_name_is_there_and_says_what_it_is(name: str) -> None:
    module, _, inside = mn._PLACES[name].partition(":")
    value = getattr(importlib.import_module(f"mathnavi.{module}"), inside or name)
    assert getattr(mn, name) is value
    assert value.__doc__


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'fly'"):
        _ = mn.fly


def test_its_import_loads_no_library_that_takes_long() -> None:
    script = f"import sys, mathnavi; print([name for name in {HEAVY} if name in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", script], text=True).strip() == "[]"


def test_the_version_is_the_installed_one() -> None:
    assert mn.__version__ == importlib.metadata.version("mathnavi")


@needs_opengl
def test_whoever_uses_a_name_can_draw_later_in_the_same_process() -> None:
    """MuJoCo looks for OpenGL when it is imported, which any of the names may do."""
    script = (
        "import mathnavi as mn; mn.MechanismSystem; import mujoco;"
        "model = mujoco.MjModel.from_xml_string('<mujoco/>'); renderer = mujoco.Renderer(model, 8, 8);"
        "renderer.update_scene(mujoco.MjData(model)); print(renderer.render().shape); renderer.close()"
    )
    environment = {name: value for name, value in os.environ.items() if name not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")}
    drawn = subprocess.check_output([sys.executable, "-c", script], text=True, env=environment)
    assert drawn.strip() == "(8, 8, 3)"
