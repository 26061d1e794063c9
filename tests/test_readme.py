"""The README's Python is run as printed, and its commands exist."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest

from mathnavi.commands.cli import main

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")
COMMANDS = (Path(__file__).parent.parent / "docs" / "catalogue.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


@pytest.fixture
def shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Names of a script that has imported mathnavi, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec("import mathnavi as mn", names)
    return names


def test_five_lines_fly_a_scenario_and_read_arrays(shown: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    assert len([line for line in BLOCKS[0].splitlines() if line.strip()]) == 5
    exec(BLOCKS[0], shown)
    run = shown["run"]
    assert run.success
    assert run["truth.x"].shape == (len(run.t), 6)
    (line,) = capsys.readouterr().out.splitlines()[-1:]  # after the word of kernels that are compiled, on a new machine
    assert float(line.split()[0]) == run.summary["min_clearance_m"] >= 50.0
    assert {path.name for path in Path("flight").iterdir()} >= {"config.json", "log.npz", "summary.json"}
    assert "safe-flight" in Path("flight.html").read_text(encoding="utf-8")


def test_what_the_readme_makes_of_a_template_is_not_put_into_the_checkout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (words,) = [shlex.split(line, comments=True)[1:] for line in README.splitlines() if "mathnavi new vehicle" in line]
    checkout = tmp_path / "checkout"
    checkout.mkdir()
    monkeypatch.chdir(checkout)
    assert main(words) == 0
    assert not list(checkout.iterdir())
    assert (tmp_path / "rover" / "README.md").is_file()


@pytest.mark.parametrize(
    "command", ["run", "sweep", "store", "study", "render", "report", "new", "check", "terrain", "list"]
)
def test_every_command_of_the_catalogue_has_help(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert f"mathnavi {command}" in COMMANDS
    assert main([command, "--help"]) == 0
    assert capsys.readouterr().out
