"""The bank over drives among beacons: it finds the start, says when it has, and is as good as it says."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.beacons.filter import BeaconFilter
from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.beacons import exact_readings
from mathnavi.models.unicycle.kernels import wrapped
from mathnavi.sim.metrics.sure_and_wrong import sure_and_wrong
from tests.estimators.beacons.drives import PLACES, Drive, drive, mission

KINDS = ("ranges", "bearings", "range_differences", "ranges+bearings")


def errors(found: mn.EstimateHistory, truth: Array) -> tuple[Array, Array]:
    """Errors of position (n,) [m] and heading (n,) [rad]."""
    error = found.x - truth
    return np.hypot(error[:, 0], error[:, 1]), np.abs((error[:, 2] + math.pi) % (2.0 * math.pi) - math.pi)


def nees(found: mn.EstimateHistory, truth: Array) -> Array:
    error = found.x - truth
    error[:, 2] = (error[:, 2] + math.pi) % (2.0 * math.pi) - math.pi
    solved: Array = np.einsum("ki,ki->k", error, np.linalg.solve(found.covariance, error[:, :, None])[:, :, 0])
    return solved


@pytest.mark.parametrize("kind", KINDS)
def test_it_finds_an_unknown_start_and_stays_as_sure_as_it_is_right(kind: str) -> None:
    driven = drive(kind)
    found = mn.estimate("beacon_bank", mission(kind), driven.log)
    first = int(np.argmax(found.usable))
    assert found.t[first] < 60.0
    assert found.status[0] is mn.Status.INITIALISING
    position, heading = errors(found, driven.truth)
    late = found.t > 0.5 * found.t[-1]
    assert found.usable[first:].mean() > 0.9
    assert np.sqrt(np.mean(np.square(position[late]))) < 0.6
    assert heading[late].max() < 0.2
    beyond = nees(found, driven.truth)[found.usable] > 16.3  # one in 1000
    assert beyond.mean() < 0.05


def test_it_says_the_scale_of_the_ranges_and_counts_outliers() -> None:
    driven = drive()
    found = mn.estimate("beacon_bank", mission(), driven.log)
    assert found.extra["scales"][-1, 2] == pytest.approx(0.07, abs=0.02)
    assert 1 <= found.unused["outlier"] <= 20  # three of a hundred readings, of which some hit the gate


def test_the_smoother_begins_where_the_filter_found_that_the_run_began() -> None:
    driven = drive(count=400)
    one = mn.estimate("beacon_bank", mission(), driven.log)
    other = mn.estimate(mn.smoother("beacon_bank"), mission(), driven.log)
    known = one.usable
    (filtered, _), (smoothed, _) = errors(one, driven.truth), errors(other, driven.truth)
    assert smoothed.max() < 1.0, "from the first reading on"
    assert np.square(smoothed[known]).mean() < np.square(filtered[known]).mean()


@pytest.mark.parametrize(("beacon", "error"), [(0, 3.0), (2, 1.0), (2, None)])
def test_the_smoother_is_not_sure_of_a_run_that_a_beacon_spoils(beacon: int, error: float | None) -> None:
    """The beacon is left out, or it is DEGRADED; ``error`` [m], None: stuck."""
    driven = drive(scale=0.0, outliers=0.0)
    ranges = np.array(driven.log.readings["beacon_ranges"])
    late = driven.log.t >= driven.log.t[len(ranges) // 2]
    stuck = ranges[~late, beacon][np.isfinite(ranges[~late, beacon])][-1]
    off = ranges[late, beacon] + (0.0 if error is None else error)
    ranges[late, beacon] = np.where(np.isfinite(off), stuck, np.nan) if error is None else off
    log = mn.SensorLog(driven.log.t, {**driven.log.readings, "beacon_ranges": ranges})
    found = mn.estimate(mn.smoother("beacon_bank"), mission(), log)
    difference = found.x - driven.truth
    difference[:, 2] = wrapped(difference[:, 2])
    assert not sure_and_wrong(log.t, found.ok, difference, found.covariance).any()
    assert np.sqrt(np.mean(np.square(np.hypot(*difference[late, :2].T)))) < 0.3  # 0.7 to 2.3 m with that beacon


def test_one_that_is_carried_away_is_lost_and_found_again() -> None:
    driven = drive("ranges+bearings", count=600, outliers=0.0)
    n, moved = len(driven.log.t) // 2, np.array([15.0, 20.0, 2.0])
    c, s = math.cos(moved[2]), math.sin(moved[2])
    truth = driven.truth.copy()
    pivot = truth[n, :2].copy()
    truth[n:, :2] = (truth[n:, :2] - pivot) @ np.array([[c, s], [-s, c]]) + pivot + moved[:2]
    truth[n:, 2] += moved[2]
    readings = {name: rows.copy() for name, rows in driven.log.readings.items()}
    for kind, name in enumerate(("beacon_ranges", "beacon_bearings")):
        for k in range(n, len(truth)):
            exact = exact_readings(np.array(PLACES), kind, truth[k])
            there = np.isfinite(readings[name][k])
            readings[name][k, there] = (1.0 if kind else 1.07) * exact[there]
    found = mn.estimate("beacon_bank", mission("ranges+bearings"), mn.SensorLog(driven.log.t, readings))
    assert not found.ok[n + 20 : n + 30].any()
    position, _ = errors(found, truth)
    assert found.usable[-100:].all()
    assert position[-100:].max() < 1.0


def test_a_gap_makes_it_lost_and_a_reading_that_is_late_is_counted() -> None:
    driven = drive(count=300)
    n = len(driven.log.t) // 2
    readings = {name: rows.copy() for name, rows in driven.log.readings.items()}
    readings["beacon_ranges"][n - 60 : n] = np.nan
    found = mn.estimate("beacon_bank", mission(), mn.SensorLog(driven.log.t, readings), timeout=2.0)
    assert found.status[n - 2] is mn.Status.LOST

    alone = BeaconFilter.build(BeaconFilter.Config(), mission())
    full = exact_readings(np.array(PLACES), 0, driven.truth[0])
    alone.update(1.0, (mn.Measurement("beacon_ranges", 1.0, full),), np.zeros(2))
    late = alone.update(1.2, (mn.Measurement("beacon_ranges", 0.5, full),), np.zeros(2))
    assert late.extra["unused"].sum() == 1


def test_two_beacons_leave_two_poses_until_the_robot_turns() -> None:
    """Mirror images of a straight drive explain the ranges of two beacons likewise: none of them is said to be it."""
    places = ((0.0, 0.0), (20.0, 0.0))
    asked = mn.BeaconMission(
        places, ranges=mn.BeaconQuality(0.1), odometry=mn.OdometryQuality((0.02, 0.005)), period=0.2, interval=0.2
    )
    t = 0.2 * np.arange(1, 151)
    pose = np.column_stack([5.0 + t * math.cos(0.4), 6.0 + t * math.sin(0.4), np.full(150, 0.4)])
    rho = np.array([exact_readings(np.array(places), 0, each) for each in pose])
    straight = mn.SensorLog(t, {"beacon_ranges": rho, "odometry": np.tile([1.0, 0.0], (150, 1))})
    found = mn.estimate("beacon_bank", asked, straight)
    assert not found.usable.any()
    assert np.isfinite(found.extra["scores"][-1]).sum() >= 2


def test_the_same_log_gives_the_same_estimates_and_the_odometry_may_be_its_input() -> None:
    driven: Drive = drive("ranges+bearings", count=150)
    one, other = (mn.estimate("beacon_bank", mission("ranges+bearings"), driven.log) for _ in range(2))
    assert np.array_equal(one.x, other.x)
    odometry = driven.log.readings["odometry"]
    rows = np.flatnonzero(np.isfinite(odometry[:, 0]))
    following = rows[np.minimum(np.searchsorted(rows, np.arange(len(odometry)) + 1), len(rows) - 1)]
    ranges = {name: driven.log.readings[name] for name in ("beacon_ranges", "beacon_bearings")}
    as_input = mn.SensorLog(driven.log.t, ranges, odometry[following])
    asked = dataclasses.replace(mission("ranges+bearings"), odometry_is_input=True)
    found = mn.estimate("beacon_bank", asked, as_input)
    assert errors(found, driven.truth)[0][-50:].max() < 1.0


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"ranges": None}, "reads nothing"),
        ({"beacons": ((0.0, 0.0), (0.0, 0.0))}, "one place twice"),
        ({"beacons": ((0.0, 0.0),), "range_differences": mn.BeaconQuality(0.1)}, "two beacons or more"),
    ],
)
def test_a_mission_that_cannot_be_is_refused(changes: dict[str, object], said: str) -> None:
    with pytest.raises(mn.MissionError, match=said):
        dataclasses.replace(mission(), **changes)  # type: ignore[arg-type]
