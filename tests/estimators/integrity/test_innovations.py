"""A filter with one sensor says when its readings contradict it, and is not OK while it is wrong."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mathnavi.estimators.integrity.innovations import InnovationMonitor
from mathnavi.estimators.invariant.inertial import InertialIekf, InertialIekfConfig
from mathnavi.estimators.invariant.lie_groups import SE23
from mathnavi.estimators.invariant.strapdown import propagation
from mathnavi.estimators.kalman import Kalman
from mathnavi.estimators.moving_horizon import MovingHorizonEstimator
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.aerial.mission import DeclaredGusts
from mathnavi.models.quadrotor.dynamics import NOMINAL, VELOCITY
from mathnavi.models.quadrotor.mission import QuadrotorMission
from mathnavi.models.quaternion import rotation
from tests.estimators.test_kalman import fix, mission_of
from tests.quadrotor import flight_mission, plain

GUST = DeclaredGusts(rms=0.5, time_constant=3.0, limit=5.0)
FAULT = (20.0, 40.0)  # [s]
FALL = np.array([0.0, 0.0, -NOMINAL.gravity])
DT = 0.02  # [s]


def off(estimate: Estimate, truth: Array) -> bool:
    """True if position or velocity are off by more than three standard deviations in their worst direction."""
    assert estimate.covariance is not None
    blocks = (slice(0, 3), slice(3, 6))
    return any(
        np.linalg.norm(estimate.x[part] - truth[part])
        > 3.0 * math.sqrt(np.linalg.eigvalsh(estimate.covariance[part, part])[-1])
        for part in blocks
    )


def flown(seed: int, gust: float = 1.0, late: float = 0.0, plugin: Any = Kalman) -> list[tuple[float, Estimate, Array]]:
    """Estimates of a ``plugin`` at 10 Hz with the truth, of a flight that manoeuvres for 60 s under its gusts; during
    the fault these are ``gust`` times as strong, and fixes are ``late`` [s].
    """
    rng, mission, h = np.random.default_rng(seed), mission_of(GUST, 1.0), 0.01
    estimator, x, found = plugin.build(plugin.Config(), mission), np.array([*mission.start, 0.0, 0.0, 0.0]), []
    keep = math.exp(-h / GUST.time_constant)
    g, u = GUST.rms * rng.standard_normal(3), np.zeros(3)
    past: list[Array] = []
    for k in range(6000):
        t, past = k * h, [*past[-200:], x[:3]]
        faulty = FAULT[0] <= t < FAULT[1]
        if k % 10 == 0:
            place = past[-1 - min(len(past) - 1, round(late / h))] if faulty else x[:3]
            reading = fix(t, place + mission.position_noise * rng.standard_normal(3))
            found.append((t, estimator.update(t, [reading], u), x))
            u = 4.0 * np.array([math.sin(0.7 * t), math.cos(0.5 * t), 0.0])
        g = keep * g + GUST.rms * math.sqrt(1.0 - keep**2) * rng.standard_normal(3)
        a = u + (gust if faulty else 1.0) * g
        x = np.concatenate([x[:3] + h * x[3:] + 0.5 * h * h * a, x[3:] + h * a])
    return found


def test_a_flight_as_declared_never_alarms() -> None:
    for seed in range(3):
        found = flown(seed)
        assert {estimate.status for _, estimate, _ in found} == {Status.OK}
        assert max(float(estimate.extra["integrity"][0]) for _, estimate, _ in found) < 0.95


def test_gusts_three_times_as_strong_and_fixes_of_another_time_are_found_and_the_covariance_grows() -> None:
    for fault in ({"gust": 3.0}, {"late": 0.5}):
        found = [flown(seed, **fault) for seed in range(3)]
        first = [next(t for t, estimate, _ in each if estimate.status is not Status.OK) for each in found]
        assert min(first) >= FAULT[0]
        assert np.median(first) < FAULT[0] + 8.0
        variances = [[estimate.covariance[0, 0] for _, estimate, _ in each] for each in found]  # type: ignore[index]
        assert np.median([max(each[200:400]) / max(each[100:200]) for each in variances]) > 1.5
    assert found[0][-1][1].status is not Status.OK  # for 20 s after an alarm that nobody explained


def test_predictions_of_a_moving_horizon_are_tested_as_those_of_the_filter_are() -> None:
    honest, late = flown(0, plugin=MovingHorizonEstimator), flown(0, late=0.5, plugin=MovingHorizonEstimator)
    assert {estimate.status for _, estimate, _ in honest} == {Status.OK}
    assert 0.1 < max(float(estimate.extra["integrity"][0]) for _, estimate, _ in honest) < 0.95
    first = next(t for t, estimate, _ in late if estimate.status is not Status.OK)
    assert FAULT[0] <= first < FAULT[0] + 8.0
    before, after = (max(late[k][1].covariance[0, 0] for k in range(*at)) for at in ((100, 200), (200, 400)))  # type: ignore[index]
    assert after > 1.5 * before


def test_it_is_lost_after_readings_in_a_row_that_cannot_be_and_returns_in_steps() -> None:
    monitor, rng = InnovationMonitor("fixes", 3, 0.1), np.random.default_rng(0)
    words = []
    for k in range(400):
        nu = np.full(3, 9.0) if 100 <= k < 110 else rng.standard_normal(3)
        monitor.note(0.1 * k, nu, np.eye(3), 0.5 * np.eye(3))
        if k == 110:
            monitor.begin_again()
        words.append(monitor.status(0.1 * k))
    assert words[99] is Status.OK
    assert words[100] is Status.DEGRADED or words[101] is Status.DEGRADED
    assert set(words[104:150]) == {Status.LOST}
    assert set(words[170:300]) == {Status.DEGRADED}
    assert words[-1] is Status.OK


def test_an_alarm_is_remembered_for_as_long_as_readings_come() -> None:
    """A time without them proves nothing."""
    monitor, rng = InnovationMonitor("fixes", 3, 0.1), np.random.default_rng(0)
    monitor.note(0.0, np.full(3, 9.0), np.eye(3), 0.5 * np.eye(3))
    for k in range(1, 20):
        monitor.note(0.1 * k, (9.0 if k < 5 else 1.0) * rng.standard_normal(3), np.eye(3), 0.5 * np.eye(3))
    assert monitor.status(1.9) is not Status.OK
    assert monitor.status(100.0) is not Status.OK
    words = []
    for k in range(1000, 1400):
        monitor.note(0.1 * k, rng.standard_normal(3), np.eye(3), 0.5 * np.eye(3))
        words.append(monitor.status(0.1 * k))
    assert Status.OK not in words[:150]
    assert words[-1] is Status.OK


@pytest.mark.parametrize("covariance", [np.nan, -1.0])
def test_an_estimate_that_is_none_is_lost_at_once(covariance: float) -> None:
    monitor = InnovationMonitor("fixes", 3, 0.1)
    monitor.note(0.0, np.zeros(3), covariance * np.eye(3), np.eye(3))
    assert monitor.status(0.0) is Status.LOST


def by_imu(rate: float, spoilt: Callable[[Array], Array], start: Array) -> list[tuple[Estimate, Array]]:
    """Estimates of ``inertial_iekf`` with the true position and velocity at each fix, of 60 s from Exp(start)."""
    flight = flight_mission(plain(), (50.0, 50.0), (350.0, 350.0), position_noise=0.1)
    mission = QuadrotorMission(dataclasses.replace(flight, position_rate=rate))
    estimator, rng = InertialIekf.build(InertialIekfConfig(timeout=3.0), mission), np.random.default_rng(0)
    x, found = mission.start_state, []
    X, turning = SE23.from_parts(rotation(x[3:7]), x[VELOCITY], x[:3]) @ SE23.exp(start), np.zeros(3)
    for k in range(round(60.0 / DT) + 1):
        t, n = k * DT, rng.standard_normal(9)
        force = np.array([2.0 * math.sin(2.0 * t), 2.0 * math.cos(1.5 * t), 0.0]) - X[2, :3] * FALL[2]
        if k:
            after = 0.4 * np.array([math.sin(3.0 * t), math.cos(2.0 * t), math.sin(t)])
            X, _ = propagation(X, 0.5 * (turning + after), force, FALL, DT)
            turning = after
        read = np.concatenate([turning, force]) + np.repeat([0.005, 0.05], 3) * n[:6]
        readings = [Measurement("imu", t, spoilt(read))]
        if k % round(1.0 / rate / DT) == 0:
            readings.append(Measurement("position", t, X[:3, 4] + 0.1 * n[6:]))
        estimate = estimator.update(t, readings, np.zeros(4))
        if len(readings) == 2:
            found.append((estimate, np.concatenate([X[:3, 4], X[:3, 3]])))
    return found


@pytest.mark.parametrize("rate", [10.0, 1.0])
def test_an_imu_that_reads_something_else_is_never_sure_and_wrong_for_long(rate: float) -> None:
    """Biases that are not declared, and an accelerometer in units of gravity."""
    for spoilt in (
        lambda read: read + np.repeat([0.01, 0.1], 3),
        lambda read: np.concatenate([read[:3], read[3:] / NOMINAL.gravity]),
    ):
        found = by_imu(rate, spoilt, np.zeros(9))
        wrong = [estimate.status is Status.OK and off(estimate, truth) for estimate, truth in found]
        assert sum(wrong) <= 3.0 * rate  # within its first seconds
        assert found[-1][0].status is not Status.OK
        assert "fixes" in found[-1][0].message


@pytest.mark.parametrize("rate", [10.0, 1.0])
def test_a_start_far_from_the_first_fixes_is_given_up_for_their_place(rate: float) -> None:
    found = by_imu(rate, lambda read: read, np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 20.0, 0.0, 0.0]))
    estimate, truth = found[-1]
    assert np.linalg.norm(estimate.x[:3] - truth[:3]) < 0.3
    assert estimate.status is Status.OK
    assert not any(each.status is Status.OK and np.linalg.norm(each.x[:3] - true[:3]) > 1.0 for each, true in found)
