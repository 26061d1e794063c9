"""Biases of an IMU: they are found where they are declared, at rest and in motion, and the estimate knows how well."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from mathnavi.estimators.invariant.inertial import InertialIekf, InertialIekfConfig
from mathnavi.estimators.invariant.lie_groups import SE23, SO3
from mathnavi.estimators.invariant.strapdown import SPEED, propagation
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.mechanism.floating_base import BaseImu
from mathnavi.models.quadrotor.dynamics import NOMINAL, VELOCITY
from mathnavi.models.quadrotor.mission import InertialQuality, QuadrotorMission
from mathnavi.models.quaternion import rotation
from tests.estimators.invariant.test_floating_base import quadruped
from tests.quadrotor import flight_mission, plain

G = NOMINAL.gravity
FALL = np.array([0.0, 0.0, -G])
BIAS = np.array([0.01, -0.01, 0.01, 0.1, -0.1, 0.1])  # [rad/s, m/s^2]
DECLARED = InertialQuality(gyro_bias=0.01, accelerometer_bias=0.1)
FLIGHT = flight_mission(plain(), (50.0, 50.0), (350.0, 350.0), position_noise=0.1)
DT = 0.02  # [s]


def flown(
    imu: InertialQuality, rest: float, seconds: float, seed: int, falls: bool = False
) -> list[tuple[Estimate, Array]]:
    """Estimates at each fix, with the true element (5, 5), of a flight that begins after a rest [s], or of a fall."""
    mission = QuadrotorMission(FLIGHT, inertial=imu)
    estimator, rng, x = (
        InertialIekf.build(InertialIekfConfig(), mission),
        np.random.default_rng(seed),
        mission.start_state,
    )
    X = SE23.from_parts(rotation(x[3:7]), x[VELOCITY], x[:3])
    rate, found = np.zeros(3), []
    for k in range(round(seconds / DT) + 1):
        t, noise = k * DT, rng.standard_normal(9)
        moving, s = float(t > rest), max(0.0, t - rest)
        force = moving * np.array([2.0 * math.sin(2.0 * s), 2.0 * math.cos(1.5 * s), 0.0]) + G * X[2, :3]
        force *= not falls
        if k:
            after = moving * 0.4 * np.array([math.sin(3.0 * s), math.cos(2.0 * s), math.sin(s)])
            X, _ = propagation(X, 0.5 * (rate + after), force, FALL, DT)
            rate = after
        read = np.concatenate([rate + imu.gyro * noise[:3], force + imu.accelerometer * noise[3:6]])
        readings = [Measurement("imu", t, read + BIAS)]
        if k % 5 == 0:
            readings.append(Measurement("position", t, X[:3, 4] + FLIGHT.position_noise * noise[6:]))
        estimate = estimator.update(t, readings, np.zeros(4))
        if k % 5 == 0:
            found.append((estimate, X.copy()))
    return found


@pytest.mark.parametrize("rest", [0.0, 4.0])
def test_declared_biases_are_found_and_the_estimate_is_as_good_as_it_says(rest: float) -> None:
    squares, attitudes = [], []
    for seed in range(2):
        found = flown(DECLARED, rest, 30.0, seed)
        last = found[-1][0]
        assert (np.abs(last.extra["bias"] - BIAS) < 4.0 * last.extra["bias_deviation"]).all()
        assert (last.extra["bias_deviation"] < 0.2 * np.repeat([0.01, 0.1], 3)).all()
        for estimate, X in found[100:]:
            assert estimate.covariance is not None
            error = estimate.x - np.concatenate([X[:3, 4], X[:3, 3]])
            squares.append(error @ np.linalg.solve(estimate.covariance, error) / 6.0)
            attitudes.append(np.linalg.norm(SO3.log(rotation(estimate.extra["attitude"]).T @ X[:3, :3])))
            assert estimate.status is Status.OK
    assert 0.5 < np.mean(squares) < 1.5
    assert np.sqrt(np.mean(np.square(attitudes))) < 0.02


def test_at_rest_the_gyro_reads_its_bias_and_a_motion_ends_the_rest() -> None:
    readings = (2.0 - 0.25) / DT
    found = flown(DECLARED, 4.0, 6.0, 0)
    at_rest, moved = found[20][0], found[-1][0]
    deviation = at_rest.extra["bias_deviation"][:3]
    np.testing.assert_allclose(deviation, DECLARED.gyro / math.sqrt(readings), rtol=0.05)
    assert (np.abs(at_rest.extra["bias"][:3] - BIAS[:3]) < 4.0 * deviation).all()
    assert np.linalg.norm(at_rest.x[3:]) < 0.02
    assert np.linalg.norm(moved.x[3:] - found[-1][1][:3, 3]) < 0.2  # no longer held at rest


def test_a_fall_from_rest_is_no_rest() -> None:
    estimate, X = flown(DECLARED, 9.0, 1.0, 0, falls=True)[-1]
    assert np.linalg.norm(estimate.x[3:] - X[:3, 3]) < 0.5
    assert X[2, 3] < -9.0


def test_an_imu_with_biases_bounds_no_heading_in_hover_so_no_plan_is_certified_by_it() -> None:
    with pytest.raises(FieldError, match=r"gyro_bias=0\.01.*allowed where plans are certified.*biases of 0"):
        InertialIekf.quality(InertialIekfConfig(), QuadrotorMission(FLIGHT, inertial=DECLARED))
    assert not dataclasses.replace(DECLARED, gyro_bias=0.0, accelerometer_bias=0.0).has_biases


def test_of_a_legged_base_they_are_found_while_its_feet_stand(monkeypatch: pytest.MonkeyPatch) -> None:
    exact = BaseImu.read
    monkeypatch.setattr(BaseImu, "read", lambda self, motion, rng: exact(self, motion, rng) + 3.0 * BIAS)
    errors = []
    for declared in (0.0, 1.0):
        fields = {"estimator.gyro_bias": 0.03 * declared, "estimator.accelerometer_bias": 0.3 * declared}
        run = quadruped(1.5, **fields)
        estimates, truth = run.recording.agents["mechanism"].estimates, run.recording.truths["mechanism"]
        at = np.searchsorted(run.recording.t, [each.t - 1e-9 for each in estimates])
        error = np.array([each.x[15:21] for each in estimates]) - truth[at, 15:21]
        errors.append(np.sqrt(np.square(error[len(error) // 2 :]).mean(axis=0)))
    last = estimates[-1].extra
    assert np.linalg.norm(errors[1][:3]) < 0.3 * np.linalg.norm(errors[0][:3])  # velocity
    assert (errors[1][3:] < 0.7 * errors[0][3:]).all()  # rates, which have the noise of the gyro as well
    seen = [0, 1, 5]
    assert (np.abs(last["bias"] - 3.0 * BIAS)[seen] < 4.0 * last["bias_deviation"][seen]).all()
    assert (last["bias_deviation"][seen] < 0.3 * np.array([0.03, 0.03, 0.3])).all()
    assert (estimates[-1].extra["base_deviation"][SPEED] < 0.05).all()
