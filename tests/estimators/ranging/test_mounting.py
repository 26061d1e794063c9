"""Sensors beside the middle of the axle: every estimator finds and follows the pose of the axle, or refuses them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest

import mathnavi as mn
from mathnavi.interfaces.errors import FieldError, MissionError
from mathnavi.interfaces.signals import Estimate, Status
from mathnavi.models.unicycle.entity import build_model
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.plugin.registry import load
from tests.estimators.integrity.test_ranging import ANGLES, NOISE, ODOMETRY, PERIOD, WALL, Drive, driven, sure_and_wrong
from tests.models.field.walls import FURNISHED

LASER, APART = ((0.3, 0.0),), ((0.15, 0.1), (0.15, -0.1), (-0.1, 0.0))
SHORT = round(8.0 / PERIOD)


def mission(mounting: Any, drive: Drive | None = None, angles: Any = ANGLES) -> RangingMission:
    start = None if drive is None else mn.KnownStart(tuple(drive.x[0]), (0.05, 0.05, 0.05))
    ranging, odometry = mn.RangeQuality(absolute=NOISE), mn.OdometryQuality(noise=ODOMETRY)
    return RangingMission(WALL, angles, ranging, odometry, start=start, period=PERIOD, mounting=mounting)


def followed(name: str, true: Any, declared: Any, angles: Any = ANGLES) -> tuple[list[Estimate], Drive]:
    """Estimates of a drive whose ranges are those of sensors at ``true`` places; only the bank finds the start."""
    drive = Drive(*(each[:SHORT] for each in driven(1)))
    kind: Any = load("estimators", name)
    estimator = kind.build(kind.Config(), mission(declared, None if name == "feasible_set_bank" else drive, angles))
    found, sensors = [], mission(true, angles=angles)
    for k, (pose, u) in enumerate(zip(drive.x, drive.odometry, strict=True)):
        t, noise = PERIOD * (k + 1), drive.ranges[k] - WALL.ranges(pose, ANGLES)[0]
        ranges = mn.Measurement("ranges", t, sensors.ranges(pose) + noise)
        found.append(estimator.update(t, (ranges, mn.Measurement("odometry", t, u)), u))
    return found, drive


def error(found: list[Estimate], drive: Drive) -> float:
    """RMS of the position [m] over the second half."""
    d = np.array([each.x[:2] for each in found]) - drive.x[:, :2]
    return math.sqrt(2.0 * np.square(d[SHORT // 2 :]).mean())


@pytest.mark.parametrize(
    "name", ["feasible_set_bank", "range_ekf", "range_iekf", "range_ukf", "range_particle", "moving_horizon"]
)
def test_a_pose_is_followed_as_well_with_sensors_that_are_elsewhere(name: str) -> None:
    plain = error(*followed(name, (), ()))
    assert error(*followed(name, APART, APART)) < 1.5 * plain + 0.005


@pytest.mark.parametrize("name", ["feasible_set_bank", "range_ekf"])
def test_rangefinders_abreast_look_in_one_direction(name: str) -> None:
    abreast = ((0.1, 0.15), (0.1, -0.15), (0.0, 0.0))
    assert error(*followed(name, abreast, abreast, (0.0, 0.0, 2.0))) < 2.0 * error(*followed(name, (), ())) + 0.005


@pytest.mark.parametrize("name", ["feasible_set_bank", "range_ekf"])
def test_a_laser_ahead_of_where_it_is_declared_is_noticed(name: str) -> None:
    found, drive = followed(name, LASER, ())
    assert error(found, drive) > 0.1
    assert sure_and_wrong(found, drive) < 2.0
    assert not any(each.status is Status.OK for each in found[SHORT // 2 :])


def test_mujoco_reads_from_where_the_sensors_are() -> None:
    """As the mission expects; and a known place of the laser finds the pose in the closed loop."""
    task = RangingMission(FURNISHED, ANGLES, mounting=APART)
    model = build_model(FURNISHED, task.rays)
    data = mujoco.MjData(model)
    data.qpos[:3] = pose = np.array([3.0, 2.6, 0.7])
    model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
    mujoco.mj_forward(model, data)
    read = [data.sensor(f"robot/range_{i}").data[0] for i in range(len(ANGLES))]
    np.testing.assert_allclose(read, task.ranges(pose), atol=1e-6)
    run = mn.run("range-localisation", seed=3, sensors=(-60.0, 60.0, 180.0), mounting=LASER, duration=6.0)
    assert run.summary["converged"]
    assert run.summary["position_rms_m"] < 0.1


def test_theorems_of_rays_from_the_axle_refuse_other_sensors() -> None:
    moved = mission(LASER, driven(1))
    for name in ("range_observer", "range_certified"):
        kind: Any = load("estimators", name)
        with pytest.raises(MissionError, match=rf"mounting = \(\(0.3, 0.0\),\) with {name}; allowed: \(\)"):
            kind.build(kind.Config(), moved)
    with pytest.raises(MissionError, match=r"mounting = .* with the mode singular-value"):
        mn.run("range-localisation", **{"mounting": LASER, "planner.mode": "singular-value"})


@pytest.mark.parametrize("wrong", [((0.1, 0.0),) * 2, ((math.nan, 0.0),)])
def test_places_are_finite_and_one_or_one_for_each(wrong: Any) -> None:
    with pytest.raises((FieldError, MissionError), match="mounting"):
        replace(mission(()), mounting=wrong)
