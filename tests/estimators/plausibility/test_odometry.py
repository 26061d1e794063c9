"""Logs of ranges and odometry in other units and signs, and those that are right."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.plausibility.checks import FirstReadings
from mathnavi.interfaces.signals import Array

DT, WALL, ANGLES = 0.05, mn.ellipse(3.0, 2.0), (0.0, 1.2)
MISSION = mn.RangingMission(WALL, ANGLES, mn.RangeQuality(absolute=0.02), mn.OdometryQuality((0.02, 0.02)), period=DT)


@cache
def driven() -> tuple[Array, Array, Array]:
    """Times, ranges and odometry of a robot, with noise and lost rays."""
    rng, pose, ranges, odometry = np.random.default_rng(1), np.array([0.3, 0.2, 0.3]), [], []
    t, u = DT * np.arange(200), np.zeros(2)
    for time in t:
        ranges.append(WALL.ranges(pose, ANGLES)[0] + 0.02 * rng.standard_normal(2))
        odometry.append(u + 0.02 * rng.standard_normal(2))
        u = np.array([0.4 + 0.2 * np.sin(time), 0.7 + 0.4 * np.sin(0.5 * time)])
        pose = MISSION.flow(pose, u, DT)
    lost = rng.random((len(t), 2)) < 0.1
    return t, np.where(lost, np.nan, ranges), np.array(odometry)


@pytest.mark.refused("sensor log", "a turn rate in degrees per second, or clockwise")
@pytest.mark.refused("sensor log", "a speed in mm/s, or backwards")
@pytest.mark.refused("sensor log", "ranges in millimetres")
@pytest.mark.parametrize(
    ("speed", "turn_rate", "ranges", "expected"),
    [
        (1.0, 1.0, 1.0, ""),
        (
            1.0,
            180.0 / np.pi,
            1.0,
            "as deg/s in column 1 of odometry, the turn rate; allowed: rad/s: multiply by pi/180",
        ),
        (1.0, -1.0, 1.0, "with the other sign in column 1 of odometry"),
        (1e3, 1.0, 1.0, "as mm/s in column 0 of odometry, the speed; allowed: m/s"),
        (1.0, 1.0, 1e3, "as millimetres in ranges; allowed: metres"),
    ],
)
def test_units_and_signs_of_odometry_are_found_by_the_ranges(
    speed: float, turn_rate: float, ranges: float, expected: str
) -> None:
    t, measured, odometry = driven()
    log = mn.SensorLog(t, {"ranges": measured * ranges, "odometry": odometry * [speed, turn_rate]})
    if not expected:
        assert mn.estimate("range_ekf", MISSION, log).x.shape == (200, 3)
        return
    with pytest.raises(mn.LogError, match="the readings of ranges and odometry fit the wall only") as error:
        mn.estimate("range_ekf", MISSION, log)
    assert expected in str(error.value)


def test_a_robot_at_rest_rays_that_meet_nothing_and_few_readings_are_no_evidence() -> None:
    t, measured, odometry = driven()
    endless = np.where(np.arange(len(t))[:, None] % 5 == 0, np.inf, measured)
    seldom = np.where((np.arange(len(t)) % 60 == 0)[:, None], measured, np.nan)
    still = np.tile(measured[:1], (len(t), 1))
    for ranges, wheels in ((endless, odometry), (seldom, odometry), (still, 0.0 * odometry)):
        log = mn.SensorLog(t, {"ranges": ranges, "odometry": wheels})
        assert mn.estimate("range_ekf", MISSION, log).x.shape == (200, 3)


def test_an_observer_that_is_stepped_refuses_its_first_readings() -> None:
    t, measured, odometry = driven()
    check = FirstReadings(MISSION)
    said = [check.misread(*reading, odometry[0]) for reading in _readings(t, measured, odometry * [1.0, 57.3])]
    assert said[127] == ""
    assert "only as deg/s in column 1 of odometry" in said[-1]


def _readings(t: Array, ranges: Array, odometry: Array) -> Iterator[tuple[float, dict[str, Array]]]:
    """Readings by time, again and again, until a check has had the time to end."""
    for k in range(700):
        row = k % len(t)
        yield DT * k, {"ranges": ranges[row], "odometry": odometry[row]}
