"""The robot: its joints, sensors and contacts, for either drive."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import pytest

from mathnavi.models.field.arena import SENSOR_HEIGHT
from mathnavi.models.unicycle.entity import RADIUS, DriveName, build_model
from mathnavi.models.unicycle.kernels import rays_at
from mathnavi.models.unicycle.mission import TICK
from tests.unicycle import STANDARD

both = pytest.mark.parametrize("drive", ["ideal", "differential"])


@both
def test_the_pose_leads_and_the_wheels_end_the_joints(drive: DriveName) -> None:
    model = build_model(STANDARD, rays_at((0.0,)), drive, name="rover")
    names = [model.joint(j).name for j in range(model.njnt)]
    assert names[:3] == ["rover/x_1", "rover/x_2", "rover/phi"]
    assert names[-2:] == ["rover/wheel_left", "rover/wheel_right"]
    assert len(names) == (5 if drive == "ideal" else 8)
    assert model.nu == (0 if drive == "ideal" else 2)
    assert model.opt.timestep == (TICK if drive == "ideal" else 0.001)


@pytest.mark.parametrize("angles", [(0.0,), (-1.0, 1.0), tuple(0.7 * k for k in range(8))])
def test_there_is_a_rangefinder_at_every_angle_in_one_plane(angles: tuple[float, ...]) -> None:
    model = build_model(STANDARD, rays_at(angles))
    data = mujoco.MjData(model)
    data.qpos[2] = 0.4
    mujoco.mj_kinematics(model, data)
    for i, angle in enumerate(angles):
        site = data.site(f"robot/range_{i}")
        np.testing.assert_allclose(site.xpos, [0.0, 0.0, SENSOR_HEIGHT], atol=1e-15)
        along = [math.cos(0.4 + angle), math.sin(0.4 + angle), 0.0]
        np.testing.assert_allclose(site.xmat.reshape(3, 3)[:, 2], along, rtol=0.0, atol=1e-15)
    assert sum(model.sensor_type == mujoco.mjtSensor.mjSENS_RANGEFINDER) == len(angles)


@both
def test_nothing_of_the_robot_but_its_own_body_reaches_the_plane_of_the_sensors(drive: DriveName) -> None:
    """A ray passes through the geoms of the body that its site is on, and through those only."""
    model = build_model(STANDARD, rays_at((0.0,)), drive)
    chassis = model.body("robot/chassis").id
    for g in range(model.ngeom):
        body = int(model.geom_bodyid[g])
        if body not in (0, chassis):
            assert model.body(body).pos[2] + model.geom_rbound[g] < SENSOR_HEIGHT


def touching(model: Any, name: str) -> set[str]:
    """The geoms of the world that may touch a geom of the robot."""
    own = model.geom(f"robot/{name}")
    world = [model.geom(g) for g in range(model.ngeom) if model.geom_bodyid[g] == 0]
    return {g.name.partition("_")[0] for g in world if (g.contype & own.conaffinity) | (own.contype & g.conaffinity)}


@both
def test_the_bumper_meets_walls_and_the_wheels_meet_the_floor(drive: DriveName) -> None:
    model = build_model(STANDARD, rays_at((0.0,)), drive)
    assert touching(model, "bumper") == {"wall"}
    assert model.geom("robot/bumper").size[0] == RADIUS
    for name in ("tread_left", "tread_right", "caster_front", "caster_rear"):
        assert touching(model, name) == ({"floor"} if drive == "differential" else set())
    assert touching(model, "body") == set()


def test_wheels_grip_and_casters_slip() -> None:
    model = build_model(STANDARD, rays_at((0.0,)), "differential", 0.4)
    friction = {name: model.geom(f"robot/{name}").friction[0] for name in ("tread_left", "tread_right", "caster_rear")}
    assert friction["tread_left"] == friction["tread_right"] == 0.4
    assert max(friction["caster_rear"], model.geom("floor").friction[0]) < 0.01


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"name": ""}, "empty"),
        ({"name": "a/b"}, "'/'"),
        ({"friction": 0.0}, r"friction = 0\.0"),
        ({"friction": math.nan}, "friction = nan"),
    ],
)
def test_what_makes_no_robot_is_refused(arguments: dict[str, Any], expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        build_model(STANDARD, rays_at((0.0,)), "differential", **arguments)
