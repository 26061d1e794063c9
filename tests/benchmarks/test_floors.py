"""The benchmark of real floors: what it says without a log, what it reads of one, and what it finds in it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import mathnavi as mn
from benchmarks.floor_picture import moments
from benchmarks.floors import FloorArguments, calibration, floor_of, main, sensor_log
from mathnavi.interfaces.signals import Array

ROOM = mn.Polygon((((0, 0), (9, 0), (9, 4), (6, 4), (6, 7), (0, 7)), ((2, 2), (3, 2), (3, 3.5), (2, 3))))
ANGLES = np.radians(np.arange(-90.0, 90.0, 9.0))
MISREAD = 1.05  # of a turn by the wheels


def write_log(file: Path, laps: int) -> Array:
    """A log of GMapping: a robot around a block, a scan each 2 s with the pose, and ODOM that goes on from there."""
    lines, poses, t = [], [], 0.0
    for k in range(16 * laps):
        at = k * math.tau / 16
        pose = np.array([2.5 + 1.8 * math.cos(at), 2.8 + 1.8 * math.sin(at), (at + 0.5 * math.pi) % math.tau])
        step = 3.6 * math.sin(math.pi / 16)
        if poses:  # ODOM at the end of the step: an arc, a little too much of a turn
            x, y, heading = poses[-1]
            lines.append(_odom(x + step * math.cos(heading + 0.196), y + step * math.sin(heading + 0.196),
                               heading + MISREAD * math.tau / 16, t))  # fmt: skip
        ranges = " ".join(f"{each:.4f}" for each in ROOM.ranges(pose, ANGLES)[0])
        words = " ".join(f"{each:.6f}" for each in pose)
        lines.append(f"FLASER {len(ANGLES)} {ranges} {words} {words} {t} host {t}")
        lines += [_odom(*np.round(pose, 6).tolist(), 0.0), "NEFF 9.5"]
        poses.append(np.round(pose, 6))
        t += 2.0
    file.write_text("\n".join(lines) + "\n")
    return np.array(poses)


def _odom(x: float, y: float, heading: float, t: float) -> str:
    return f"ODOM {x:.6f} {y:.6f} {heading:.6f} 0 0 0 {t} host {t}"


def test_a_log_that_is_absent_is_named_and_the_code_is_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(FloorArguments(tmp_path / "intel.log.gz")) == 1
    assert f"there is no {tmp_path / 'intel.log.gz'}" in capsys.readouterr().out


def test_steps_of_the_wheels_are_read_apart_from_the_poses_of_slam(tmp_path: Path) -> None:
    poses = write_log(tmp_path / "room.log", 2)
    floor = floor_of(tmp_path / "room.log")
    np.testing.assert_allclose(floor.poses, poses, atol=1e-6)
    found = calibration(floor, -2.0, -1.0)
    assert found.deviation[1] < 0.01
    log = sensor_log(floor, np.arange(5), np.array([3, 9]), found)
    np.testing.assert_allclose(log.readings["ranges"][-1], floor.ranges[4, [3, 9]])
    turned = np.diff(log.t, prepend=log.t[0]) @ log.readings["odometry"][:, 1]
    assert turned == pytest.approx(4.0 * math.tau / 16, rel=0.03)  # 5 % without a calibration


def test_a_robot_is_found_in_a_window_that_its_map_does_not_have(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_log(tmp_path / "room.log", 8)
    picture = tmp_path / "room.png"
    options = FloorArguments(tmp_path / "room.log", windows=1, seconds=40.0, apart=10.0, picture=picture)
    assert main(options) == 0
    assert "found 1 of 1 windows" in capsys.readouterr().out
    assert picture.stat().st_size > 10_000


def test_panels_are_those_where_poses_fall_away_and_the_last() -> None:
    hypotheses = np.full((6, 8, 3), np.nan)
    for k, count in enumerate((8, 8, 4, 4, 1, 1)):
        hypotheses[k, :count] = 0.0
    assert moments(hypotheses) == [0, 2, 4, 5]
