"""``mathnavi list``: it imports nothing itself, and names plug-ins that are broken."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import EntryPoint

import pytest
from rich.console import Console

from mathnavi.commands.cli import main
from mathnavi.commands.listing import listing
from mathnavi.sim.plugin.groups import installed


def shown(kind: str, *points: EntryPoint, full: bool = False, verbose: bool = False) -> str:
    console = Console(width=200, no_color=True)
    with console.capture() as said:
        console.print(listing(kind, points, full, verbose))
    return said.get()


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize(
    ("place", "expected"),
    [
        ("no_such_package.planner:Planner", "No module named 'no_such_package'"),
        ("mathnavi.sim.no_such_module:Planner", "No module named 'mathnavi.sim.no_such_module'"),
        ("mathnavi.interfaces.checks:Planner", "has no attribute 'Planner'"),
    ],
)
def test_a_broken_plugin_is_reported_and_hides_no_other(place: str, expected: str, full: bool) -> None:
    said = shown("terrains", EntryPoint("broken", place, "g"), *installed("terrains"), full=full)
    assert f"cannot be imported: {expected}" in " ".join(said.split()) or expected in " ".join(said.split())
    assert "jacksboro" in said


def test_fields_and_modules_are_shown_when_asked_for() -> None:
    points = installed("controllers")
    lines = shown("controllers", *points).splitlines()
    assert len(lines) == len(points) + 1  # the title
    assert not any("mathnavi" in line or "--planner" in line for line in lines)
    said = shown("controllers", *points, verbose=True)
    assert "mathnavi.controllers.flight.plugin:" in said
    assert "--planner: " in said


def test_the_list_imports_neither_numbers_nor_physics() -> None:
    script = (
        "import sys; from mathnavi.commands.cli import main; assert main(['list']) == 0;"
        "assert not {'numpy', 'mujoco', 'msgspec', 'mathnavi.controllers'} & set(sys.modules), sys.modules.keys()"
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
def test_what_list_does_not_know_is_refused_in_one_line(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", *words]) == 2
    said = capsys.readouterr().err
    assert words[-1] in said
    assert "allowed: " in said
    assert said.count("\n") == 1
