"""For a help or a wrong word the index of plug-ins says what they say, and nothing heavy is imported."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from mathnavi.commands import cli, flown
from mathnavi.commands.errors import HelpPrinted
from mathnavi.commands.known import FLOWN, OPTIONS
from mathnavi.sim.plugin.groups import KINDS, installed
from mathnavi.sim.plugin.index import COMMAND, Index

Command = Callable[..., tuple[str, str, set[str]]]
HEAVY = {"mujoco", "numba", "numpy", "rich", "mathnavi.commands.run", "mine"}
CALL = f"""
import sys
from mathnavi.commands.cli import main
code = main()
sys.stderr.write(" ".join([str(code), *({HEAVY} & set(sys.modules))]))
"""
WRONG = ("--sped 1", "--seed 1 --seed 2", "--planner.nodes", "--start 1 2", "--help")
MINE = """
import os
from dataclasses import dataclass, field

@dataclass(frozen=True)
class Settings:
    gain: float = 1.0  # gain of the planner
    workers: int = field(default_factory=int)

class Mine:
    Config = Settings
    build = staticmethod(lambda config, mission: None)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where commands are called, with an index of their own beside it."""
    return tmp_path_factory.mktemp("called")


@pytest.fixture(scope="module")
def command(folder: Path) -> Command:
    """What a command prints and refuses, and the libraries that it has imported."""

    def called(*words: str) -> tuple[str, str, set[str]]:
        environment = {**os.environ, "XDG_CACHE_HOME": str(folder / "cache")}
        done = subprocess.run(
            [sys.executable, "-P", "-c", CALL, *words],
            cwd=folder, env=environment, capture_output=True, text=True, check=True,
        )  # fmt: skip
        *refused, last = done.stderr.splitlines(keepends=True)
        return done.stdout, "".join([*refused, last.split()[0]]), set(last.split()[1:])

    return called


def test_the_index_says_what_the_plugins_say(capsys: pytest.CaptureFixture[str]) -> None:
    own = [(COMMAND, EntryPoint(OPTIONS[command], OPTIONS[command], "")) for command in FLOWN]
    Index.read().describe(*own, *((kind, each) for kind in ("scenarios", *KINDS.values()) for each in installed(kind)))
    runs = [("run", point.name) for point in installed("scenarios")]
    for name, scenario in (*runs, ("search", "arm-velocity"), ("sweep", "arm-velocity")):
        with pytest.raises(HelpPrinted):
            flown.main(name, (scenario, "--help"), pytest.fail, whole_process=True)
        found = capsys.readouterr().out
        assert cli.main([name, scenario, "--help"]) == 0  # which may run beside other code, and imports the plug-ins
        assert capsys.readouterr().out == found


@pytest.fixture(scope="module")
def first(command: Command) -> tuple[str, str, set[str]]:
    """The first wrong word, after which the index holds what it was looked up in."""
    return command("run", "safe-flight", *WRONG[0].split())


@pytest.mark.parametrize("words", WRONG)
def test_the_second_wrong_word_imports_nothing(
    first: tuple[str, str, set[str]], command: Command, words: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert first[2] > {"mujoco", "numba"}
    code = cli.main(["run", "safe-flight", *words.split()])  # imports the plug-ins
    printed = capfd.readouterr()
    if words == WRONG[0]:
        assert first[:2] == (printed.out, f"{printed.err}{code}")
    assert command("run", "safe-flight", *words.split()) == (printed.out, f"{printed.err}{code}", set())


def test_an_edited_plugin_has_a_new_help(command: Command, folder: Path) -> None:
    words = ("run", "safe-flight", "--controller", "mine:Mine", "--help")
    for before, after, printed, kept in (
        ("", "", "gain of the planner (default: 1.0)", True),
        ("gain of", "factor of", "factor of the planner (default: 1.0)", True),
        ("gain:", "factor:", "--planner.factor FLOAT", True),
        ("=int", '=lambda: len(os.environ["XDG_CACHE_HOME"])', "(default: {})", False),  # it depends on the machine
        ("    build", "    make", "'mine:Mine' has no build", False),
    ):
        (folder / "mine.py").write_text(MINE.replace(before, after))
        first, second = command(*words), command(*words)
        assert first[:2] == second[:2]
        assert printed.format(len(str(folder / "cache"))) in first[0] + first[1]
        assert "mine" in first[2]
        assert ("mine" in second[2]) == (not kept)
