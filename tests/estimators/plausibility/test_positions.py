"""Logs of mechanisms in degrees, of the other sign, before a gear, with the scalar last, and those that are right."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import mujoco
import numpy as np
import pytest

import mathnavi as mn
from mathnavi.interfaces.signals import Array

ARM = """
<mujoco><option timestep="0.005"/><worldbody>
  <body><joint name="rail" type="slide" axis="1 0 0"/><geom size=".1" mass="2"/>
    <body><joint name="shoulder" axis="0 1 0" damping=".05"/><geom type="capsule" fromto="0 0 0 0 0 -.4" size=".04"/>
      <body pos="0 0 -.4"><joint name="elbow" axis="0 1 0" limited="true" range="-20 140"/>
        <geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03"/></body></body></body>
</worldbody><actuator><motor joint="rail"/><motor joint="shoulder"/><motor joint="elbow"/></actuator>
<keyframe><key qpos="0 .4 .9"/></keyframe></mujoco>"""
PENDULUM = """
<mujoco><option timestep="0.005"/><worldbody><body><joint name="pivot" axis="0 1 0" damping=".01"/>
  <geom type="capsule" fromto="0 0 0 0 0 -.4" size=".04"/></body></worldbody><actuator><motor joint="pivot"/></actuator>
<keyframe><key qpos=".4"/></keyframe></mujoco>"""
BODY = """
<mujoco><option timestep="0.005" gravity="0 0 0"/><worldbody>
  <body><freejoint name="hull"/><geom type="box" size=".1 .2 .3" mass="1"/><site name="hub"/></body>
</worldbody><actuator><motor site="hub" gear="0 0 1 0 .1 0"/><motor site="hub" gear="0 0 0 .2 0 .1"/></actuator>
</mujoco>"""
NOISE = 1e-4
AMPLITUDES, FREQUENCIES, PHASES = np.array([[3.0, 1.0, 0.5], [3.0, 4.0, 5.0], [0.0, 1.0, 2.0]])


@cache
def logged(text: str, load: float = 1.0, seconds: float = 3.0) -> tuple[mujoco.MjModel, Array, Array, Array]:
    """Model, times, readings with a noise of 0.1 mrad, and inputs of a motion."""
    model = mujoco.MjModel.from_xml_string(text)
    plant = mujoco.MjModel.from_xml_string(text)
    plant.body_mass[-1] *= load
    data, t, y, u = mujoco.MjData(plant), [], [], []
    if plant.nkey:
        mujoco.mj_resetDataKeyframe(plant, data, 0)
    for _ in range(round(seconds / plant.opt.timestep)):
        data.ctrl[:] = (AMPLITUDES * np.sin(FREQUENCIES * data.time + PHASES))[: plant.nu]
        t.append(data.time), y.append(data.qpos.copy()), u.append(data.ctrl.copy())
        mujoco.mj_step(plant, data)
    manifold, rng = mn.MechanismSystem(model).manifold, np.random.default_rng(0)
    read = [manifold.point(manifold.check(q), NOISE * rng.standard_normal(model.nv)) for q in y]
    return model, np.array(t), np.array(read), np.array(u)


def said(text: str, changed: Callable[[Array], Array], **log: object) -> str:
    """What is said of a log whose readings were changed; "" if it is estimated."""
    model, t, y, u = logged(text)
    mission = mn.LagrangianMission(mn.MechanismSystem(model), mn.PositionQuality(noise=NOISE), 0.005, 50.0)
    try:
        mn.estimate("high_gain", mission, mn.SensorLog(t, {"position": changed(y)}, u, **log))  # type: ignore[arg-type]
    except mn.LogError as error:
        return str(error)
    return ""


@pytest.mark.refused("sensor log", "angles in degrees")
@pytest.mark.refused("sensor log", "lengths in millimetres")
@pytest.mark.refused("sensor log", "a joint with the other sign")
@pytest.mark.parametrize(
    ("factors", "expected"),
    [
        ((1.0, 1.0, 1.0), ""),
        ((1.0, 180.0 / np.pi, 180.0 / np.pi), "as degrees in columns 1, 2 (joints shoulder, elbow"),
        ((1e3, 1.0, 1.0), "as millimetres in column 0 (joint rail"),
        ((1.0, -1.0, 1.0), "with the other sign in column 1"),
    ],
)
def test_a_unit_or_a_sign_is_found_by_the_motion_of_the_model(factors: tuple[float, ...], expected: str) -> None:
    found = said(ARM, lambda y: y * factors)
    assert expected in found
    assert ("log: the readings of position fit the model's motion" in found and "allowed: " in found) == bool(expected)


@pytest.mark.refused("sensor log", "angles before a gear")
def test_a_gear_between_joint_and_encoder_is_found() -> None:
    assert "before a gear of about 50 in column 0 (joint pivot" in said(PENDULUM, lambda y: 50.0 * y)


@pytest.mark.refused("sensor log", "an encoder from 0 to 360 degrees")
def test_an_encoder_that_starts_again_at_360_is_one_in_degrees() -> None:
    assert "as degrees in column 0" in said(PENDULUM, lambda y: np.degrees(y) % 360.0)


@pytest.mark.refused("sensor log", "quaternions with the scalar last")
@pytest.mark.honoured("sensor log", "quaternions with the scalar last, declared")
@pytest.mark.parametrize(
    ("roll", "declared", "expected"),
    [(0, "wxyz", ""), (-1, "xyzw", ""), (-1, "wxyz", 'quaternions="xyzw"'), (0, "xyzw", 'quaternions="wxyz"')],
)
def test_quaternions_in_another_order_than_declared_are_refused(roll: int, declared: str, expected: str) -> None:
    def changed(y: Array) -> Array:
        return np.hstack([y[:, :3], np.roll(y[:, 3:], roll, axis=1)])

    assert expected in (found := said(BODY, changed, quaternions=declared))
    assert bool(found) == bool(expected)


@pytest.mark.honoured("sensor log", "quaternions of either sign")
def test_a_quaternion_and_its_negative_are_one_rotation() -> None:
    signs = np.where(np.arange(600) % 3, 1.0, -1.0)[:, None]
    assert said(BODY, lambda y: np.hstack([y[:, :3], y[:, 3:] * signs])) == ""


@pytest.mark.refused("sensor log", "angles beyond the limits of a joint")
@pytest.mark.parametrize(
    ("factor", "expected"), [(180.0 / np.pi, "as degrees in column"), (-1.0, "the other sign in column 2")]
)
def test_the_limits_of_a_joint_are_evidence_without_inputs(factor: float, expected: str) -> None:
    """Between -20 and 140 degrees, and nothing is known of the forces that moved the arm."""
    model, t, _, _ = logged(ARM)
    elbow = 1.2 + 0.9 * np.sin(t + np.sin(20.0 * t))
    y = np.column_stack([0.0 * t, 0.1 * np.sin(9.0 * t), factor * elbow])
    mission = mn.LagrangianMission(mn.MechanismSystem(model), period=0.005, speed_max=50.0)
    with pytest.raises(mn.LogError, match="fit the limits of joint elbow only") as error:
        mn.estimate("high_gain", mission, mn.SensorLog(t, {"position": y}))
    assert expected in str(error.value)
    assert len(mn.estimate("high_gain", mission, mn.SensorLog(t, {"position": y}), trust_units=True).x) == len(t)


@pytest.mark.parametrize("load", [0.3, 2.0])
def test_a_load_that_the_model_lacks_is_no_other_unit(load: float) -> None:
    model, t, y, u = logged(ARM, load)
    mission = mn.LagrangianMission(mn.MechanismSystem(model), mn.PositionQuality(noise=NOISE), 0.005, 50.0)
    assert len(mn.estimate("high_gain", mission, mn.SensorLog(t, {"position": y}, u)).x) == len(t)
    assert len(mn.estimate("high_gain", mission, mn.SensorLog(t, {"position": y})).x) == len(t)


@pytest.mark.refused("sensor log", "quaternions not of length 1")
def test_a_quaternion_of_another_length_is_refused_with_its_place() -> None:
    def changed(y: Array) -> Array:
        y = y.copy()
        y[7, 3:] *= 1.02
        return y

    assert "position[7, 3:7] = (" in (found := said(BODY, changed))
    assert "at 0.035 s is a quaternion of length 1.02, one of 1 such; allowed: a length of 1 +- 0.01" in found
    assert said(BODY, lambda y: y.round(3)) == ""


def test_an_observer_that_is_stepped_says_what_its_first_readings_are() -> None:
    model, t, y, u = logged(ARM)
    observer = mn.VelocityObserver(model, "high_gain", noise=NOISE, speed_max=50.0)
    for k in range(len(t)):
        assert observer.step(0.005 * bool(k), y[k], u[k - 1] if k else None).status is mn.Status.OK or k < 100
    observer = mn.VelocityObserver(model, "high_gain", noise=NOISE, speed_max=50.0)
    found = [
        observer.step(0.005, each, command) for each, command in zip(y * [1.0, 57.29578, 57.29578], u, strict=True)
    ]
    assert found[-1].status is mn.Status.LOST
    assert "it finds that the readings of position fit" in repr(found[-1])
    assert "only as degrees" in repr(found[-1])
    trusting = mn.VelocityObserver(model, "high_gain", noise=NOISE, trust_units=True)
    assert [trusting.step(0.005, each).status for each in y * 57.29578][-1] is not mn.Status.LOST


def test_a_long_gap_and_few_readings_are_no_evidence() -> None:
    model, t, y, u = logged(ARM)
    mission = mn.LagrangianMission(mn.MechanismSystem(model), mn.PositionQuality(noise=NOISE), 0.005, 50.0)
    later = np.where(np.arange(len(t)) < 300, t, t + 20.0)
    seldom = np.where((np.arange(len(t)) % 100 == 0)[:, None], y, np.nan)
    for times, read in ((later, y), (t, seldom), (t, np.full_like(y, np.nan)), (t, np.zeros_like(y))):
        assert len(mn.estimate("high_gain", mission, mn.SensorLog(times, {"position": read}, u)).x) == len(t)
    with pytest.raises(mn.LogError, match="only as degrees"):
        mn.estimate("high_gain", mission, mn.SensorLog(later, {"position": y * [1.0, 57.2958, 57.2958]}, u))
