"""Attitude from a gyro and an accelerometer: inclination and bias are found, the heading is left alone."""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.invariant.inclination_kernels import STATES, step, turned
from mathnavi.estimators.invariant.lie_groups import SO3
from mathnavi.estimators.invariant.quiet import QuietWindow
from mathnavi.interfaces.signals import Array, Status
from mathnavi.models.inertial_mission import CALIBRATED, InertialMission
from mathnavi.models.quaternion import rotation
from mathnavi.sim.records.attitude_figures import attitude_errors, attitude_figures
from tests.estimators.invariant.handheld import BIAS, MISSION, PERIOD, Handled, handled

G = 9.81  # [m/s^2]
NONE_READ = 1e30  # density or variance of a reading that says nothing


@cache
def device() -> Handled:
    return handled()


@cache
def estimates() -> mn.EstimateHistory:
    return mn.estimate("inertial_attitude", MISSION, device().log)


def test_inclination_and_bias_are_found_and_the_covariance_says_how_well() -> None:
    found, truth = estimates(), device().truth
    figures = attitude_figures(found.x, found.covariance, found.usable, truth)
    assert figures["inclination_rms_deg"] < 0.7
    assert figures["wrong_share"] == 0.0
    assert figures["nees_mean"] < 1.0
    assert figures["usable_share"] > 0.95
    bias, deviation = found.extra["bias"][-1], found.extra["bias_deviation"][-1]
    assert np.abs(bias - BIAS).max() < 1e-3
    assert (np.abs(bias - BIAS) < 4.0 * deviation).all()
    assert found.ok[-1]


def test_rest_is_seen_at_the_start_and_not_in_motion() -> None:
    at_rest = estimates().extra["at_rest"].ravel() > 0.5
    t = device().log.t
    assert at_rest[(t > 1.0) & (t < 3.0)].all()
    assert not at_rest[t > 3.3].any()


def test_a_turn_of_the_world_about_the_vertical_turns_the_estimates_and_changes_nothing_else() -> None:
    """The heading at the start is that of the estimator; a device that begins turned has the same readings."""
    found = estimates()
    _, heading = attitude_errors(found.x, device().truth)
    assert abs(np.diff(np.unwrap(heading))).max() < 0.01
    deviation = found.extra["attitude_deviation"][:, 2]
    assert deviation.min() > 1.7, "nothing shows the heading"


def test_the_covariance_is_carried_as_the_error_is() -> None:
    """Against differences of the step itself without acceleration, whose readings of the motion say nothing."""
    q, h = turned(np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.4, -0.3, 0.8])), 0.02
    reading = np.array([1.0, 2.0, 3.0, *rotation(turned(q, h * np.arange(1.0, 4.0))).T @ np.array([0.0, 0.0, G])])
    parameters = np.array([0.0, 0.0, 0.0, *[NONE_READ] * 5, G])

    def moved(error: Array) -> tuple[Array, Array, Array]:
        theta = error[:3]
        state = turned(q, rotation(q).T @ theta), error[3:7].copy(), error[7:].copy()
        step(*state, np.zeros((STATES, STATES)), reading, h, False, reading, parameters)
        return state

    def errors(state: tuple[Array, Array, Array], about: tuple[Array, Array, Array]) -> Array:
        turn = SO3.log(rotation(state[0]) @ rotation(about[0]).T)
        E, parts = SO3.exp(turn), []
        for k in (0, 2):
            parts.append(state[1][k : k + 2] - (E @ np.array([*about[1][k : k + 2], 0.0]))[:2])
        return np.concatenate([turn, *parts, state[2] - about[2]])

    about = moved(np.zeros(STATES))
    A = np.column_stack([errors(moved(1e-6 * e), about) for e in np.eye(STATES)]) / 1e-6
    root = np.random.default_rng(0).standard_normal((STATES, STATES))
    P = root @ root.T
    after = P.copy()
    state = q.copy(), np.zeros(4), np.zeros(3)
    step(*state, after, reading, h, False, reading, parameters)
    np.testing.assert_allclose(after, A @ P @ A.T, atol=1e-3)


def test_a_motion_that_begins_slowly_is_not_taken_for_the_bias() -> None:
    window, rng = QuietWindow(CALIBRATED, PERIOD), np.random.default_rng(1)
    still = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 9.81])
    for k in range(400):
        creeping = max(k - 300, 0) * np.array([2e-4, 0.0, 0.0, 0.0, 0.0, 0.0])
        if window.take(still + creeping + rng.standard_normal(6) * np.repeat([0.005, 0.05], 3)) and k > 300:
            assert abs(window.oldest[0]) < 0.025, "a reading of the rest"


def test_readings_that_are_saturated_are_counted_and_bridged() -> None:
    imu = device().log.readings["imu"].copy()
    imu[1200:1203, 0] = 40.0
    found = mn.estimate("inertial_attitude", MISSION, mn.SensorLog(device().log.t, {"imu": imu}))
    assert found.unused == {"outlier": 3}
    inclination, _ = attitude_errors(found.x, device().truth)
    assert np.degrees(np.hypot(*inclination[-200:].T)).max() < 3.0


def test_after_a_gap_the_vertical_is_found_again_and_the_bias_is_kept() -> None:
    imu, t = device().log.readings["imu"].copy(), device().log.t
    imu[(t > 8.0) & (t < 10.0)] = np.nan
    found = mn.estimate("inertial_attitude", MISSION, mn.SensorLog(t, {"imu": imu}))
    assert found.status[int(9.9 / PERIOD)] is Status.LOST
    assert found.status[int(10.05 / PERIOD)] is Status.DEGRADED
    assert found.ok[-1]
    figures = attitude_figures(found.x, found.covariance, found.usable, device().truth)
    assert figures["wrong_share"] == 0.0
    assert found.extra["bias_deviation"][-1].max() < 0.002


def test_a_device_that_is_faster_than_declared_is_degraded() -> None:
    slow = dataclasses.replace(MISSION, speed=0.05, region=0.05)
    found = mn.estimate("inertial_attitude", slow, device().log)
    assert found.status[-1] is Status.DEGRADED
    assert "velocities" in found.message[-1]


def test_an_accelerometer_in_gravities_is_refused_with_its_unit() -> None:
    imu = device().log.readings["imu"][:200] / np.repeat([1.0, 9.81], 3)
    log = mn.SensorLog(device().log.t[:200], {"imu": imu})
    with pytest.raises(mn.LogError, match=r"accelerometer.*9\.8"):
        mn.estimate("inertial_attitude", MISSION, log)
    assert not mn.estimate("inertial_attitude", MISSION, log, trust_units=True).unused


def test_a_gyro_in_degrees_is_refused_with_its_unit_once_the_device_turns() -> None:
    log = device().log
    degrees = mn.SensorLog(log.t, {"imu": log.readings["imu"] * np.repeat([180.0 / np.pi, 1.0], 3)})
    with pytest.raises(mn.LogError, match=r"turning of gravity only as deg/s in columns 0, 1, 2, the gyro"):
        mn.estimate("inertial_attitude", MISSION, degrees)
    still = mn.SensorLog(log.t[:200], {"imu": degrees.readings["imu"][:200]})
    assert mn.estimate("inertial_attitude", MISSION, still).status[-1] is Status.OK  # nothing shows it yet


def test_a_device_that_swings_on_an_arc_is_not_taken_for_a_gyro_of_another_unit_or_sign() -> None:
    """It accelerates as it turns, by more than gravity turns: f' is along f x omega the other way."""
    t = PERIOD * np.arange(2001)
    rate = 0.3 * np.sin(5.0 * t)
    angle, radius = 0.06 * (1.0 - np.cos(5.0 * t)), 3.0
    forces = np.stack([9.81 * np.sin(angle) + radius * np.gradient(rate, PERIOD), 0.0 * t, 9.81 * np.cos(angle)], 1)
    imu = np.hstack([np.stack([0.0 * t, -rate, 0.0 * t], 1), forces])
    imu += np.random.default_rng(2).standard_normal(imu.shape) * np.repeat([0.005, 0.05], 3)
    assert mn.estimate("inertial_attitude", MISSION, mn.SensorLog(t, {"imu": imu})).x.shape == (2001, 4)


def test_a_declared_delay_is_made_up_for() -> None:
    t = device().log.t[:1000]
    late, truth = mn.SensorLog(t, {"imu": device().log.readings["imu"][:1000]}), device().truth[3:1003]
    errors = []
    for delay in (0.0, 3.0 * PERIOD):
        found = mn.estimate("inertial_attitude", dataclasses.replace(MISSION, delay=delay), late)
        inclination, _ = attitude_errors(found.x[400:], truth[400:])
        errors.append(float(np.degrees(np.sqrt(np.square(inclination).sum(axis=1).mean()))))
    assert errors[1] < 0.4 * errors[0]


def test_the_densities_are_those_of_the_declared_motion() -> None:
    """Place and velocity of a process with the spectrum 1 / (1 / r_p + w^2 / r_v + w^4 / r_a)."""
    mission = InertialMission(region=0.4, speed=0.8)
    place, speed, acceleration = mission.motion_densities
    w = np.linspace(-400.0, 400.0, 800_001)
    spectrum = 1.0 / (1.0 / place + w**2 / speed + w**4 / acceleration)
    for power, deviation in ((0, mission.region), (2, mission.speed)):
        variance = float(np.sum(w**power * spectrum)) * (w[1] - w[0]) / (2.0 * math.pi)
        assert math.sqrt(variance) == pytest.approx(deviation, rel=0.01)
