"""The equations of motion: as printed in the plane, and in both dimensions those of MuJoCo's rigid body."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import pytest

from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.coordinates import COORDINATES, PLANAR, SPATIAL, Coordinates
from mathnavi.models.missile.dynamics import NOMINAL, Body, pitch_dynamics
from mathnavi.models.missile.entity import build_model

HEAVY = Body(mass=250.0, inertia=300.0, axial_inertia=4.0, gravity=9.81)
SIZES = {"m/s": 80.0, "rad/s": 1.5, "rad": 1.2, "m": 300.0}

both = pytest.mark.parametrize("coordinates", COORDINATES.values(), ids=COORDINATES)
bodies = pytest.mark.parametrize("body", [NOMINAL, HEAVY], ids=["nominal", "heavy"])


def drawn(coordinates: Coordinates, seed: int, count: int = 60) -> tuple[Array, Array]:
    """States (count, nx), the terminal dive among them, and inputs (count, nu)."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1.0, 1.0, (count, coordinates.state_size)) * [SIZES[unit] for unit in coordinates.units]
    x[0, coordinates.index("theta")] = -0.5 * math.pi
    return x, rng.uniform(-3e3, 3e3, (count, coordinates.input_size))


class Rigid:
    """MuJoCo's missile."""

    def __init__(self, coordinates: Coordinates, body: Body) -> None:
        self.model: Any = build_model(coordinates, [1e9] * coordinates.input_size, body)
        self.data = mujoco.MjData(self.model)
        self._half = len(coordinates.joints)

    def put(self, joints: Array, u: Array) -> None:
        self.data.qpos[:], self.data.qvel[:] = joints[: self._half], joints[self._half :]
        self.data.ctrl[:] = u
        mujoco.mj_forward(self.model, self.data)


def test_the_pitch_plane_is_the_printed_one() -> None:
    x, u = np.array([110.0, -7.0, 0.4, -0.9, 350.0, -120.0]), np.array([1500.0, -4000.0, 90.0])
    forward, down, q, theta, _, _ = x
    m, g, I_y = 204.02, 9.8, 247.437
    printed = [
        u[0] / m - q * down - g * math.sin(theta),
        u[1] / m + q * forward + g * math.cos(theta),
        u[2] / I_y,
        q,
        forward * math.cos(theta) + down * math.sin(theta),
        -forward * math.sin(theta) + down * math.cos(theta),
    ]
    np.testing.assert_allclose(np.array(pitch_dynamics()(x, u)).ravel(), printed, rtol=1e-15)
    np.testing.assert_allclose(PLANAR.rate(x, u), printed, rtol=1e-14)


@both
@bodies
def test_joint_accelerations_are_mujocos(coordinates: Coordinates, body: Body) -> None:
    rigid = Rigid(coordinates, body)
    for x, u in zip(*drawn(coordinates, 1), strict=True):
        rigid.put(coordinates.to_joints(x), u)
        np.testing.assert_allclose(coordinates.joint_acceleration(x, u, body), rigid.data.qacc, rtol=1e-9, atol=1e-9)


@both
@bodies
def test_the_state_changes_as_mujocos_does(coordinates: Coordinates, body: Body) -> None:
    """x' by the chain rule from MuJoCo's joint velocities and accelerations, differenced."""
    rigid, step = Rigid(coordinates, body), 1e-6
    f = coordinates.dynamics(body)
    for x, u in zip(*drawn(coordinates, 2, 20), strict=True):
        joints = coordinates.to_joints(x)
        rigid.put(joints, u)
        rate = np.concatenate([rigid.data.qvel, rigid.data.qacc])
        ahead, behind = (coordinates.from_joints(joints + sign * step * rate) for sign in (1.0, -1.0))
        differenced = (ahead - behind) / (2.0 * step)
        np.testing.assert_allclose(np.array(f(x, u)).ravel(), differenced, rtol=1e-7, atol=1e-5)


@both
@bodies
def test_casadi_and_the_kernels_say_the_same(coordinates: Coordinates, body: Body) -> None:
    x, u = drawn(coordinates, 3)
    said = np.array(coordinates.dynamics(body)(x.T, u.T)).T
    np.testing.assert_allclose(coordinates.rate(x, u, body), said, rtol=1e-12, atol=1e-11)


def test_the_pitch_plane_is_a_part_of_space() -> None:
    x, u = drawn(PLANAR, 4)
    whole = np.array(SPATIAL.dynamics(NOMINAL)(PLANAR.in_space(x).T, PLANAR.input_in_space(u).T)).T
    np.testing.assert_allclose(whole, PLANAR.in_space(PLANAR.rate(x, u)), rtol=1e-13, atol=1e-13)


@both
def test_a_flight_in_mujoco_is_the_flow(coordinates: Coordinates) -> None:
    rigid = Rigid(coordinates, NOMINAL)
    x, u = (rows[5] for rows in drawn(coordinates, 5))
    rigid.put(coordinates.to_joints(x), u)
    for _ in range(500):
        mujoco.mj_step(rigid.model, rigid.data)
    flown = coordinates.from_joints(np.concatenate([rigid.data.qpos, rigid.data.qvel]))
    np.testing.assert_allclose(coordinates.flow(x, u, 0.5), flown, rtol=1e-6, atol=1e-5)


def test_a_vertical_dive_is_no_singularity() -> None:
    dive = np.zeros(10)
    dive[[0, 5]] = 100.0, -0.5 * math.pi
    np.testing.assert_allclose(SPATIAL.velocity(dive), [0.0, 0.0, 100.0], atol=1e-12)
    np.testing.assert_allclose(SPATIAL.nose(dive), [0.0, 0.0, 1.0], atol=1e-12)
    assert np.isfinite(SPATIAL.rate(dive, np.ones(5))).all()


@pytest.mark.parametrize(
    ("field", "value"), [("mass", 0.0), ("inertia", -1.0), ("axial_inertia", math.nan), ("gravity", -1.0)]
)
def test_what_is_no_body_is_refused(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"{field} = .*allowed"):
        Body(**{field: value})
    with pytest.raises(ValueError, match="axial_inertia"):
        Body(inertia=1.0, axial_inertia=3.0)
