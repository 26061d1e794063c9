"""``mathnavi log show``."""

from __future__ import annotations

from pathlib import Path

import pytest

from mathnavi.commands.cli import main


@pytest.fixture
def table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    lines = [f"{t};{v};7,5" for t, v in ((0, 1), (10, 2), (40, 2), (30, 2), (30, 3))]
    Path("robot.csv").write_text("\n".join(["ms;v [km/h];stuck", *lines, ""]))
    return Path("robot.csv")


def test_it_says_what_is_irregular_and_what_the_numbers_are(table: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["log", "show", "robot.csv", "--sep", ";", "--decimal", ",", "--time", "ms", "--time-unit", "ms"]) == 0
    said = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert said[:4] == [
        "robot.csv: table",
        "clock column 'ms'; 0.04 s",
        "note column 'ms' was converted from ms, 1 ms = 0.001 s",
        "note column 'v [km/h]' was converted from km/h, 1 km/h = 0.277778 m/s",
    ]
    assert "table 5 0 0.04 100 4.5 2 1 1" in said
    assert "table: reading 3 is late, at 0.03 s after 0.04 s" in said
    assert "table: 1 gap of more than 1.5 periods, the longest 0.02 s, from 0.01 s on" in said
    assert "stuck 7.5 7.5 7.5 - 0.04 0" in said
    assert "v m/s 0.2778 0.5556 0.8333 - 0.02 0.01" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("log", "log: no command; allowed: show"),
        ("log list", "log list: not a command; allowed: show"),
        ("log show", "FILE is missing; allowed: a log, before the flags"),
        ("log show --sep ;", "FILE is missing; allowed: a log, before the flags"),
        ("log show nothing.csv", "nothing.csv does not exist"),
        ("log show .", ". is of no format that is known; allowed with --format NAME: "),
        ("log show robot.csv --format ros2", "logs: 'ros2' is not known; did you mean ros?"),
        ("log show robot.csv --format", "--format"),
        ("log show robot.csv --rate 3", "--rate is not a field of 'mathnavi log show'"),
        ("log show robot.csv", "robot.csv: there is no column 't'; it has ms;v [km/h];stuck"),
        ("log show robot.csv --time ms", "--sep ';', --decimal , allows it"),
        ("log show robot.csv --format carmen", "robot.csv: no message of CARMEN that is known"),
        ("log show robot.csv --format matlab", "robot.csv: not a readable MATLAB file"),
    ],
)
def test_what_cannot_be_shown_is_one_line(
    words: str, said: str, table: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words.split()) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("mathnavi: ")
    assert said in line


def test_help_is_that_of_the_format(table: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words, flag in (("--help", "--sep"), ("robot.csv --help", "--sep"), ("x.mat --format matlab --help", "--rate")):
        assert main(["log", "show", *words.split()]) == 0
        assert flag in capsys.readouterr().out
    assert main(["log", "--help"]) == 0
    assert "carmen" in capsys.readouterr().out


def test_names_between_colons_are_no_pictures(table: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A console that knows emoji shows a car in place of the middle of this name."""
    table.rename("a:car:b.csv")
    assert (
        main(["log", "show", "a:car:b.csv", "--sep", ";", "--decimal", ",", "--time", "ms", "--time-unit", "ms"]) == 0
    )
    assert capsys.readouterr().out.startswith("a:car:b.csv: table")
