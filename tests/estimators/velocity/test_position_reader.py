"""Encoders that start again after a turn: the angle goes on, and the velocity does not notice."""

from __future__ import annotations

import math
from collections.abc import Callable

import mujoco
import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.velocity.readings import PositionReader
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.mechanism.geometry import MechanismManifold

HINGE = """<mujoco><compiler angle="radian"/><worldbody><body><joint name="a" axis="0 1 0" {}/>
<geom type="capsule" size=".04" fromto="0 0 0 0 0 -.5" mass="1"/></body></worldbody>
<actuator><motor joint="a"/></actuator></mujoco>"""
TURN = 2.0 * math.pi
WRAPS: dict[str, Callable[[Array], Array]] = {
    "it counts turns": lambda angle: angle,
    "0 to 2 pi": lambda angle: angle % TURN,
    "-pi to pi": lambda angle: (angle + math.pi) % TURN - math.pi,
    "-1 to 2 pi - 1": lambda angle: (angle + 1.0) % TURN - 1.0,
}


def read(model: mujoco.MjModel, times: Array, angles: Array) -> Array:
    reader = PositionReader(MechanismManifold(model))
    points = [reader.read(Measurement("position", float(t), np.array([a]))) for t, a in zip(times, angles, strict=True)]
    return np.array([point[0] for point in points if point is not None])


@pytest.mark.parametrize("wrap", WRAPS.values(), ids=WRAPS)
@pytest.mark.parametrize("speed", [3.0, -40.0])
def test_an_angle_goes_on_from_turn_to_turn(wrap: Callable[[Array], Array], speed: float) -> None:
    model = mujoco.MjModel.from_xml_string(HINGE.format(""))
    rng = np.random.default_rng(0)
    times = np.cumsum(rng.uniform(0.002, 0.06, 400))  # some readings are missing
    angles = 0.3 + speed * times + 2.0 * np.sin(times)
    found = read(model, times, wrap(angles))
    np.testing.assert_allclose(found - found[0], angles - angles[0], atol=1e-9)


def test_after_a_gap_the_angle_is_the_nearest_and_turns_are_not_known_where_the_joint_may_have_made_one() -> None:
    model = mujoco.MjModel.from_xml_string(HINGE.format(""))
    reader = PositionReader(MechanismManifold(model))

    def read_one(t: float, angle: float) -> float:
        found = reader.read(Measurement("position", t, np.array([angle])))
        assert found is not None
        return float(found[0])

    for k in range(100):
        read_one(0.01 * k, 0.5 * 0.01 * k)
    assert read_one(2.0, 0.9) == 0.9
    assert reader.unknown_turns == []
    for k in range(1, 100):
        read_one(2.0 + 0.01 * k, 0.9 + 3.0 * 0.01 * k - 3.0)
    assert read_one(5.0, 0.3) == 0.3  # it was led to 6 rad, and swings
    assert reader.unknown_turns == [0]
    read_one(5.01, 0.33)
    read_one(5.02, -6.2)
    read_one(5.03, 0.3)
    assert reader.unknown_turns == []  # it counts turns


def test_where_a_joint_has_limits_the_reading_is_the_angle_within_them() -> None:
    model = mujoco.MjModel.from_xml_string(HINGE.format('limited="true" range="-1.5 1.5"'))
    times = 0.01 * np.arange(600)
    angles = 1.4 * np.sin(2.0 * times)
    for wrap in WRAPS.values():
        np.testing.assert_allclose(read(model, times, wrap(angles)), angles, atol=1e-9)
    np.testing.assert_array_equal(read(model, times, angles), angles)  # to the bit


@pytest.mark.parametrize("method", ["riemannian_observer", "lagrangian_ekf", "moving_horizon", "high_gain"])
def test_the_velocity_is_that_of_an_encoder_that_counts_turns(method: str) -> None:
    model = mujoco.MjModel.from_xml_string(HINGE.format('damping=".02"'))
    model.opt.timestep = 0.005
    data, angles = mujoco.MjData(model), []
    data.qvel[:] = 12.0
    for _ in range(400):
        angles.append(data.qpos.copy())
        mujoco.mj_step(model, data)
    mission = mn.LagrangianMission(
        mn.MechanismSystem(model), mn.PositionQuality(noise=1e-3), period=0.005, speed_max=40.0
    )
    whole, turned = (
        mn.estimate(method, mission, mn.SensorLog(0.005 * np.arange(400), {"position": wrap(np.array(angles))}))
        for wrap in (WRAPS["it counts turns"], WRAPS["0 to 2 pi"])
    )
    np.testing.assert_allclose(turned.x[:, 1], whole.x[:, 1], atol=1e-6)
