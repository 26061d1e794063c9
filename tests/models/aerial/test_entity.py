"""The composed model: a fleet over the triangles of a height field, drawn beside the physics."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.dynamics import TICK
from mathnavi.models.aerial.entity import GRAVITY, airframe_pose, build_model
from mathnavi.models.terrain.height_field import HeightField


@pytest.fixture(scope="module")
def terrain() -> HeightField:
    return HeightField(np.random.default_rng(1).uniform(200.0, 1500.0, (17, 23)), 150.0)


@pytest.fixture(scope="module")
def model(terrain: HeightField) -> mujoco.MjModel:
    return build_model(terrain, ["one", "two"], 40.0)


def test_the_ground_of_mujoco_is_the_height_field(terrain: HeightField, model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rng = np.random.default_rng(2)
    down, normal = np.array([0.0, 0.0, -1.0]), np.zeros((3, 1))
    for _ in range(300):
        x, y = rng.uniform(0.0, terrain.width), rng.uniform(0.0, terrain.depth)
        above = np.array([x, y, 3000.0])
        z = 3000.0 - mujoco.mj_rayHfield(model, data, model.geom("terrain").id, above, down, normal)
        assert z == pytest.approx(float(terrain.height(x, y)), abs=2e-3)


def test_a_plain_compiles() -> None:
    model = build_model(HeightField(np.full((4, 4), 700.0), 100.0), ["uav"], 40.0)
    assert model.geom("terrain").pos[2] == 700.0


def test_every_vehicle_is_a_unit_mass_on_three_bounded_slides(model: mujoco.MjModel) -> None:
    assert (model.nq, model.nv, model.nu) == (6, 6, 6)
    for name in ("one", "two"):
        assert model.body(f"{name}/body").mass[0] == 1.0
        for axis in "xyz":
            assert model.joint(f"{name}/{axis}").type[0] == mujoco.mjtJoint.mjJNT_SLIDE
            np.testing.assert_array_equal(model.actuator(f"{name}/{axis}").ctrlrange, [-40.0, 40.0])


def test_the_physics_is_that_of_the_flight_tick(model: mujoco.MjModel) -> None:
    assert model.opt.timestep == TICK
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
    np.testing.assert_array_equal(model.opt.gravity, np.zeros(3))


def test_the_airframe_is_drawn_only(model: mujoco.MjModel) -> None:
    for name in ("one", "two"):
        body = model.body(f"{name}/airframe")
        assert body.mocapid[0] >= 0
        geoms = [g for g in range(model.ngeom) if model.geom_bodyid[g] == body.id]
        assert len(geoms) > 10
        assert not model.geom_contype[geoms].any()
        assert not model.geom_conaffinity[geoms].any()


def test_moving_the_airframe_moves_nothing_else(model: mujoco.MjModel) -> None:
    states = []
    for moved in (False, True):
        data = mujoco.MjData(model)
        data.qpos[:], data.ctrl[:] = [100.0, 100.0, 2000.0, 150.0, 100.0, 2000.0], 1.0
        if moved:
            data.mocap_pos[:] = data.qpos[:3]
        mujoco.mj_step(model, data, nstep=50)
        states.append(np.concatenate([data.qpos, data.qvel]))
    np.testing.assert_array_equal(states[0], states[1])


components = st.floats(-40.0, 40.0)
triples = st.tuples(components, components, components).map(np.array)


@given(position=triples, velocity=triples, acceleration=triples)
def test_the_drawn_thrust_carries_weight_and_acceleration(
    position: Array, velocity: Array, acceleration: Array
) -> None:
    drawn_at, quaternion = airframe_pose(position, velocity, acceleration)
    np.testing.assert_array_equal(drawn_at, position)
    assert np.linalg.norm(quaternion) == pytest.approx(1.0)
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    rotation = matrix.reshape(3, 3)
    thrust = acceleration + np.array([0.0, 0.0, GRAVITY])
    if np.linalg.norm(thrust) > 1e-6:
        np.testing.assert_allclose(rotation[:, 2] * np.linalg.norm(thrust), thrust, atol=1e-6)


def test_the_nose_points_along_the_velocity() -> None:
    for yaw in np.linspace(-3.0, 3.0, 13):
        direction = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        _, quaternion = airframe_pose(np.zeros(3), 50.0 * direction, np.zeros(3))
        nose = np.empty(3)
        mujoco.mju_rotVecQuat(nose, np.array([1.0, 0.0, 0.0]), quaternion)
        np.testing.assert_allclose(nose, direction, atol=1e-12)


@pytest.mark.parametrize("names", [[], ["uav", "uav"], [""], ["a/b"]])
def test_names_that_cannot_be_are_refused(terrain: HeightField, names: list[str]) -> None:
    with pytest.raises(ValueError, match="name"):
        build_model(terrain, names, 40.0)


@pytest.mark.parametrize("bound", [0.0, -1.0, np.inf, np.nan])
def test_a_bound_that_cannot_be_is_refused(terrain: HeightField, bound: float) -> None:
    with pytest.raises(ValueError, match="acceleration_max"):
        build_model(terrain, ["uav"], bound)
