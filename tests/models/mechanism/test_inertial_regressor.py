"""Linear inverse dynamics, against MuJoCo's."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.inertial_regressor import InertialRegressor, inertial_parameters


@pytest.mark.parametrize("name", ["two-link", "seven-joint", "servo-gripper", "cart-pendulum"])
def test_it_is_the_inverse_dynamics_of_the_model(name: str) -> None:
    """All bodies' parameters by the regressor, the model's own torque, and mj_inverse without the rotors agree."""
    model, rng = build_model(name), np.random.default_rng(0)
    q, v, a = rng.standard_normal((3, 5, model.nv))
    bodies = range(1, model.nbody)
    regressor = InertialRegressor(model)
    theta = np.concatenate([inertial_parameters(model, body) for body in bodies])
    torque = regressor(q, v, a, bodies) @ theta
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], v[k], a[k]
        mujoco.mj_inverse(model, data)
        expected = data.qfrc_inverse + data.qfrc_passive - model.dof_armature * a[k]
        assert torque[k] == pytest.approx(expected, abs=1e-9)
    without = torque - regressor.torque(q, v, a)
    assert np.abs(without).max() < 1e-9 or model.jnt_stiffness.any()
