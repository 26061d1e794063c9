"""Without dm-control, as pip leaves it on Python 3.13, the first start says in one line what to type."""

from __future__ import annotations

import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import mathnavi.models.dm_control_requirement as requirement
from mathnavi.commands.cli import main

ROOT = Path(__file__).resolve().parents[2]
WITHOUT = """
import importlib.abc, sys
class Hidden(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name.partition(".")[0] == "dm_control":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Hidden())
import importlib.util
importlib.util.find_spec = lambda name: None if name == "dm_control" else object()
"""
USES = {
    "script": "import mathnavi as mn; mn.run('safe-flight')",
    "environment": "import gymnasium, mathnavi.sim.environments; gymnasium.make('mathnavi/SafeFlight-v1')",
    "module": "import mathnavi.models.aerial.entity",
}


def wanted() -> Requirement:
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    (found,) = [each.partition(";")[0] for each in listed if each.startswith("dm-control")]
    return Requirement(found)


@pytest.fixture
def hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(requirement, "find_spec", lambda name: None if name == "dm_control" else object())


@pytest.mark.usefixtures("hidden")
@pytest.mark.parametrize("words", [["list"], ["run", "safe-flight"], ["study", "cost-to-go", "--quick"]])
def test_every_command_says_what_to_type(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "dm-control is not installed" in line
    command = shlex.split(line.partition("type: ")[2].partition(" (")[0])
    assert command[:-1] == ["python", "-m", "pip", "install", "--no-deps"]
    assert Requirement(command[-1]) == wanted()


@pytest.mark.usefixtures("hidden")
def test_help_needs_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    assert "mathnavi COMMAND" in capsys.readouterr().out


@pytest.mark.parametrize("use", USES)
def test_python_says_it_too(use: str) -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT + USES[use]], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    last = done.stderr.strip().splitlines()[-1]
    assert "MissingPackageError: dm-control is not installed; type: python -m pip install --no-deps" in last
