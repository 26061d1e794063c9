"""The README's Python is run as printed, and its commands exist."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mathnavi.sim.commands.cli import main
from mathnavi.sim.records.store import Store

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


@pytest.fixture
def shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Names of a script that has imported mathnavi, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec("import mathnavi as mn", names)
    return names


def test_six_lines_fly_a_scenario_and_read_arrays(shown: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    assert len([line for line in BLOCKS[0].splitlines() if line.strip()]) == 6
    exec(BLOCKS[0], shown)
    run = shown["run"]
    assert run.success
    assert run["truth.x"].shape == (len(run.t), 6)
    (line,) = capsys.readouterr().out.splitlines()[-1:]  # after the word of kernels that are compiled, on a new machine
    assert float(line.split()[0]) == run.summary["min_clearance_m"] >= 50.0
    assert {path.name for path in Path("flight").iterdir()} >= {"config.json", "log.npz", "summary.json"}
    assert "safe-flight" in Path("flight.html").read_text(encoding="utf-8")


def test_a_plan_is_made_and_certified(shown: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    exec(BLOCKS[1], shown)
    arrival, clearance = map(float, capsys.readouterr().out.split()[:2])
    assert arrival < shown["plan"].duration
    assert 50.0 <= clearance < 90.0
    assert not shown["mn"].certify(shown["plan"], "jacksboro", clearance_min=90.0)


def test_a_velocity_is_observed(shown: dict[str, Any]) -> None:
    exec(BLOCKS[2], shown)
    t = shown["t"]
    np.testing.assert_allclose(shown["estimate"].velocity, [-np.sin(t), np.cos(t), 0.0, 0.0], atol=0.02)


def test_a_problem_written_as_on_paper_is_solved_and_replayed(
    shown: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    exec(BLOCKS[3], shown)
    method, status, cost, miss, violation = capsys.readouterr().out.split()
    assert (method, status) == ("hp", "OPTIMAL")
    assert float(cost) == pytest.approx(4.0, abs=1e-6)
    assert max(float(miss), float(violation)) < 1e-6


def test_a_scenario_is_an_environment(shown: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    exec(BLOCKS[4], shown)
    assert float(capsys.readouterr().out.split()[0]) < 0.0
    assert shown["first"].observation["x"].shape == (6,)


def test_a_sweep_in_python_tells_its_rate_and_flies_nothing_twice(
    shown: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    exec(BLOCKS[5], shown)
    assert capsys.readouterr().out.startswith("0 of 6 (at most ")
    with Store.open("sweep.db") as store:
        assert len(store.keys()) == 6


@pytest.mark.parametrize("command", ["run", "sweep", "store", "study", "render", "terrain", "list"])
def test_every_command_that_the_readme_names_has_help(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert f"mathnavi {command}" in README
    assert main([command, "--help"]) == 0
    assert capsys.readouterr().out
