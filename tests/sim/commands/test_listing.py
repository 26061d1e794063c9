"""``mathnavi list``: what it says without importing is what the plug-ins say, and the broken ones are told."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from rich.console import Console

from mathnavi.sim.commands.cli import main
from mathnavi.sim.commands.listing import listing
from mathnavi.sim.plugin.sources import GROUPS, UnreadableError, config_fields, definition, installed

POINTS = [(kind, point) for kind in GROUPS for point in installed(kind)]

STRANGE = '''
"""A stranger's module; at its left edge a docstring may say
class Wanted of anything.
"""
from dataclasses import dataclass, field
from typing import ClassVar

from .base import Fields
from .base import Fields as Renamed

import a_library_that_is_not_installed

@dataclass(frozen=True)
class Own(Renamed):
    """Fields."""
    kind: ClassVar[str] = "strange"
    third: int = 3
    first: float = 2.0

class Wanted:
    """It plans.

    And says more."""
    Config = Own

Another = Wanted
made = type("made", (), {})
'''


@pytest.fixture
def strange(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A package that cannot be imported but read."""
    package = tmp_path / "strange_package"
    package.mkdir()
    (package / "__init__.py").write_text("raise RuntimeError('imported')")
    (package / "base.py").write_text("class Fields:\n    first: float = 1.0\n    second: str = ''\n")
    (package / "plugin.py").write_text(STRANGE)
    monkeypatch.syspath_prepend(str(tmp_path))
    return "strange_package.plugin"


def shown(kind: str, *points: EntryPoint, full: bool = False) -> str:
    console = Console(width=200, no_color=True)
    with console.capture() as said:
        console.print(listing(kind, points, full))
    return said.get()


@pytest.mark.parametrize(("kind", "point"), POINTS, ids=lambda each: getattr(each, "name", each))
def test_what_is_read_is_what_is_imported(kind: str, point: EntryPoint) -> None:
    plugin, read = point.load(), definition(point.module, point.attr)
    assert read.first_line == plugin.__doc__.strip().partition("\n")[0]
    config = getattr(plugin, "Config", None)
    fields = [field.name for field in dataclasses.fields(config)] if config else []
    assert [field.name for field in config_fields(read)] == fields


def test_nothing_that_is_read_is_imported(strange: str) -> None:
    for name in ("Wanted", "Another"):
        read = definition(strange, name)
        assert read.first_line == "It plans."
        assert [field.name for field in config_fields(read)] == ["first", "second", "third"]
    assert "--planner: first, second, third" in shown("controllers", EntryPoint("odd", f"{strange}:Wanted", "g"))
    assert not [name for name in sys.modules if name.startswith("strange_package")]


def test_what_the_source_does_not_tell_is_imported(strange: str) -> None:
    with pytest.raises(UnreadableError):
        definition(strange, "made")
    assert "cannot be imported: imported" in shown("controllers", EntryPoint("odd", f"{strange}:made", "g"))


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize(
    ("place", "told"),
    [
        ("no_such_package.planner:Planner", "No module named 'no_such_package'"),
        ("mathnavi.sim.no_such_module:Planner", "No module named 'mathnavi.sim.no_such_module'"),
        ("mathnavi.sim.interfaces.checks:Planner", "has no attribute 'Planner'"),
    ],
)
def test_a_broken_plugin_is_told_and_hides_no_other(place: str, told: str, full: bool) -> None:
    said = shown("terrains", EntryPoint("broken", place, "g"), *installed("terrains"), full=full)
    assert f"cannot be imported: {told}" in " ".join(said.split()) or told in " ".join(said.split())
    assert "jacksboro" in said


def test_the_list_imports_neither_numbers_nor_physics() -> None:
    script = (
        "import sys; from mathnavi.sim.commands.cli import main; assert main(['list']) == 0;"
        "assert not {'numpy', 'mujoco', 'tyro', 'controllers'} & set(sys.modules), sys.modules.keys()"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "cannot be imported" not in done.stdout


def test_with_full_estimators_say_what_they_claim(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    assert main(["list", "estimators"]) == 0
    assert "Table 2.1" not in capsys.readouterr().out
    assert main(["list", "estimators", "--full"]) == 0
    said = capsys.readouterr().out
    assert "Table 2.1" in said
    assert "semi-global" in said


@pytest.mark.parametrize("words", [["planets"], ["terrains", "studies"], ["--all"]])
def test_what_list_does_not_know_is_told_in_one_line(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", *words]) == 2
    said = capsys.readouterr().err
    assert words[-1] in said
    assert "allowed: " in said
    assert said.count("\n") == 1
