"""The equations of motion: gravity, energy, momentum, the lag of the rotors, and agreement with MuJoCo."""

from __future__ import annotations

import dataclasses
from typing import Any

import mujoco
import numpy as np
import pytest

from mathnavi.interfaces.signals import Array
from mathnavi.models.quadrotor.dynamics import (
    ATTITUDE,
    NOMINAL,
    RATE,
    VELOCITY,
    Quadrotor,
    at_rest,
    dynamics,
    flow,
    rigid_dynamics,
)  # fmt: skip
from tests.models.quadrotor.rotors import rotor_thrusts
from tests.quadrotor import HIGH, built, plain

ODD = Quadrotor(
    mass=0.9, inertia=(0.008, 0.011, 0.017), arm=0.17, moment_ratio=0.02, thrust_max=6.0, motor_lag=0.05,
    drag=(0.2, 0.4, 0.6), gravity=3.7,
)  # fmt: skip
SMOOTH = dataclasses.replace(NOMINAL, drag=(0.0, 0.0, 0.0))

vehicles = pytest.mark.parametrize("vehicle", [NOMINAL, ODD], ids=["nominal", "odd"])


def drawn(rng: np.random.Generator) -> Array:
    x = np.concatenate([HIGH, rng.standard_normal(4), rng.uniform(-12.0, 12.0, 3), rng.uniform(-8.0, 8.0, 3)])
    x[ATTITUDE] /= np.linalg.norm(x[ATTITUDE])
    return x


def energy(vehicle: Quadrotor, x: Array) -> float:
    v, omega = x[VELOCITY], x[RATE]
    kinetic = vehicle.mass * (v @ v) + omega @ (np.array(vehicle.inertia) * omega)
    return float(0.5 * kinetic + vehicle.mass * vehicle.gravity * x[2])


@vehicles
def test_accelerations_are_those_of_mujoco(vehicle: Quadrotor) -> None:
    model, rng = built(plain(), vehicle), np.random.default_rng(1)
    data = mujoco.MjData(model)
    for _ in range(40):
        x, thrusts = drawn(rng), rng.uniform(0.0, vehicle.thrust_max, 4)
        data.qpos[:], data.qvel[:] = x[:7], x[7:]
        data.act[:] = thrusts - vehicle.hover_thrust
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(rotor_thrusts(model, data, "quad"), thrusts, atol=1e-12)
        rate = np.array(rigid_dynamics(vehicle)(x, thrusts))[:, 0]
        np.testing.assert_allclose(rate[7:], data.qacc, rtol=1e-9, atol=1e-9)
        np.testing.assert_array_equal(rate[:3], x[VELOCITY])


@vehicles
def test_a_flight_with_the_rotors_lag_is_that_of_mujoco(vehicle: Quadrotor) -> None:
    model, rng = built(plain(), vehicle), np.random.default_rng(2)
    data, f, h = mujoco.MjData(model), dynamics(vehicle), float(built(plain(), vehicle).opt.timestep)
    x, thrusts = drawn(rng), np.full(4, vehicle.hover_thrust)
    data.qpos[:], data.qvel[:] = x[:7], x[7:]

    def rates(state: Array, u: Array) -> Array:
        parts: Any = f(state[:13], state[13:], u)
        return np.concatenate([np.array(part)[:, 0] for part in parts])

    whole = np.concatenate([x, thrusts])
    for k in range(90):
        if k % 15 == 0:
            u = rng.uniform(0.0, vehicle.thrust_max, 4)
        data.ctrl[:4] = u - vehicle.hover_thrust
        mujoco.mj_step(model, data)
        k_1 = rates(whole, u)
        k_2 = rates(whole + 0.5 * h * k_1, u)
        k_3 = rates(whole + 0.5 * h * k_2, u)
        k_4 = rates(whole + h * k_3, u)
        whole = whole + h / 6.0 * (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4)
    np.testing.assert_allclose(whole[:13], np.concatenate([data.qpos, data.qvel]), rtol=0.0, atol=2e-4)
    np.testing.assert_allclose(whole[13:], rotor_thrusts(model, data, "quad"), rtol=0.0, atol=1e-6)


def test_without_thrust_it_falls() -> None:
    x = flow(SMOOTH, at_rest(HIGH), np.zeros(4), 1.5)
    assert x[2] == pytest.approx(HIGH[2] - 0.5 * 9.81 * 1.5**2, abs=1e-9)
    assert x[9] == pytest.approx(-9.81 * 1.5, abs=1e-9)


def test_tumbling_without_thrust_and_drag_keeps_energy_and_momentum() -> None:
    x = drawn(np.random.default_rng(3))
    after = flow(SMOOTH, x, np.zeros(4), 1.0)
    assert energy(SMOOTH, after) == pytest.approx(energy(SMOOTH, x), rel=1e-6)
    spin = [np.linalg.norm(np.array(SMOOTH.inertia) * each[RATE]) for each in (x, after)]
    assert spin[1] == pytest.approx(spin[0], rel=1e-6)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("mass", 0.0), ("mass", np.nan), ("motor_lag", -1.0), ("thrust_max", 2.0), ("inertia", (1.0, 1.0, 3.0)),
        ("inertia", (0.0, 1.0, 1.0)), ("inertia", (1.0, 1.0)), ("drag", (0.1, -0.1, 0.1)), ("drag", (np.inf, 0.0, 0.0)),
    ],
)  # fmt: skip
def test_a_vehicle_that_cannot_be_is_refused(field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=rf"{field} = .*"):
        dataclasses.replace(NOMINAL, **{field: value})
