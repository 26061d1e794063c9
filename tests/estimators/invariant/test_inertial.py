"""The filter on SE_2(3): what is exact about it, and what it believes of itself."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.estimators.invariant.inertial import InertialIekf, InertialIekfConfig
from mathnavi.estimators.invariant.lie_groups import SE23, SO3
from mathnavi.estimators.invariant.strapdown import propagation
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.aerial.dynamics import TICK
from mathnavi.models.quadrotor.dynamics import NOMINAL, STATE_SIZE, VELOCITY
from mathnavi.models.quadrotor.mission import InertialQuality, InertialSensor, QuadrotorMission
from mathnavi.models.quaternion import rotation
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from tests.quadrotor import HIGH, built, flight_mission, plain

G = NOMINAL.gravity
FALL = np.array([0.0, 0.0, -G])
MISSION = QuadrotorMission(flight_mission(plain(), (50.0, 50.0), (350.0, 350.0), position_noise=0.1))
CONFIG, ROUGH = InertialIekfConfig(), InertialIekfConfig(start_attitude=0.2, start_velocity=0.3)


@given(size=st.floats(0.0, 2.5), seed=st.integers(0, 2**32 - 1))
def test_an_error_of_any_size_propagates_linearly(size: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    estimate, xi = SE23.exp(rng.standard_normal(9)), rng.standard_normal(9)
    xi[:3] *= size / np.linalg.norm(xi[:3])
    readings = (rng.standard_normal(3), 10.0 * rng.standard_normal(3), FALL, 0.05)
    after, A = propagation(estimate, *readings)
    truth, other = propagation(estimate @ SE23.exp(xi), *readings)
    np.testing.assert_array_equal(A, other)
    np.testing.assert_allclose(SE23.inverse(after) @ truth, SE23.exp(A @ xi), atol=1e-10)


def test_a_body_that_falls_and_one_that_rests_move_as_they_do() -> None:
    X, still = SE23.from_parts(np.eye(3), np.array([1.0, 0.0, 0.0]), np.zeros(3)), np.zeros(3)
    falls, _ = propagation(X, still, still, FALL, 0.5)
    np.testing.assert_allclose(falls[:3, 3:].T, [[1.0, 0.0, -0.5 * G], [0.5, 0.0, -0.125 * G]])
    rests, _ = propagation(X, still, np.array([0.0, 0.0, G]), FALL, 0.5)
    np.testing.assert_allclose(rests[:3, 3:].T, [[1.0, 0.0, 0.0], [0.5, 0.0, 0.0]], atol=1e-15)


def flown(
    seed: int, start: Array, seconds: float, config: InertialIekfConfig = ROUGH, dt: float = 0.02
) -> list[tuple[Estimate, Array]]:
    """Estimates at each fix with the true element (5, 5) there, which begins off the stated start by Exp(start)."""
    rng, quality, period = np.random.default_rng(seed), MISSION.inertial, round(0.1 / dt)
    estimator, x = InertialIekf.build(config, MISSION), MISSION.start_state
    X = SE23.from_parts(rotation(x[3:7]), x[VELOCITY], x[:3]) @ SE23.exp(start)
    rate, estimates = np.zeros(3), []
    for k in range(round(seconds / dt) + 1):
        t, noise = k * dt, rng.standard_normal(9)
        force = np.array([2.0 * math.sin(2.0 * t), 2.0 * math.cos(1.5 * t), 0.0]) + G * X[2, :3]
        if k:
            after = 0.4 * np.array([math.sin(3.0 * t), math.cos(2.0 * t), math.sin(t)])
            X, _ = propagation(X, 0.5 * (rate + after), force, FALL, dt)
            rate = after
        imu = np.concatenate([rate + quality.gyro * noise[:3], force + quality.accelerometer * noise[3:6]])
        readings = [Measurement("imu", t, imu)]
        if k % period == 0:
            readings.append(Measurement("position", t, X[:3, 4] + MISSION.flight.position_noise * noise[6:]))
        estimate = estimator.update(t, readings, np.zeros(4))
        if k % period == 0:
            estimates.append((estimate, X.copy()))
    return estimates


def test_from_an_attitude_that_is_off_by_half_a_radian_it_finds_tilt_and_heading() -> None:
    errors = []
    for seed in range(3):
        estimate, X = flown(seed, np.array([0.3, -0.2, 0.5, 0.4, 0.2, 0.0, 0.0, 0.0, 0.0]), 8.0)[-1]
        errors.append(np.linalg.norm(SO3.log(rotation(estimate.extra["attitude"]).T @ X[:3, :3])))
        assert estimate.status is Status.OK
    assert max(errors) < 0.06


@pytest.mark.parametrize(
    ("between", "lost"),
    [
        pytest.param(
            0.5, (9.0, 9.0), marks=pytest.mark.honoured("sensor log", "sensors with time stamps of their own")
        ),
        (0.3, (9.0, 9.0)),
        (0.0, (2.0, 2.1)),
        pytest.param(0.0, (2.0, 2.6), marks=pytest.mark.honoured("sensor log", "gap in the IMU longer than declared")),
    ],
)
def test_an_imu_that_is_silent_where_no_input_is_given_holds_its_last_reading(
    between: float, lost: tuple[float, float]
) -> None:
    """In a log of sensors fixes have time stamps of their own, between those of the IMU, or the IMU has gaps."""
    errors, dt, still = [], 0.02, np.zeros(4)
    for seed in range(4):
        rng, estimator, x = np.random.default_rng(seed), InertialIekf.build(ROUGH, MISSION), MISSION.start_state
        X, rate = SE23.from_parts(rotation(x[3:7]), x[VELOCITY], x[:3]), np.zeros(3)
        for k in range(200):
            t, before = k * dt, (k - 1 + between) * dt
            force = np.array([2.0 * math.sin(2.0 * t), 2.0 * math.cos(1.5 * t), 0.0]) + G * X[2, :3]
            after = 0.4 * np.array([math.sin(3.0 * t), math.cos(2.0 * t), math.sin(t)])
            mean, rate = 0.5 * (rate + after), after
            at_fix, _ = propagation(X, mean, force, FALL, between * dt)
            X, _ = propagation(at_fix, mean, force, FALL, (1.0 - between) * dt)
            if k and k % 5 == 0:
                fix = at_fix[:3, 4] + MISSION.flight.position_noise * rng.standard_normal(3)
                estimator.update(before, [Measurement("position", before, fix)], still)
            imu = [] if lost[0] <= t < lost[1] else [Measurement("imu", t, np.concatenate([rate, force]))]
            estimate = estimator.update(t, imu, still)
            errors.append(float(np.linalg.norm(estimate.x[:3] - X[:3, 4])))
            if lost[1] - lost[0] > 0.55 and 2.51 <= t <= 3.5:
                assert estimate.status is Status.DEGRADED
    assert np.sqrt(np.mean(np.square(errors))) < 0.15
    assert max(errors) < 0.6
    assert estimate.status is Status.OK


def test_rows_that_are_missing_leave_it_as_unsure_as_it_says() -> None:
    """Nobody reads how the vehicle turns and accelerates in the gap, and one reading at its end does not say."""
    squares = []
    for seed in range(8):
        estimator, rng = InertialIekf.build(ROUGH, MISSION), np.random.default_rng(seed)
        X, rate = SE23.from_parts(np.eye(3), np.zeros(3), MISSION.start_state[:3]), np.zeros(3)
        for k in range(176):
            t = 0.02 * k
            force = np.array([2.0 * math.sin(2.0 * t), 2.0 * math.cos(1.5 * t), 0.0]) + G * X[2, :3]
            after = 0.4 * np.array([math.sin(3.0 * t), math.cos(2.0 * t), math.sin(t)])
            X, _ = propagation(X, 0.5 * (rate + after), force, FALL, 0.02 if k else 0.0)
            rate = after
            if not 100 < k < 175:
                readings = [Measurement("imu", t, np.concatenate([rate, force]))]
                if k % 5 == 0 and k < 175:
                    fix = X[:3, 4] + MISSION.flight.position_noise * rng.standard_normal(3)
                    readings.append(Measurement("position", t, fix))
                estimate = estimator.update(t, readings, np.zeros(4))
        assert estimate.status is not Status.OK
        error = estimate.x - np.concatenate([X[:3, 4], X[:3, 3]])
        assert estimate.covariance is not None
        squares.append(float(error @ np.linalg.solve(estimate.covariance, error)))
    assert np.mean(squares) < 12.0


def test_it_is_as_good_as_it_says() -> None:
    """NEES of position and velocity has the mean 6; 10 runs of nearly independent starts, at their ends."""
    values = []
    for seed in range(10):
        rng = np.random.default_rng(100 + seed)
        start = np.concatenate([0.2 * rng.standard_normal(3), 0.3 * rng.standard_normal(3), np.zeros(3)])
        estimate, X = flown(seed, start, 3.0)[-1]
        error = estimate.x - X[:3, [4, 3]].T.ravel()
        assert estimate.covariance is not None
        values.append(error @ np.linalg.solve(estimate.covariance, error))
    assert np.mean(values) == pytest.approx(6.0, abs=3.0 * math.sqrt(12.0 / len(values)))


def test_without_the_imu_the_declared_motion_goes_on_and_the_estimate_is_degraded_and_without_fixes_lost() -> None:
    estimator, x = InertialIekf.build(CONFIG, MISSION), MISSION.start_state
    u = np.full(4, NOMINAL.hover_thrust) + np.array([0.01, -0.01, -0.01, 0.01])
    level = Measurement("imu", 0.0, np.array([0.0, 0.0, 0.0, 0.0, 0.0, G]))
    first = estimator.update(0.0, [level, Measurement("position", 0.0, x[:3])], u)
    after = estimator.update(0.4, [], u)
    expected = MISSION.flow(x, u, 0.4)
    np.testing.assert_allclose(after.x, [*expected[:3], *expected[VELOCITY]], atol=1e-9)
    np.testing.assert_allclose(rotation(after.extra["attitude"]), rotation(expected[3:7]), atol=1e-9)
    assert first.covariance is not None
    assert after.covariance is not None
    assert np.all(np.diag(after.covariance) > np.diag(first.covariance))
    assert first.status is after.status is Status.OK
    fix = Measurement("position", 1.0, MISSION.flow(x, u, 1.0)[:3])
    assert estimator.update(1.0, [fix], u).status is Status.DEGRADED
    assert estimator.update(2.1, [], u).status is Status.LOST


def test_a_fix_that_is_an_outlier_is_refused() -> None:
    estimator, x = InertialIekf.build(CONFIG, MISSION), MISSION.start_state
    estimate = estimator.update(0.0, [Measurement("position", 0.0, x[:3] + 50.0)], np.zeros(4))
    np.testing.assert_allclose(estimate.x[:3], x[:3])
    assert np.isnan(estimate.extra["nis"]).all()


def test_the_sensor_in_mujoco_reads_what_holds_the_vehicle_up() -> None:
    sensor = InertialSensor(InertialQuality(0.01, 0.05), rate=None)
    state = np.zeros(STATE_SIZE)
    state[:3], state[3:7] = HIGH, (math.cos(0.4), 0.0, 0.0, math.sin(0.4))
    plant = MujocoPlant(built(plain(), NOMINAL), {"quad": VehicleSetup(state, (sensor,))}, np.random.default_rng(0))
    readings = []
    for _ in range(300):
        plant.step({})
        readings.append(plant.sense("quad")[0].value)
    np.testing.assert_allclose(np.mean(readings, axis=0), [0.0, 0.0, 0.0, 0.0, 0.0, G], atol=0.02)
    np.testing.assert_allclose(np.std(readings, axis=0), [0.01] * 3 + [0.05] * 3, rtol=0.2)


def test_its_quality_holds_for_the_filter_from_the_start_on() -> None:
    error = InertialIekf.quality(CONFIG, MISSION).error
    for estimate, _ in flown(0, np.zeros(9), 1.5, CONFIG, TICK):
        assert estimate.covariance is not None
        deviations = np.diag(estimate.covariance)
        assert np.all(deviations[:3] <= error[0, 0])
        assert np.all(deviations[3:] <= error[1, 1])
    noisier = dataclasses.replace(MISSION, inertial=InertialQuality(0.05, 0.5))
    assert np.all(np.diag(InertialIekf.quality(CONFIG, noisier).error)[:2] > np.diag(error)[:2])
