"""The quadrotor's readings in the terms of the planner and of the tracker."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.quadrotor_state import QuadrotorState
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Measurement, Status
from mathnavi.models.quadrotor.dynamics import ATTITUDE, NOMINAL, POSITION, RATE, VELOCITY, flow
from mathnavi.models.quadrotor.mission import QuadrotorMission, QuadrotorStateSensor
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from tests.quadrotor import HIGH, PERIOD, built, flight_mission, plain

MISSION = QuadrotorMission(flight_mission(plain(), (50.0, 50.0), (350.0, 350.0), position_noise=0.3))
CONFIG = QuadrotorState.Config()
X = np.concatenate([HIGH, [0.5, 0.5, -0.5, 0.5], [4.0, -3.0, 1.0], [0.3, -0.2, 0.1]])


def test_a_reading_is_split_in_point_mass_attitude_and_rate() -> None:
    estimator = QuadrotorState.build(CONFIG, MISSION)
    assert isinstance(estimator, Estimator)
    estimate = estimator.update(0.0, [Measurement("full_state", 0.0, X)], np.zeros(4))
    np.testing.assert_array_equal(estimate.x, [*HIGH, 4.0, -3.0, 1.0])
    np.testing.assert_array_equal(estimate.extra["attitude"], X[ATTITUDE])
    np.testing.assert_array_equal(estimate.extra["rate"], X[RATE])
    assert estimate.covariance is not None
    np.testing.assert_allclose(np.diag(estimate.covariance), [0.09] * 3 + [0.0] * 3)


def test_without_readings_the_model_goes_on() -> None:
    estimator, u = QuadrotorState.build(CONFIG, MISSION), np.array([3.0, 3.1, 2.9, 3.0])
    estimator.update(0.0, [Measurement("full_state", 0.0, X)], u)
    after = estimator.update(PERIOD, [], u)
    expected = flow(NOMINAL, X, u, PERIOD)
    np.testing.assert_allclose(after.x, np.concatenate([expected[POSITION], expected[VELOCITY]]))
    np.testing.assert_allclose(after.extra["attitude"], expected[ATTITUDE])
    assert estimator.update(1.0, [], u).status is Status.LOST


def test_before_a_reading_it_is_where_the_mission_starts_with_its_nose_to_the_target() -> None:
    estimate = QuadrotorState.build(CONFIG, MISSION).update(0.0, [], np.zeros(4))
    assert estimate.status is Status.INITIALISING
    np.testing.assert_array_equal(estimate.x[:3], MISSION.flight.start)
    half = np.pi / 8.0
    np.testing.assert_allclose(estimate.extra["attitude"], [np.cos(half), 0.0, 0.0, np.sin(half)])


def test_a_sensor_in_mujoco_reads_the_state_with_its_noise() -> None:
    (sensor,) = QuadrotorState.sensors(CONFIG, MISSION)
    plant = MujocoPlant(built(plain(), NOMINAL), {"quad": VehicleSetup(X, (sensor,))}, np.random.default_rng(0))
    readings = []
    for _ in range(400):
        readings.append(plant.sense("quad")[0].value - X)
    errors = np.array(readings)
    np.testing.assert_array_equal(errors[:, 3:], 0.0)
    assert errors[:, :3].std() == pytest.approx(0.3, rel=0.1)
    assert np.abs(errors).max() <= np.sqrt(3.0) * 0.3
    np.testing.assert_array_equal(plant.state("quad"), X)


def test_its_quality_is_that_of_the_point_mass() -> None:
    np.testing.assert_allclose(QuadrotorState.quality(CONFIG, MISSION).error, np.diag([0.09, 0.0, 0.0]))
    assert QuadrotorState.properties(CONFIG).note


@pytest.mark.parametrize("noise", [-0.1, np.nan, np.inf])
def test_a_noise_that_cannot_be_is_refused(noise: float) -> None:
    with pytest.raises(ValueError, match=r"position_noise = .*; allowed"):
        QuadrotorStateSensor(noise)
