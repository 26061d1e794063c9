"""What nothing foresaw ends in one line, exit code 70 and a file with the traceback."""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace

import pytest

from mathnavi.commands import cli
from mathnavi.commands.errors import BadInputError, one_line
from mathnavi.commands.unforeseen import DEVELOPERS

Ending = Callable[[BaseException], tuple[int, str]]


@pytest.fixture
def ended(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Ending:
    """Exit code and standard error of a command that raises."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.delenv(DEVELOPERS, raising=False)

    def end(error: BaseException) -> tuple[int, str]:
        def command(argv: Sequence[str]) -> int:
            raise error

        monkeypatch.setitem(sys.modules, "raising", SimpleNamespace(main=command))  # type: ignore[arg-type]
        monkeypatch.setitem(cli.COMMANDS, "raise", ("raising", ""))
        return cli.main(["raise", "--flag", "a value\udcff"]), capsys.readouterr().err

    return end


def written(folder: Path) -> str:
    (file,) = folder.iterdir()
    return file.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (KeyError("planner"), "KeyError: 'planner'"),
        (ValueError("two\nlines\x1b[31m"), r"ValueError: two lines\x1b[31m"),
        (OSError(22, "Invalid argument"), "OSError: [Errno 22] Invalid argument"),
        (MemoryError(), "the memory of this machine does not suffice"),
        (RecursionError("maximum recursion depth exceeded"), "nested too deeply"),
        (BrokenPipeError(32, "Broken pipe"), "BrokenPipeError"),  # of a child process: standard output is whole
    ],
)
def test_one_line_and_a_file_with_the_traceback(ended: Ending, tmp_path: Path, error: Exception, said: str) -> None:
    code, line = ended(error)
    assert code == 70
    assert len(line.splitlines()) == 1
    assert line.startswith("mathnavi: an error that was not foreseen, ")
    assert said in line
    assert str(tmp_path) in line
    text = written(tmp_path)
    assert "Traceback" in text
    assert type(error).__name__ in text
    assert r"'a value\udcff'" in text


def test_without_room_for_the_file_the_line_says_so(
    ended: Ending, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "gone"))
    code, line = ended(KeyError("planner"))
    assert code == 70
    assert "cannot be written (No such file or directory)" in line
    assert f"{DEVELOPERS}=1" in line


def test_developers_see_the_traceback(ended: Ending, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(DEVELOPERS, "1")
    with pytest.raises(KeyError, match="planner"):
        ended(KeyError("planner"))
    assert not list(tmp_path.iterdir())


def test_interruption_exit_and_bad_input_are_no_such_errors(ended: Ending, tmp_path: Path) -> None:
    again = "nothing was written; to begin again: mathnavi raise --flag"
    code, line = ended(KeyboardInterrupt())
    assert (code, line.startswith(f"mathnavi: interrupted, {again}")) == (130, True)
    assert ended(OSError(28, "No space left on device", "log")) == (1, "mathnavi: log: No space left on device\n")
    assert ended(BadInputError("seed = -1")) == (2, "mathnavi: seed = -1\n")
    code, line = ended(SystemExit(3))  # of a plug-in
    assert (code, "SystemExit" in line) == (2, True)
    assert not list(tmp_path.iterdir())


def test_a_very_long_message_loses_its_middle() -> None:
    line = one_line("value = " + "9" * 100_000 + "; allowed: less")
    assert len(line) < 2100
    assert re.fullmatch(r"value = 9+ \.\.\. 9+; allowed: less", line)


def test_a_standard_output_that_is_closed_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    assert cli.main(["list", "terrains"]) == 0
