"""The model: the printed body, thrusters that push as the thesis has it, limits, factors of what is true."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from mathnavi.models.missile.coordinates import COORDINATES, PLANAR, SPATIAL, Coordinates
from mathnavi.models.missile.dynamics import TICK, Body
from mathnavi.models.missile.entity import build_model, build_spec

both = pytest.mark.parametrize("coordinates", COORDINATES.values(), ids=COORDINATES)


@both
def test_it_is_the_printed_body(coordinates: Coordinates) -> None:
    model = build_model(coordinates, [1e5] * coordinates.input_size)
    body = model.body("missile/body")
    np.testing.assert_array_equal(body.mass, 204.02)
    np.testing.assert_array_equal(body.inertia[1:], 247.437)
    np.testing.assert_array_equal(model.opt.gravity, [0.0, 0.0, -9.8])
    assert model.opt.timestep == TICK
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4


@both
def test_joints_and_thrusters_are_those_of_the_coordinates(coordinates: Coordinates) -> None:
    model = build_model(coordinates, [1e5] * coordinates.input_size, name="dart")
    joints = [model.joint(j).name for j in range(model.njnt)]
    motors = [model.actuator(i).name for i in range(model.nu)]
    assert joints == [f"dart/{name}" for name in coordinates.joints]
    assert motors == [f"dart/{name}" for name in coordinates.inputs]


def test_nothing_collides_and_the_ground_does_not_stop_it() -> None:
    model = build_model(PLANAR, [1e5] * 3)
    assert not model.geom_contype.any()
    assert not model.geom_conaffinity.any()


def test_limits_bound_the_inputs_and_factors_scale_what_they_do() -> None:
    free = build_model(PLANAR, [np.inf] * 3)
    weak = build_model(PLANAR, (2e3, 4e3, 100.0), force_factor=0.95, moment_factor=0.5)
    assert not free.actuator_ctrllimited.any()
    np.testing.assert_array_equal(weak.actuator_ctrlrange[:, 1], [2e3, 4e3, 100.0])
    u, x = np.array([1e3, 5e3, 60.0]), np.zeros(6)
    data = mujoco.MjData(weak)
    data.qpos[:], data.ctrl[:] = PLANAR.to_joints(x)[:3], u
    mujoco.mj_forward(weak, data)
    given = np.array([0.95 * 1e3, 0.95 * 4e3, 0.5 * 60.0])
    np.testing.assert_allclose(data.qacc, PLANAR.joint_acceleration(x, given), rtol=1e-12)


def test_the_true_body_is_the_one_that_is_given() -> None:
    model = build_model(SPATIAL, [1e5] * 5, Body(230.0, 280.0, 2.0, 3.7))
    np.testing.assert_array_equal(model.body("missile/body").inertia, [2.0, 280.0, 280.0])
    assert model.opt.gravity[2] == -3.7


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"name": ""}, "empty"),
        ({"name": "a/b"}, "'/'"),
        ({"force_factor": 0.0}, "force_factor"),
        ({"moment_factor": np.nan}, "moment_factor"),
        ({"input_max": (1.0, 1.0)}, "2 numbers"),
        ({"input_max": (1.0, -1.0, 1.0)}, "F_z"),
    ],
)
def test_what_makes_no_model_is_refused(arguments: dict[str, object], expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        build_spec(PLANAR, **({"input_max": (1e5,) * 3} | arguments))  # type: ignore[arg-type]
