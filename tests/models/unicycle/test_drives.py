"""Drives: the ideal one is exact, the wheels of the differential one follow their inputs as far as they grip."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.kernels import integrate
from mathnavi.models.unicycle.mission import RIM_ACCELERATION, TRACK, WHEEL_RADIUS, inputs_of, wheel_rates
from mathnavi.models.unicycle.patterns import figure_eight
from mathnavi.sim.engine.plant import MujocoPlant
from tests.unicycle import plant_of


def inputs(plant: MujocoPlant, before: Array, dt: float) -> tuple[Array, Array]:
    """u (2,) as the wheels and as the body have it, since a state, over dt [s]."""
    after = plant.state("robot")
    half = len(after) // 2
    turned = after[2] - before[2]
    along = before[2] + 0.5 * turned
    speed = ((after[0] - before[0]) * math.cos(along) + (after[1] - before[1]) * math.sin(along)) / dt
    wheels = inputs_of((after[half - 2 : half] - before[half - 2 : half]) / dt)
    return wheels, np.array([speed, turned / dt])


@given(st.floats(-2.0, 2.0), st.floats(-5.0, 5.0))
def test_wheels_that_do_not_slip_tell_the_input(u_1: float, u_2: float) -> None:
    u = np.array([u_1, u_2])
    left, right = wheel_rates(u)
    assert 0.5 * WHEEL_RADIUS * (left + right) == pytest.approx(u_1, abs=1e-12)
    assert WHEEL_RADIUS * (right - left) == pytest.approx(u_2 * TRACK, abs=1e-12)
    np.testing.assert_allclose(inputs_of(wheel_rates(u)), u, rtol=0.0, atol=1e-13)


def test_the_ideal_robot_moves_along_the_exact_arcs_of_its_inputs() -> None:
    plant, rng = plant_of((-0.5, 0.2, 0.7)), np.random.default_rng(0)
    x, wheels = plant.state("robot")[:3], np.zeros(2)
    for _ in range(500):
        u = rng.uniform([-0.5, -3.0], [0.5, 3.0])
        plant.step({"robot": u})
        x, wheels = integrate(x, *u, plant.dt), wheels + wheel_rates(u) * plant.dt
    np.testing.assert_allclose(plant.state("robot")[:3], x, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(plant.state("robot")[3:5], wheels, rtol=0.0, atol=1e-12)


def test_without_a_command_the_ideal_robot_stands_still() -> None:
    plant = plant_of((0.5, 0.2, 0.7))
    plant.step({"robot": np.array([1.0, 1.0])}, 3)
    before = plant.state("robot")
    plant.step({}, 10)
    np.testing.assert_allclose(plant.state("robot")[:5], before[:5], atol=1e-15)


@pytest.mark.parametrize("friction", [0.15, 1.0])
def test_once_they_grip_wheels_tell_how_the_robot_moves(friction: float) -> None:
    plant = plant_of((0.0, 0.0, 0.5 * math.pi), "differential", friction)
    slips = []
    for k in range(600):
        before = plant.state("robot")
        plant.step({"robot": np.array(figure_eight((k + 0.5) * 0.01, 0.5, 8.0))}, 10)
        wheels, body = inputs(plant, before, 0.01)
        slips.append(wheels - body)
    later = np.array(slips)[200:]
    assert np.abs(later[:, 0]).max() < 0.01
    assert np.abs(later[:, 1]).max() < 0.03
    assert plant.contacts("robot") == 0


def test_on_a_slippery_floor_wheels_spin() -> None:
    plants = {friction: plant_of((0.0, 0.0, 0.0), "differential", friction) for friction in (0.02, 1.0)}
    for plant in plants.values():
        plant.step({"robot": np.array([1.0, 0.0])}, 2000)  # servos take a second to come up to speed
    slow, fast = (plants[friction].state("robot")[0] for friction in (0.02, 1.0))
    assert slow < 0.3 * fast
    half = len(plants[0.02].state("robot")) // 2
    assert WHEEL_RADIUS * plants[0.02].state("robot")[2 * half - 1] == pytest.approx(1.0, abs=0.1)


def test_a_robot_that_stands_stays_where_it_is_upright() -> None:
    plant = plant_of((0.3, -0.2, 1.0), "differential")
    plant.step({"robot": np.zeros(2)}, 1000)
    x = plant.state("robot")
    np.testing.assert_allclose(x[:3], [0.3, -0.2, 1.0], atol=1e-6)
    np.testing.assert_allclose(x[3:6], 0.0, atol=1e-3)
    np.testing.assert_allclose(x[8:], 0.0, atol=1e-4)


def test_a_servo_takes_up_another_speed_steadily() -> None:
    plant = plant_of((0.0, 0.0, 0.0), "differential")
    rims = []
    for _ in range(3):
        plant.step({"robot": np.array([1.0, 0.0])}, 80)
        rims.append(WHEEL_RADIUS * plant.state("robot")[-2:])
    assert rims[0].max() < rims[1].min() < 1.0
    np.testing.assert_allclose((rims[1] - rims[0]) / 0.08, RIM_ACCELERATION, rtol=0.1)
    plant.step({"robot": np.array([1.0, 0.0])}, 300)
    np.testing.assert_allclose(WHEEL_RADIUS * plant.state("robot")[-2:], 1.0, atol=0.01)
