"""Within a building a ray that passes the edge of a door jumps: filters with a known start follow the robot."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.models.field.polygon import Polygon
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from mathnavi.sim.metrics.sure_and_wrong import sure_and_wrong
from mathnavi.sim.records.sensor_log import SensorLog, estimate, smoother

LONG, WIDE, DEEP, WALL, DOOR = 16.0, 2.0, 3.5, 0.2, 0.9  # [m] of a corridor, its rooms, walls and doors
STEP, SCANS, DURATION = 0.1, 20, 20.0  # [s]; steps from one scan to the next; [s]


def rooms(side: float, out: float, doors: tuple[float, ...]) -> list[tuple[float, float]]:
    """Corners, from left to right, of the rooms of 4 m on one side of the corridor, whose ``doors`` [m] begin so far
    along it; ``out`` is the direction away from it.
    """
    corners = []
    for k, door in enumerate(doors):
        left, right, far, near = 4.0 * k + WALL, 4.0 * (k + 1) - WALL, side + out * DEEP, side + out * WALL
        corners += [(door, side), (door, near), (left, near), (left, far), (right, far), (right, near)]
        corners += [(door + DOOR, near), (door + DOOR, side)]
    return corners


BELOW, ABOVE = rooms(0.0, -1.0, (2.2, 5.0, 10.2, 13.0)), rooms(WIDE, 1.0, (0.8, 6.0, 8.8, 14.0))
BUILDING = Polygon((((0.0, 0.0), *BELOW, (LONG, 0.0), (LONG, WIDE), *ABOVE[::-1], (0.0, WIDE)),))
MISSION = RangingMission(
    BUILDING,
    tuple((0.25 * math.pi * np.arange(-4, 4)).tolist()),
    RangeQuality(0.01, 0.05, outliers=0.15),
    OdometryQuality((0.25, 0.25), 0.02),
    start=KnownStart((1.0, 1.0, 0.0), (0.2, 0.2, 0.1)),
    period=STEP,
)


def drive(rng: np.random.Generator) -> tuple[SensorLog, Array]:
    """Log of a drive along the corridor, with a scan each 2 s of which what is not on the map cuts rays short, and the
    true poses (n, 3).
    """
    x, u, odometry = np.array([1.0, 1.0, 0.0]), np.zeros(2), np.array(MISSION.odometry.noise)
    t = STEP * np.arange(round(DURATION / STEP) + 1)
    poses, ranges, inputs = np.empty((len(t), 3)), np.full((len(t), 8), np.nan), np.empty((len(t), 2))
    for k in range(len(t)):
        poses[k], inputs[k] = x, u + odometry * rng.standard_normal(2)
        if k % SCANS == 0:
            rho, _ = BUILDING.ranges(x, MISSION.alpha)
            rho = rho + np.hypot(0.05, 0.01 * rho) * rng.standard_normal(8)
            ranges[k] = np.where(rng.random(8) < 0.15, rng.uniform(0.2, 1.0, 8), 1.0) * np.maximum(rho, 0.05)
        ahead = math.atan2(1.0 + 0.5 * math.sin(0.4 * t[k]) - x[1], 0.8)
        u = np.array([0.65, 2.0 * wrapped(ahead - x[2])])
        x = MISSION.flow(x, u, STEP)
    return SensorLog(t, {"ranges": ranges, "odometry": inputs}), poses


@pytest.mark.parametrize("name", ["range_ekf", "range_iekf", "range_ukf", "moving_horizon", "smoother"])
def test_an_estimator_follows_a_robot_past_doors_and_knows_when_it_does_not(name: str) -> None:
    """With the walls that its mean sees alone, each is sure and wrong more than a third of the time."""
    plugin, fields = (smoother("range_ekf"), {}) if name == "smoother" else (name, {"timeout": 10.0})
    wrong, ok = [], []
    for seed in range(8):
        log, poses = drive(np.random.default_rng(seed))
        found = estimate(plugin, MISSION, log, **fields)
        scans = np.flatnonzero(np.isfinite(log.readings["ranges"][:, 0]))[1:]
        difference = found.x[scans] - poses[scans]
        difference[:, 2] = wrapped(difference[:, 2])
        sure = sure_and_wrong(log.t[scans], found.ok[scans], difference, found.covariance[scans])
        wrong.append(sure.any(axis=1).mean())
        ok.append(found.ok[scans].mean())
    assert np.mean(wrong) < 0.15
    assert np.mean(ok) > 0.8


@pytest.mark.parametrize("name", ["range_ekf", "range_ukf", "moving_horizon"])
def test_from_an_unknown_start_a_filter_waits_for_the_bank_to_find_the_pose(name: str) -> None:
    """A filter that began anywhere was OK at wrong places, metres off, in half of its estimates."""
    ok, far = 0, 0
    for seed in range(6):
        log, poses = drive(np.random.default_rng(seed))
        found = estimate(name, dataclasses.replace(MISSION, start=None), log, timeout=10.0)
        ok += int(found.ok.sum())
        far += int((found.ok & (np.hypot(*(found.x - poses)[:, :2].T) > 1.0)).sum())
    assert far == 0
    assert ok > 0.2 * 6 * len(poses)


def test_a_search_that_began_where_the_map_is_wrong_begins_again() -> None:
    """For 10 s the robot reads what the map does not have, so that no pose that is found then is near the true one."""
    hall = Polygon((((0, 0), (18, 0), (18, 8), (12, 8), (12, 14), (0, 14)), ((4, 4), (6, 4), (6, 7), (4, 6))))
    mission = dataclasses.replace(MISSION, curve=hall, start=None)
    found_again = 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        t = STEP * np.arange(301)
        x, u = np.array([9.0, 2.0, 0.1]), np.array([0.4, 0.2])
        poses, ranges = np.empty((len(t), 3)), np.full((len(t), 8), np.nan)
        for k in range(len(t)):
            poses[k] = x
            if k % 10 == 0:
                rho = hall.ranges(x, MISSION.alpha)[0] + 0.05 * rng.standard_normal(8)
                ranges[k] = np.maximum(rho * (rng.uniform(0.2, 0.8, 8) if t[k] < 10.0 else 1.0), 0.05)
            x = MISSION.flow(x, u, STEP)
        inputs = u + 0.02 * rng.standard_normal((len(t), 2))
        bank = {"timeout": 10.0, "readings": 1, "candidates": 3000, "hypotheses": 200, "misfit": 6.0}
        found = estimate("feasible_set_bank", mission, SensorLog(t, {"ranges": ranges, "odometry": inputs}), **bank)
        off = np.hypot(*(found.x - poses)[:, :2].T)
        found_again += int(off[-10:].max() < 0.3)
        assert not (found.ok & (off > 1.0)).any()
    assert found_again >= 4
