"""``mathnavi estimate`` over a log in a file: the estimates of ``mathnavi.estimate``, and what is refused."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.commands.cli import main

MISSION = """
import mathnavi as mn
from neighbour import wall

def mission():
    start = mn.KnownStart((1.0, 0.5, 0.3))
    return mn.RangingMission(wall, (0.0, 1.5), mn.RangeQuality(absolute=0.01), start=start, period=0.05)

nothing = None
"""
NEIGHBOUR = "import mathnavi as mn\nwall = mn.ellipse(3.0, 2.0)\n"
WORDS = ("--mission", "robot.py:mission", "--readings", "ranges=front,left", "odometry=v,w", "--time", "time")
FORMAT = ("--sep", ";", "--decimal", ",", "--units", "w=deg/s")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Folder with a log of 30 times, in the notation of half of Europe, whose last line is cut off."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "robot.py").write_text(MISSION)
    (tmp_path / "neighbour.py").write_text(NEIGHBOUR)
    wall, pose, lines = mn.ellipse(3.0, 2.0), np.array([1.0, 0.5, 0.3]), ["time [ms];front [mm];left [mm];v;w"]
    mission = mn.RangingMission(wall, (0.0, 1.5), period=0.05)
    for k in range(30):
        front, left = 1000.0 * wall.ranges(pose, (0.0, 1.5))[0]
        lines.append(f"{50 * k};{front};{left};0.4;{np.degrees(0.5)}".replace(".", ","))
        pose = mission.flow(pose, np.array([0.4, 0.5]), 0.05)
    (tmp_path / "log.csv").write_text("\n".join([*lines, "1500;16"]))
    yield tmp_path
    for name in ("neighbour", "robot", "rig"):  # else they belong to the version of the code of later sweeps
        sys.modules.pop(name, None)


RIG = """
from dataclasses import dataclass
import numpy as np
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.signals import Estimate, Status

@dataclass(frozen=True)
class Rig:
    period: float = 0.05

@dataclass(frozen=True)
class Ranges:
    name: str = "ranges"
    size: int = 2
    rate: float = 20.0
    def read(self, motion, rng):
        raise AssertionError

@configuration
class Nothing:
    pass

class Last:
    Config = Nothing

    @staticmethod
    def build(config, mission: Rig):
        return Last(mission)

    @staticmethod
    def sensors(config, mission):
        return (Ranges(),)

    @staticmethod
    def quality(config, mission):
        return None

    def __init__(self, mission):
        self.period = mission.period

    def update(self, t, measurements, command):
        return Estimate(t, np.zeros(1), None, Status.OK)

rig = Rig()
"""


def test_an_observer_and_its_mission_may_be_in_one_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Named as a module and as a file, it is one module: its class of missions is one class."""
    (folder / "rig.py").write_text(RIG)
    words = ("--mission", "rig.py:rig", "--readings", "ranges=front,left", "--time", "time", *FORMAT[:4])
    assert main(["estimate", "rig:Last", "log.csv", *words]) == 0, capsys.readouterr().err
    assert "rig:Last" in capsys.readouterr().out


@pytest.mark.honoured("CSV", "estimate from the command line")
def test_a_log_is_estimated_as_by_a_script(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["estimate", "range_iekf", "log.csv", *WORDS, *FORMAT, "--estimator.timeout", "0.4"]) == 0
    printed, said = capsys.readouterr()
    log = mn.SensorLog.from_csv(
        "log.csv", time="time", readings={"ranges": ["front", "left"], "odometry": ["v", "w"]}, sep=";", decimal=",",
        units={"w": "deg/s"},
    )  # fmt: skip
    mission = mn.RangingMission(
        mn.ellipse(3.0, 2.0), (0.0, 1.5), mn.RangeQuality(absolute=0.01), start=mn.KnownStart((1.0, 0.5, 0.3)),
        period=0.05,
    )  # fmt: skip
    found = mn.estimate("range_iekf", mission, log, timeout=0.4)
    assert printed == f"{found!r}\nestimates  log-range_iekf\n"
    assert "log.csv: line 32 is cut off and left out: '1500;16'" in said
    assert "log.csv: column 'front [mm]' was converted from mm" in said
    with np.load(folder / "log-range_iekf" / "estimates.npz") as arrays:
        np.testing.assert_array_equal(arrays["estimate.x"], found.x)
        np.testing.assert_array_equal(arrays["estimate.covariance"], found.covariance)
        np.testing.assert_array_equal(arrays["estimate.nis"], found.extra["nis"])
        assert arrays["estimate.status"].tolist() == [status.name for status in found.status]
    again = mn.SensorLog.from_csv(
        "log-range_iekf/estimates.csv",
        readings={"x": ["x [m]", "y [m]", "heading [rad]"], "deviation": ["deviation of heading"]},
    )
    np.testing.assert_array_equal(again.readings["x"], found.x)
    np.testing.assert_array_equal(again.readings["deviation"][:, 0], found.deviation[:, 2])
    np.testing.assert_array_equal(again.t, found.t)


def test_both_forms_are_in_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["estimate", "--help"]) == 0
    printed = capsys.readouterr().out
    assert "estimate ESTIMATOR DIR [OPTIONS]" in printed
    assert "estimate ESTIMATOR FILE --mission FILE.py:NAME" in printed
    assert main(["estimate", "range_iekf", "log.csv", "--help"]) == 0
    assert {"--sep", "--time-unit", "--estimator.timeout"} <= set(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (WORDS, "no column 'time'; it has time [ms];front [mm];left [mm];v;w; --sep ';', --decimal , allows it"),
        ((*WORDS, "--sep", ";", "--units", "w=deg/s"), "line 2, column 'front [mm]': '1676,"),
        ((*WORDS, *FORMAT, "--time-unit", "s"), "the median step is 50 s"),
        ((*WORDS, *FORMAT, "--time-unit", "s"), "or read the log with --time-unit ms"),
        ((*WORDS, "--sep", "ab"), "--sep = 'ab'; allowed"),
        ((*WORDS, *FORMAT, "--inputs", "v"), "inputs has 1 columns; allowed: 2"),
        ((*WORDS[:2], *FORMAT), "--readings is missing; allowed: SENSOR=COLUMNS..."),
        ((*WORDS[:2], "--readings", "ranges"), "--readings = ranges; allowed: NAME=VALUE"),
        ((*WORDS[:3], "ranges=v", *WORDS[5:], *FORMAT), "units names 'w', which is neither time, reading nor input"),
        ((), "--mission is missing; allowed: FILE.py:NAME"),
        (("--mission", "none.py:mission", *WORDS[2:]), "--mission = none.py is not there; allowed: FILE.py:NAME"),
        (("--mission", "robot.py:missing", *WORDS[2:]), "robot.py has no missing; did you mean mission?"),
        (("--mission", "robot", *WORDS[2:]), "--mission = 'robot' names no object; allowed: FILE.py:NAME"),
        (("--mission", "log.csv:mission", *WORDS[2:]), "log.csv cannot be imported"),
        (("--mission", "robot:nothing", *WORDS[2:], *FORMAT), "the mission is a NoneType"),
        ((*WORDS, *FORMAT, "--out", "log.csv"), "--out = log.csv"),
        ((*WORDS, "--trust"), "--trust is not a field"),
    ],
)  # fmt: skip
def test_bad_input_ends_in_one_line(
    words: tuple[str, ...], message: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["estimate", "range_iekf", "log.csv", *words]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("mathnavi: ")]
    assert len(lines) == 1
    assert message in lines[0]
    assert not (folder / "log-range_iekf").exists()


def test_an_estimator_that_was_never_right_is_a_failure(folder: Path) -> None:
    header, *rows = (folder / "log.csv").read_text().splitlines()[:31]
    cells = [row.split(";") for row in rows]
    (folder / "log.csv").write_text("\n".join([header, *(f"{t};;;{v};{w}" for t, _, _, v, w in cells)]) + "\n")
    assert main(["estimate", "range_iekf", "log.csv", *WORDS, *FORMAT]) == 1
    assert (folder / "log-range_iekf" / "estimates.csv").exists()
