"""The README's Python is run as printed, and its commands exist."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from mathnavi.sim.commands.cli import main
from mathnavi.sim.records.store import Store

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


def test_six_lines_build_a_scenario_simulate_and_read_arrays(capsys: pytest.CaptureFixture[str]) -> None:
    assert len([line for line in BLOCKS[0].splitlines() if line.strip()]) == 6
    namespace: dict[str, Any] = {}
    exec(BLOCKS[0], namespace)
    outcome = namespace["outcome"]
    assert outcome.success
    assert outcome.arrays["truth.x"].shape == (len(outcome.arrays["t"]), 6)
    assert float(capsys.readouterr().out.split()[0]) == outcome.summary["min_clearance_m"] >= 50.0


def test_a_scenario_is_an_environment(capsys: pytest.CaptureFixture[str]) -> None:
    namespace: dict[str, Any] = {}
    exec(BLOCKS[1], namespace)
    assert float(capsys.readouterr().out.split()[0]) < 0.0
    assert namespace["first"].observation["x"].shape == (6,)


def test_a_problem_written_as_on_paper_is_solved_and_replayed(capsys: pytest.CaptureFixture[str]) -> None:
    exec(BLOCKS[2], {})
    for line, method in zip(capsys.readouterr().out.splitlines(), ("direct", "refinement"), strict=True):
        name, status, cost, miss, violation = line.split()
        assert (name, status) == (method, "OPTIMAL")
        assert float(cost) == pytest.approx(4.0, abs=1e-3)
        assert float(miss) < 1e-9
        assert float(violation) < 1e-4


def test_a_sweep_in_python_tells_its_rate_and_flies_nothing_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(BLOCKS[3], {})
    assert capsys.readouterr().out.startswith("0 of 6 (at most ")
    with Store.open("sweep.db") as store:
        assert len(store.keys()) == 6


@pytest.mark.parametrize("command", ["run", "sweep", "store", "study", "render", "terrain", "list"])
def test_every_command_that_the_readme_names_has_help(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert f"mathnavi {command}" in README
    assert main([command, "--help"]) == 0
    assert capsys.readouterr().out
