"""Only commands that succeed are measured, each compared with the same command of the earlier commit."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.start_up import ROOT, Case, StartUp, checked_out, start


def test_a_command_takes_time_and_a_failure_is_no_measurement(tmp_path: Path) -> None:
    wall, cpu = start(ROOT, ("--version",), tmp_path)
    assert 0.0 < cpu < 60.0
    assert wall > 0.0
    with pytest.raises(RuntimeError, match="nonsense"):
        start(ROOT, ("nonsense",), tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_code_of_the_tree_is_started_and_leaves_byte_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    commands = tmp_path / "src" / "mathnavi" / "commands"
    commands.mkdir(parents=True)
    (commands / "cli.py").write_text("def main():\n    return 7\n", encoding="utf-8")
    for package in (commands, commands.parent):
        (package / "__init__.py").touch()
    call = "import sys\nfrom mathnavi.commands.cli import main\nsys.exit(main())\n"
    (commands.parent / "__main__.py").write_text(call, encoding="utf-8")
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    for state, left in (("cold", 0), ("warm", 1)):
        with pytest.raises(RuntimeError, match="exit code 7"):
            start(tmp_path, ("--version",), tmp_path, state)
        assert len(list(commands.glob("__pycache__/cli.*.pyc"))) == left


def test_a_commit_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="before = 'nowhere'"), checked_out("nowhere", tmp_path):
        pass


def test_every_command_is_compared_with_that_of_the_commit() -> None:
    times = {Case("before", "list", "warm"): [4.0, 6.0, 5.0], Case("here", "list", "warm"): [0.5, 0.5, 0.5]}
    _, row = StartUp("abc1234", times, times).comparisons()
    assert (row.what, row.software, row.ratio) == ("list, warm", "ours at abc1234", 10.0)
    assert StartUp("", {Case("here", "list", "cold"): [0.5]}).comparisons() == []


@pytest.mark.parametrize(("wall", "holds"), [(0.4, True), (0.6, False)])
def test_a_command_with_a_goal_keeps_it_or_does_not(wall: float, holds: bool) -> None:
    (row,) = StartUp("", {Case("here", "list", "warm"): [wall]}).comparisons()
    assert (row.what, row.wanted, row.holds) == ("list, warm", "<= 1", holds)
