"""``mathnavi completion``: its candidates are what the command line takes, and the shells show them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mathnavi.sim.commands.arguments import flags
from mathnavi.sim.commands.cli import main
from mathnavi.sim.commands.completion import FLOWN, OWN, SCRIPTS, candidates, flags_of
from mathnavi.sim.commands.known import COMMANDS
from mathnavi.sim.plugin.registry import load, names
from mathnavi.sim.plugin.sources import definition, installed

CONFIGURED = [(kind, name) for kind in ("scenarios", "controllers", "estimators", "studies") for name in names(kind)]
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


@pytest.mark.parametrize(("kind", "name"), CONFIGURED)
def test_every_flag_of_a_plugin_is_completed_and_no_other(kind: str, name: str) -> None:
    place = next(point for point in installed(kind) if point.name == name)
    config = load(kind, name).Config
    read = flags_of(definition(config.__module__, config.__qualname__), "planner")
    assert set(read) == {flag for flag, _ in flags(config, "planner")}, place


@pytest.mark.parametrize("place", sorted({place for places in OWN.values() for place in places}))
def test_every_flag_of_a_command_is_completed_and_no_other(place: str) -> None:
    module, _, name = place.partition(":")
    options = getattr(__import__(module, fromlist=[name]), name)
    assert set(flags_of(definition(module, name))) == {flag for flag, _ in flags(options)}


def test_commands_plugins_flags_and_values_are_completed() -> None:
    assert candidates([""]) == list(COMMANDS)
    for command in FLOWN:
        assert candidates([command, ""]) == list(names("scenarios"))
    assert candidates(["study", "a"]) == ["active-control", "arrival", "attitude", "all"]
    assert candidates(["run", "safe-flight", "--estimator", "quad"]) == ["quadrotor_state"]
    assert candidates(["run", "safe-flight", "--estimator", "=", "quad"]) == ["quadrotor_state"]  # as bash splits it
    assert candidates(["run", "safe-flight", "--planner.backend", ""]) == ["condensed", "ipopt", "fatrop"]
    assert "--planner.nodes" in candidates(["run", "safe-flight", "--planner."])
    chosen = ["run", "safe-flight", "--controller", "as_printed", "--planner."]
    assert set(candidates(chosen)) == {flag for flag, _ in flags(load("controllers", "as_printed").Config, "planner")}
    assert candidates(["run", "safe-flight", "--out", ""]) == []  # a folder is for the shell to complete


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
        ("mathnavi run safe-flight --terrain ", ["canyon", "jacksboro", "tian_shan"]),
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
