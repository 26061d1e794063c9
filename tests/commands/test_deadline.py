"""``--wall-deadline`` ends a command that does not end, and says of one that dies what it was at."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from mathnavi.commands import deadline
from mathnavi.commands.cli import main
from mathnavi.commands.deadline import being_run, watch

PLUGIN = """
import ctypes, os, sys, time

def spin(argv):
    while True:
        pass

def sleep_in_machine_code(argv):
    ctypes.pythonapi.sleep(1000)  # and keeps the lock of the interpreter

def abort(argv):
    os.abort()

def crash(argv):
    ctypes.string_at(0)

def leave(argv):
    os._exit(0)

def end(argv):
    print("the words were", *argv)
    return 1
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    name = f"endless_{tmp_path.name}"
    (tmp_path / f"{name}.py").write_text(PLUGIN)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    return name


def line_of(function: str) -> int:
    lines = PLUGIN.splitlines()
    begin = next(k for k, line in enumerate(lines) if line.startswith(f"def {function}("))
    return begin + 2


@pytest.mark.parametrize("function", ["spin", "sleep_in_machine_code"])
def test_what_does_not_end_is_ended(module: str, function: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert watch(f"{module}:{function}", ["run", "a b"], 0.5) == 124
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith("mathnavi: --wall-deadline = 0.5: no end of `mathnavi run 'a b'` within 0.5 s, in ")
    assert f"{module}.py:" in line
    assert line.endswith(function)


@pytest.mark.parametrize(("function", "code", "name"), [("abort", 134, "SIGABRT"), ("crash", 139, "SIGSEGV")])
def test_a_crash_is_reported(
    module: str, function: str, code: int, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert watch(f"{module}:{function}", ["run"], 60.0) == code
    (line,) = capfd.readouterr().err.splitlines()
    assert f"was killed by {name}, in " in line
    assert f"{module}.py:{line_of(function)} {function}" in line


def test_a_process_that_leaves_has_not_succeeded(module: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert watch(f"{module}:leave", ["run"], 60.0) == 2
    assert "ended itself with exit code 0" in capfd.readouterr().err


def test_what_ends_in_time_has_its_own_exit_code(module: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert watch(f"{module}:end", ["a b", "$x"], 60.0) == 1
    said = capfd.readouterr()
    assert (said.out, said.err) == ("the words were a b $x\n", "")


@pytest.mark.parametrize("command", [["run", "safe-flight"], ["render", "there"], ["report", "there"]])
@pytest.mark.parametrize("value", ["0", "-1", "nan", "inf", "soon", ""])
def test_a_time_that_is_none_is_refused(
    command: list[str], value: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([*command, f"--wall-deadline={value}"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_the_commands_run_in_a_process_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    watched: list[tuple[str, list[str], float]] = []
    monkeypatch.setattr(deadline, "watch", lambda *arguments: watched.append(arguments) or 7)
    for command in (
        ["run", "safe-flight", "--seed", "3"], ["estimate", "kalman", "there"], ["render", "there"], ["report", "there"]
    ):  # fmt: skip
        for flag in (["--wall-deadline", "5"], ["--wall_deadline=5"]):
            assert main([*command, *flag]) == 7
            assert watched.pop() == ("mathnavi.commands.cli:main", command, 5.0)


def test_the_stack_of_the_code_that_was_called_is_read() -> None:
    own = str(deadline.PACKAGE / "sim" / "plugin" / "registry.py")
    report = (
        'Timeout (0:00:01)!\nThread 0x0001 (most recent call first):\n  File "/elsewhere.py", line 1 in wait\n\n'
        'Thread 0x0002 (most recent call first):\n  File "/lib/numpy.py", line 5 in solve\n'
        '  File "/mine.py", line 7 in plan\n  File "<frozen importlib._bootstrap>", line 241 in _call\n'
        f'  File "{own}", line 3 in load\n  File "/start.py", line 1 in <module>\n'
    )
    assert being_run(report) == ", in /mine.py:7 plan"
    assert being_run(f'Current thread 0x1 (most recent call first):\n  File "{own}", line 3 in load\n') == (
        f", in {own}:3 load"
    )
    assert being_run("Timeout (0:00:01)!\n") == ""
