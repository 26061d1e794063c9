"""The empirical Gramian of a scenario is that of the theory, and noise does not show in it."""

from __future__ import annotations

from functools import cache

import mujoco
import numpy as np
import pytest

from mathnavi.interfaces.protocols import Plant, Sensor
from mathnavi.models.aerial.dynamics import TICK
from mathnavi.models.aerial.entity import build_model
from mathnavi.models.aerial.mission import AccelerationSensor, FullStateSensor, PositionSensor
from mathnavi.models.sensor_faults import Dropout
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.engine.faults import Disturbed, Gusts
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.metrics.observability import EmpiricalGramian, empirical_gramian

START = np.array([1000.0, 1000.0, 500.0, 10.0, -5.0, 0.0])
NAMES = tuple(f"{what}_{axis} [{unit}]" for what, unit in (("position", "m"), ("velocity", "m/s")) for axis in "xyz")
DELTAS = dict.fromkeys(NAMES, 0.5)
STEPS, EVERY = 60, 5  # of the replay, ticks each


@cache
def model() -> mujoco.MjModel:
    return build_model(HeightField(np.zeros((5, 5)), 500.0), ["uav"], 40.0)


def plant(*sensors: Sensor, gust: float = 0.0) -> Plant:
    rng, gusting = np.random.default_rng(3).spawn(2)
    body = MujocoPlant(model(), {"uav": VehicleSetup(START, sensors)}, rng)
    return Disturbed(body, [Gusts(gust, 3.0, 4.0, gusting)]) if gust else body


def gramian(*sensors: Sensor, gust: float = 0.0, deviation: float = 1.0) -> EmpiricalGramian:
    commands = np.random.default_rng(0).uniform(-5.0, 5.0, (STEPS, 3))
    deviations = {sensor.name: deviation for sensor in sensors}
    return empirical_gramian(lambda: plant(*sensors, gust=gust), "uav", {"uav": commands}, EVERY, DELTAS, deviations)


def expected(rate: float, deviation: float = 1.0) -> np.ndarray:
    """sum_k C_k^T C_k / deviation^2 with C_k = [I, t_k I]: p(t) = p_0 + v_0 t + what does not hang on the start."""
    t = np.arange(0.0, STEPS * EVERY * TICK + 1e-9, 1.0 / rate)
    block = np.array([[len(t), t.sum()], [t.sum(), (t * t).sum()]]) / deviation**2
    return np.kron(block, np.eye(3))


@pytest.mark.parametrize("gust", [0.0, 2.0])
@pytest.mark.parametrize("noise", [0.0, 5.0])
def test_of_positions_it_is_that_of_a_double_integrator_whatever_the_noise(noise: float, gust: float) -> None:
    found = gramian(PositionSensor(noise, rate=10.0), gust=gust, deviation=5.0)
    assert found.names == NAMES
    np.testing.assert_allclose(found.total, expected(10.0, 5.0), rtol=1e-9, atol=1e-9)
    assert len(found.unseen(np.ones(6))) == 0


def test_it_adds_up_over_sensors() -> None:
    found = gramian(PositionSensor(rate=10.0), FullStateSensor(), AccelerationSensor())
    assert set(found.by_sensor) == {"position", "full_state", "acceleration"}
    np.testing.assert_allclose(found.total, sum(found.by_sensor.values()))
    np.testing.assert_allclose(found.by_sensor["position"], expected(10.0), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.by_sensor["acceleration"], 0.0, atol=1e-9)


def test_what_no_sensor_sees_is_named() -> None:
    found = gramian(AccelerationSensor(), PositionSensor(rate=1.0))
    assert len(found.unseen(np.ones(6))) == 0
    blind = EmpiricalGramian(found.names, {"position": np.diag([1.0, 0.0, 2.0, 1.0, 1.0, 1.0])})
    np.testing.assert_allclose(np.abs(blind.unseen(np.ones(6))), [[0.0, 1.0, 0.0, 0.0, 0.0, 0.0]])
    np.testing.assert_allclose(np.diag(blind.scaled([2.0, 1.0, 1.0, 1.0, 1.0, 3.0])), [4.0, 0.0, 2.0, 1.0, 1.0, 9.0])


def test_readings_that_are_lost_say_nothing() -> None:
    sensor = PositionSensor(rate=10.0)
    whole = gramian(sensor).total
    commands = {"uav": np.zeros((STEPS, 3))}

    def lossy() -> Plant:
        return plant(Dropout(sensor, 0.5, np.random.default_rng(7)))

    less = empirical_gramian(lossy, "uav", commands, EVERY, DELTAS).total
    assert 0.0 < less[0, 0] < whole[0, 0]
    assert less[0, 0] == pytest.approx(round(less[0, 0]))  # a whole number of readings


def test_some_components_may_be_moved_alone() -> None:
    sensor = PositionSensor(rate=10.0)
    commands = {"uav": np.zeros((STEPS, 3))}
    chosen = {NAMES[3]: 1.0, NAMES[0]: 0.1}
    found = empirical_gramian(lambda: plant(sensor), "uav", commands, EVERY, chosen)
    assert found.names == (NAMES[3], NAMES[0])
    np.testing.assert_allclose(found.total, expected(10.0)[np.ix_([3, 0], [3, 0])], rtol=1e-9)


def test_bad_arguments_are_refused() -> None:
    commands = {"uav": np.zeros((3, 3))}
    for deltas in ({}, {"position_q [m]": 1.0}, {NAMES[0]: 0.0}, {NAMES[0]: np.nan}):
        with pytest.raises(ValueError, match=r"deltas = .*allowed: positive numbers for some of"):
            empirical_gramian(lambda: plant(), "uav", commands, EVERY, deltas)
    for given, ticks in (({}, 5), (commands, 0), ({**commands, "other": np.zeros((2, 3))}, 5)):
        with pytest.raises(ValueError, match="allowed: one length, 1 tick or more"):
            empirical_gramian(lambda: plant(), "uav", given, ticks, DELTAS)
