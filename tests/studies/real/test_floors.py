"""Windows of a building's log: what is read of it, which windows can be measured, and what is found in them."""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from mathnavi.studies.real import floor_windows
from mathnavi.studies.real.drawings import moments
from mathnavi.studies.real.floor_logs import calibration, floor_of, sensor_log
from mathnavi.studies.real.floor_windows import BANK, estimated, mapped_share, windows_of
from tests.studies.real.logs import write_building


def test_steps_of_the_wheels_are_read_apart_from_the_poses_of_slam(tmp_path: Path) -> None:
    poses = write_building(tmp_path / "room.log", 2)
    floor = floor_of(tmp_path / "room.log")
    np.testing.assert_allclose(floor.poses, poses, atol=1e-6)
    found = calibration(floor, -2.0, -1.0)
    assert found.deviation[1] < 0.01
    log = sensor_log(floor, np.arange(5), np.array([3, 9]), found)
    np.testing.assert_allclose(log.readings["ranges"][-1], floor.ranges[4, [3, 9]])
    turned = np.diff(log.t, prepend=log.t[0]) @ log.readings["odometry"][:, 1]
    assert turned == pytest.approx(4.0 * math.tau / 16, rel=0.03)  # 5 % without a calibration


def test_no_scan_of_the_map_is_near_a_window_in_time(tmp_path: Path) -> None:
    write_building(tmp_path / "room.log", 8)
    windows = windows_of(str(tmp_path / "room.log"), "floor", 3, 40.0, 10.0)
    floor = floor_of(tmp_path / "room.log")
    assert len(windows) == 3
    for window in windows:
        t = floor.t[window.used(floor)]
        assert ((t < window.since - 10.0) | (t > window.since + 50.0)).all()
        assert (floor.t[window.rows(floor)] >= window.since).all()
    assert all(one.since + 40.0 <= other.since for one, other in pairwise(windows))


def test_a_place_that_no_other_scan_has_seen_has_no_window(tmp_path: Path) -> None:
    write_building(tmp_path / "room.log", 1)
    assert windows_of(str(tmp_path / "room.log"), "floor", 3, 20.0, 10.0) == []


def test_a_robot_is_found_in_a_window_that_its_map_does_not_have(tmp_path: Path) -> None:
    write_building(tmp_path / "room.log", 8)
    (window,) = windows_of(str(tmp_path / "room.log"), "room", 1, 40.0, 10.0)
    measured = estimated(window, 8, BANK)
    truth = floor_of(tmp_path / "room.log").poses[measured.rows]
    assert np.hypot(*(measured.found.x[measured.at] - truth)[-5:, :2].T).max() < 0.3


def test_a_map_is_judged_by_what_the_whole_laser_sees(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_building(tmp_path / "room.log", 8)
    (window,) = windows_of(str(tmp_path / "room.log"), "room", 1, 40.0, 10.0)
    before = mapped_share(window)
    assert before > 0.5
    floor = floor_of(tmp_path / "room.log")
    ranges = floor.ranges.copy()
    ranges[window.rows(floor)[-1], ::2] *= 0.5  # what stands there is on no other scan
    monkeypatch.setattr(floor_windows, "floor_of", lambda _: dataclasses.replace(floor, ranges=ranges))
    mapped_share.cache_clear()
    assert mapped_share(window) < 0.8 * before


def test_panels_are_those_where_poses_fall_away_and_the_last() -> None:
    hypotheses = np.full((6, 8, 3), np.nan)
    for k, count in enumerate((8, 8, 4, 4, 1, 1)):
        hypotheses[k, :count] = 0.0
    assert moments(hypotheses) == [0, 2, 4, 5]
