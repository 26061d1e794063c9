"""``mathnavi completion``: its candidates are what the command line takes, and the shells show them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from mathnavi.commands.arguments import flags
from mathnavi.commands.cli import main
from mathnavi.commands.completion import COMMON, SCRIPTS, candidates, flags_of, plugin
from mathnavi.commands.known import COMMANDS, FLOWN, OPTIONS
from mathnavi.sim.plugin.groups import PREFIXES
from mathnavi.sim.plugin.index import COMMAND, Index, Point
from mathnavi.sim.plugin.registry import load, names, point_of

PLACES = sorted({*OPTIONS.values(), COMMON})
CONFIGURED = [(kind, name) for kind in ("scenarios", "controllers", "estimators", "studies") for name in names(kind)]
MINE = """
from dataclasses import dataclass

@dataclass(frozen=True)
class Settings:
    gain: float = 1.0
    fast: bool = False

class Mine:
    Config = Settings
"""
ASKED = {
    "bash": """
        eval "$(mathnavi completion bash)"
        COMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))
        _mathnavi mathnavi; printf '%s\\n' "${{COMPREPLY[@]}}" """,
    "zsh": """
        function compdef() {{ }}; function compadd() {{ print -l -- "${{(@)found}}" }}
        eval "$(mathnavi completion zsh)"
        words=({words}); CURRENT=$#words; _mathnavi""",
    "fish": """mathnavi completion fish | source; complete -C "{line}" """,
}


@pytest.fixture(scope="module")
def index() -> Index:
    """Index of every command's flags and of every plug-in with fields, found by one process."""
    index = Index.read()
    index.describe(*map(options, PLACES), *((kind, point_of(kind, name)) for kind, name in CONFIGURED))
    return index


def options(place: str) -> Point:
    return COMMAND, EntryPoint(place, place, "")


@pytest.mark.parametrize(("kind", "name"), CONFIGURED)
def test_every_flag_of_a_plugin_is_completed_and_no_other(kind: str, name: str, index: Index) -> None:
    found = flags_of(plugin(kind, name, index))
    assert set(found) == set(flags(load(kind, name).Config, PREFIXES.get(kind, "")))


@pytest.mark.parametrize("place", PLACES)
def test_every_flag_of_a_command_is_completed_and_no_other(place: str, index: Index) -> None:
    (described,) = index.describe(options(place))
    assert set(flags_of(described)) == set(flags(EntryPoint(place, place, "").load()))


def test_commands_plugins_flags_and_values_are_completed() -> None:
    assert candidates([""]) == list(COMMANDS)
    for command in FLOWN:
        assert candidates([command, ""]) == list(names("scenarios"))
    assert candidates(["study", "a"]) == ["active-control", "arrival", "as-printed-planner", "attitude", "all"]
    assert candidates(["run", "safe-flight", "--estimator", "quad"]) == ["quadrotor_state"]
    assert candidates(["run", "safe-flight", "--estimator", "=", "quad"]) == ["quadrotor_state"]  # as bash splits it
    assert candidates(["run", "safe-flight", "--planner.incorporation", ""]) == ["schedule", "constraint", "penalty"]
    assert "--planner.nodes" in candidates(["run", "safe-flight", "--planner."])
    chosen = ["run", "safe-flight", "--controller", "as_printed", "--planner."]
    assert set(candidates(chosen)) == set(flags(load("controllers", "as_printed").Config, "planner"))
    assert candidates(["new", "s"]) == ["scenario"]
    assert candidates(["run", "safe-flight", "--out", ""]) == []  # a folder is for the shell to complete


def test_the_fields_of_a_strangers_class_are_completed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my_own_planner.py").write_text(MINE)
    monkeypatch.chdir(tmp_path)
    words = ["run", "safe-flight", "--controller", "my_own_planner:Mine", "--planner."]
    assert candidates(words) == ["--planner.gain", "--planner.fast", "--planner.no-fast"]
    assert "my_own_planner" not in sys.modules


@pytest.mark.parametrize("words", [["no-such-command", ""], ["run", "no_such_module:Class", "--"], ["run", "x", "--"]])
def test_what_is_not_known_has_no_candidates_and_no_traceback(words: list[str]) -> None:
    assert candidates(words) == []


@pytest.mark.parametrize("shell", SCRIPTS)
def test_a_shell_completes(shell: str) -> None:
    program = shutil.which(shell)
    if program is None:
        pytest.skip(f"{shell} is not installed")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for line, expected in (
        ("mathnavi run safe-flight --faults.gust-r", ["--faults.gust-rms"]),
        ("mathnavi run safe-flight --terrain ", ["canyon", "jacksboro", "plain", "tian_shan"]),
    ):
        words = " ".join([*line.split(), *(["''"] if line.endswith(" ") else [])])
        script = ASKED[shell].format(words=words, line=line)
        done = subprocess.run(
            [program, "-c", script], capture_output=True, text=True, check=False, env=os.environ | {"PATH": path}
        )
        assert done.stdout.split() == expected, done.stderr


@pytest.mark.parametrize("words", [[], ["tcsh"], ["bash", "zsh"]])
def test_another_shell_is_refused_in_one_line(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", *words]) == 2
    assert "allowed: bash, zsh, fish" in capsys.readouterr().err
