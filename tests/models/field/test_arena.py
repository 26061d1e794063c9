"""The arena: MuJoCo's rangefinders measure to the curve itself, cameras and bumpers meet a wall just outside."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import mujoco
import numpy as np
import pytest

from mathnavi.interfaces.signals import Array
from mathnavi.models.field.arena import DRAWN_GROUP, SENSED_GROUP, SENSOR_HEIGHT
from mathnavi.models.field.curve import BEAN, EGG, Curve, ellipse
from mathnavi.models.unicycle.entity import RADIUS, build_model
from mathnavi.models.unicycle.kernels import rays_at

ANGLES = tuple(2.0 * math.pi * k / 7 for k in range(7))
TURNED = Curve(((0.4, 0.0, -0.3, 0.0), (2.6, 0.7, -0.9, 1.2)), "turned ellipse")
WALLS = {
    "ellipse": (ellipse(3.763, math.sqrt(2.0)), 1e-13),
    "round": (ellipse(2.0, 2.0), 1e-13),
    "turned": (TURNED, 1e-13),
    "egg": (EGG, 1e-5),
    "bean": (BEAN, 1e-4),
}
walls = pytest.mark.parametrize("name", WALLS)


@cache
def model_of(name: str) -> Any:
    return build_model(WALLS[name][0], rays_at(ANGLES))


def seen(model: Any, poses: Array) -> Array:
    """(n, l) what the rangefinders read at poses (n, 3)."""
    data, flags = mujoco.MjData(model), model.opt.disableflags
    model.opt.disableflags = 0
    readings = []
    for pose in poses:
        data.qpos[:3] = pose
        mujoco.mj_forward(model, data)
        readings.append([data.sensor(f"robot/range_{i}").data[0] for i in range(len(ANGLES))])
    model.opt.disableflags = flags
    return np.array(readings)


@walls
def test_rangefinders_read_the_ranges_of_the_curve(name: str) -> None:
    curve, tolerance = WALLS[name]
    rng = np.random.default_rng(0)
    poses = np.array([curve.draw(rng, RADIUS) for _ in range(300)])
    expected = np.array([curve.ranges(pose, np.array(ANGLES))[0] for pose in poses])
    np.testing.assert_allclose(seen(model_of(name), poses), expected, rtol=0.0, atol=tolerance)


def test_a_ray_that_misses_the_wall_reads_minus_one() -> None:
    readings = seen(model_of("ellipse"), np.array([[9.0, 0.0, 0.0]]))[0]
    assert readings[0] == -1.0


@walls
def test_the_drawn_wall_stands_outside_of_the_curve_and_close_to_it(name: str) -> None:
    """No part of the mesh is within the curve, and its faces are within a centimetre."""
    curve, model = WALLS[name][0], model_of(name)
    boxes = [g for g in range(model.ngeom) if model.geom(g).name.startswith("wall_")]
    assert len(boxes) > 30
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    fine = curve.points(np.linspace(0.0, 2.0 * math.pi, 4001))
    for g in boxes:
        axes, (half_length, half_depth, half_height) = data.geom_xmat[g].reshape(3, 3), model.geom_size[g]
        face = data.geom_xpos[g][:2] + half_depth * axes[:2, 1]  # the middle of the inner one
        assert axes[2, 2] == pytest.approx(1.0)
        assert half_height > SENSOR_HEIGHT / 2.0
        near = fine[np.abs((fine - face) @ axes[:2, 0]) < 0.8 * half_length]
        depth = (near - face) @ axes[:2, 1]
        depth = depth[np.abs(depth) < 0.3]
        assert depth.min() > 0.0
        assert depth.min() < 1e-2


def test_the_sensed_wall_is_felt_by_rays_only() -> None:
    model = model_of("bean")
    wall = model.geom("sensed_wall")
    assert wall.contype == wall.conaffinity == 0
    assert wall.group == SENSED_GROUP
    assert 0.0 < wall.rgba[3] < 1e-3
    assert model.geom("wall_0").group == DRAWN_GROUP


@walls
def test_the_bumper_touches_the_wall_where_the_curve_is(name: str) -> None:
    curve, model = WALLS[name][0], model_of(name)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(2)
    for s in rng.uniform(0.0, 2.0 * math.pi, 20):
        tangent = curve.tangent(np.array(s)) / np.linalg.norm(curve.tangent(np.array(s)))
        inward = np.array([-tangent[1], tangent[0]])
        for distance, touches in ((RADIUS - 8e-3, True), (RADIUS + 5e-3, False)):
            place = curve.points(np.array(s)) + distance * inward
            if abs(curve.distance(place) - distance) < 1e-3:  # no other part of the wall is nearer
                data.qpos[:2] = place
                mujoco.mj_forward(model, data)
                assert (data.ncon > 0) == touches, (s, distance)
