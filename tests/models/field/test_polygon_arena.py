"""The arena of a polygon: rangefinders read its ranges, boxes stand behind its walls, bumpers meet them."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import mujoco
import numpy as np
import pytest

from mathnavi.models.field.polygon import Polygon
from mathnavi.models.unicycle.entity import RADIUS, build_model
from mathnavi.models.unicycle.kernels import rays_at

from .walls import FURNISHED

ANGLES = tuple(2.0 * math.pi * k / 7 for k in range(7))
SHARP = Polygon(
    (((0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (1.6, 0.5), (1.5, 3.0), (0.0, 3.0)), ((0.5, 1.0), (1.2, 1.0), (1.2, 1.01))),
    "sharp",
)
walls = pytest.mark.parametrize("wall", [FURNISHED, SHARP], ids=["furnished", "sharp"])


@cache
def model_of(wall: Polygon) -> Any:
    return build_model(wall, rays_at(ANGLES))


@walls
def test_rangefinders_read_the_ranges_of_the_polygon(wall: Polygon) -> None:
    model, rng = model_of(wall), np.random.default_rng(0)
    data, flags = mujoco.MjData(model), model.opt.disableflags
    model.opt.disableflags = 0
    for _ in range(100):
        pose = wall.draw(rng, 0.02)
        data.qpos[:3] = pose
        mujoco.mj_forward(model, data)
        seen = [data.sensor(f"robot/range_{i}").data[0] for i in range(len(ANGLES))]
        np.testing.assert_allclose(seen, wall.ranges(pose, np.array(ANGLES))[0], rtol=0.0, atol=2e-5)
    model.opt.disableflags = flags


@walls
def test_boxes_stand_in_what_is_solid(wall: Polygon) -> None:
    model = model_of(wall)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    boxes = [g for g in range(model.ngeom) if model.geom(g).name.startswith("wall_")]
    assert len(boxes) >= len(wall.segments) - 3
    shares = np.linspace(-1.0, 1.0, 9)
    for g in boxes:
        axes, size = data.geom_xmat[g].reshape(3, 3)[:2, :2], model.geom_size[g]
        for along in shares:
            for across in (-1.0, 1.0):
                corner = data.geom_xpos[g][:2] + axes @ np.array([along * size[0], across * size[1]])
                assert not wall.contains(corner)


def test_the_bumper_touches_walls_and_tables() -> None:
    model = model_of(FURNISHED)
    data, rng, met = mujoco.MjData(model), np.random.default_rng(2), 0
    for _ in range(200):
        pose = FURNISHED.draw(rng)
        distance = FURNISHED.distance(pose)
        if abs(distance - RADIUS) < 0.02:
            continue
        data.qpos[:3] = pose
        mujoco.mj_forward(model, data)
        if distance > 0.03:  # not deep in a thin wall
            assert (data.ncon > 0) == (distance < RADIUS)
            met += distance < RADIUS
    assert met > 10
