"""Logs of an IMU and position fixes in other units and axes, and those that are right."""

from __future__ import annotations

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.interfaces.signals import Array
from mathnavi.models.mechanism.entity import build_model

HZ, FIX, NOISE = 40, 8, 0.05
START = (50.0, 50.0, 80.0)
FLIGHT = mn.FlightMission(
    mn.HeightField(np.zeros((2, 2)), 1000.0), START, (90.0, 50.0, 80.0), position_noise=NOISE, control_period=1.0 / HZ
)
DEGREES, G = 180.0 / np.pi, 1.0 / 9.80665


def flown() -> tuple[Array, Array, Array]:
    """Times, IMU and fixes of circles that are flown level for 30 s, the nose along them."""
    rng, w, r = np.random.default_rng(0), 0.6, 10.0
    t = np.arange(30 * HZ) / HZ
    still = np.zeros_like(t)
    place = np.column_stack([r * np.sin(w * t), r * (1.0 - np.cos(w * t)), still]) + START
    imu = np.column_stack([still, still, still + w, still, still + r * w * w, still + 9.81])
    imu += rng.standard_normal(imu.shape) * [0.005, 0.005, 0.005, 0.05, 0.05, 0.05]
    fixes = place + NOISE * rng.standard_normal(place.shape)
    return t, imu, np.where((np.arange(len(t)) % FIX == 0)[:, None], fixes, np.nan)


def said(factors: list[float], offset: list[float]) -> str:
    """What is said of the log of an IMU whose readings were changed; "" if it is estimated."""
    t, imu, fixes = flown()
    log = mn.SensorLog(t, {"imu": imu * factors + offset, "position": fixes})
    try:
        mn.estimate("inertial_iekf", mn.QuadrotorMission(FLIGHT), log, start_attitude=0.1, start_velocity=10.0)
    except mn.LogError as error:
        return str(error)
    return ""


NONE = [0.0] * 6


@pytest.mark.refused("sensor log", "a gyro in degrees per second")
@pytest.mark.refused("sensor log", "an accelerometer in g")
@pytest.mark.refused("sensor log", "an accelerometer with the other sign, or without gravity")
@pytest.mark.refused("sensor log", "an IMU with axes down")
@pytest.mark.parametrize(
    ("factors", "offset", "expected"),
    [
        ([1.0] * 6, NONE, ""),
        ([1.0] * 6, [0.05, -0.05, 0.05, 0.0, 0.0, 0.0], ""),  # a bias of the gyro
        ([1.0] * 6, [0.0, 0.0, 0.0, 0.3, -0.3, 0.3], ""),  # and of the accelerometer
        ([DEGREES] * 3 + [1.0] * 3, NONE, "as deg/s in columns 0, 1, 2, the gyro; allowed: rad/s"),
        ([1.0] * 3 + [G] * 3, NONE, "in g in columns 3, 4, 5, the accelerometer; allowed: m/s^2"),
        ([DEGREES] * 3 + [G] * 3, NONE, "as deg/s in columns 0, 1, 2, the gyro and in g in columns 3, 4, 5"),
        ([1.0] * 3 + [-1.0] * 3, NONE, "attitude at the start only with the other sign in columns 3, 4, 5"),
        ([1.0, -1.0, -1.0] * 2, NONE, "attitude at the start only the other way in columns 1, 2, 4, 5"),
        ([1.0] * 6, [0.0] * 5 + [-9.81], "without gravity in columns 3, 4, 5"),
    ],
)
def test_units_and_axes_of_an_imu_are_found_by_the_fixes(
    factors: list[float], offset: list[float], expected: str
) -> None:
    found = said(factors, offset)
    assert expected in found
    assert bool(found) == bool(expected)


@pytest.mark.refused("sensor log", "an IMU on a base in other units")
@pytest.mark.parametrize(
    ("factors", "expected"),
    [
        ([1.0] * 6, ""),
        ([1.0] * 3 + [G] * 3, "in g in columns 3, 4, 5"),
        ([1.0] * 3 + [-1.0] * 3, "gravity at the start only with the other sign"),
        ([DEGREES] * 3 + [1.0] * 3, "the direction of gravity only as deg/s"),
    ],
)
def test_the_imu_of_a_base_is_compared_with_gravity_while_a_foot_stands(factors: list[float], expected: str) -> None:
    t, system = 0.005 * np.arange(400), mn.MechanismSystem(build_model("quadruped"))
    roll, rate = 0.2 * np.sin(3.0 * t), 0.6 * np.cos(3.0 * t)
    still = np.zeros_like(t)
    base = np.column_stack([rate, still, still, still, 9.81 * np.sin(roll), 9.81 * np.cos(roll)])
    mounting = system.floating_base.mounting
    imu = np.hstack([base[:, :3] @ mounting, base[:, 3:] @ mounting])
    feet = np.ones((len(t), len(system.floating_base.feet)))
    joints = np.tile(system.manifold.origin[7:], (len(t), 1))
    log = mn.SensorLog(t, {"imu": imu * factors, "joints": joints, "feet": feet})
    mission = mn.LagrangianMission(system, period=0.005)
    if not expected:
        assert len(mn.estimate("floating_base_iekf", mission, log).x) == len(t)
        return
    with pytest.raises(mn.LogError, match=expected):
        mn.estimate("floating_base_iekf", mission, log)
