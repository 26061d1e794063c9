"""What a model lacks is what its parameters add, and a step with them is that of the true model."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.parameters import MechanismParameters
from tests.estimators.velocity.faulty_arms import faulty


@pytest.mark.parametrize("arm", ["servo-six", "servo-gripper", "two-link", "seven-joint"])
def test_what_a_model_lacks_is_linear_in_what_is_wrong_with_it(arm: str) -> None:
    model = build_model(arm)
    model.actuator_forcelimited[:] = 0
    model.dof_frictionloss[:] = 0.0  # MuJoCo's depends on the masses, and so on the load
    true = faulty(model, gain=0.8, load=1.5)
    parameters, rng = MechanismParameters(model), np.random.default_rng(3)
    theta = np.array([-0.2 * name.startswith("gain") + 0.5 * (name == "load") for name in parameters.names])
    for _ in range(5):
        data = mujoco.MjData(true)
        data.qpos[:] = model.key_qpos[0] if model.nkey else model.qpos0
        data.qvel[:], data.ctrl[:] = 0.5 * rng.standard_normal(model.nv), 0.02 * rng.standard_normal(model.nu)
        mujoco.mj_forward(true, data)
        a = data.qacc.copy()
        torque, effect, _ = parameters.lacking(data.qpos, data.qvel - parameters.delay * a, a, data.ctrl)
        assert np.abs(torque).max() > 1e-3
        np.testing.assert_allclose(effect @ theta, torque, atol=1e-6 * (1.0 + np.abs(torque).max()))


def test_the_step_with_its_parameters_is_that_of_the_true_model() -> None:
    model = build_model("servo-six")
    true, parameters = faulty(model, gain=0.8, friction=0.5, load=1.5), MechanismParameters(model)
    theta = np.array([
        -0.2 * name.startswith("gain") + 0.5 * (name == "load") + 0.5 * name.startswith("friction")
        for name in parameters.names
    ])  # fmt: skip
    data = mujoco.MjData(true)
    mujoco.mj_resetDataKeyframe(true, data, 0)
    data.ctrl[:] += 0.1
    q, v = data.qpos.copy(), data.qvel.copy()
    mujoco.mj_step(true, data)
    after = parameters.applied(theta)(q, v, data.ctrl, float(model.opt.timestep))
    nominal = parameters.applied(0.0 * theta)(q, v, data.ctrl, float(model.opt.timestep))
    assert np.abs(nominal[1] - data.qvel).max() > 1e-3
    np.testing.assert_allclose(after[1], data.qvel, atol=1e-6)


def test_a_joint_whose_actuator_is_at_the_end_of_its_force_says_nothing() -> None:
    model = build_model("servo-gripper")
    parameters, data = MechanismParameters(model), mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.ctrl[0] += 1.0
    mujoco.mj_forward(model, data)
    share = parameters.lacking(data.qpos, data.qvel, data.qacc, data.ctrl).share
    assert share[0] == 0.0
    assert share[4] == 1.0
