"""From the thesis' state to MuJoCo's joints and back, inverse dynamics, plans as functions of time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.interfaces.signals import Plan
from mathnavi.models.missile.coordinates import COORDINATES, PLANAR, SPATIAL, Coordinates
from tests.models.missile.test_dynamics import drawn

both = pytest.mark.parametrize("coordinates", COORDINATES.values(), ids=COORDINATES)


@both
@given(seed=st.integers(0, 10_000))
def test_there_and_back_is_where_it_began(coordinates: Coordinates, seed: int) -> None:
    x, _ = drawn(coordinates, seed, 4)
    np.testing.assert_allclose(coordinates.from_joints(coordinates.to_joints(x)), x, rtol=1e-12, atol=1e-10)
    np.testing.assert_allclose(coordinates.to_joints(coordinates.from_joints(x)), x, rtol=1e-12, atol=1e-10)


def test_signs_are_those_of_the_frames() -> None:
    """Level and 10 m high, the nose up and to the right, moving ahead."""
    x = np.zeros(10)
    x[[0, 5, 6, 8, 9]] = 100.0, 0.2, 0.1, 5.0, -10.0
    j = dict(zip(("x", "y", "z", "theta", "psi", "x'", "y'", "z'"), SPATIAL.to_joints(x), strict=False))
    assert (j["y"], j["z"], j["theta"], j["psi"]) == (-5.0, 10.0, 0.2, 0.1)
    assert j["x'"] > 90.0
    assert j["y'"] < 0.0 < j["z'"]
    ahead, right, down = SPATIAL.nose(x)
    assert ahead > 0.0
    assert right > 0.0 > down
    np.testing.assert_allclose(SPATIAL.velocity(x), 100.0 * SPATIAL.nose(x), rtol=1e-12)
    np.testing.assert_array_equal(SPATIAL.place(x), [0.0, 5.0, -10.0])


@both
@given(seed=st.integers(0, 10_000))
def test_inverse_dynamics_give_the_acceleration_that_was_asked_for(coordinates: Coordinates, seed: int) -> None:
    x, _ = drawn(coordinates, seed, 3)
    wanted = np.random.default_rng(seed).uniform(-50.0, 50.0, (3, len(coordinates.joints)))
    u = coordinates.inverse_dynamics(x, wanted)
    np.testing.assert_allclose(coordinates.joint_acceleration(x, u), wanted, rtol=1e-10, atol=1e-9)


@both
def test_one_state_and_many_are_treated_alike(coordinates: Coordinates) -> None:
    x, u = drawn(coordinates, 7, 5)
    for many, one in (
        (coordinates.to_joints(x), coordinates.to_joints(x[2])),
        (coordinates.rate(x, u), coordinates.rate(x[2], u[2])),
        (coordinates.inverse_dynamics(x, x[:, : len(coordinates.joints)]),
         coordinates.inverse_dynamics(x[2], x[2, : len(coordinates.joints)])),
        (coordinates.place(x), coordinates.place(x[2])),
        (coordinates.velocity(x), coordinates.velocity(x[2])),
    ):  # fmt: skip
        np.testing.assert_array_equal(many[2], one)


@both
def test_the_flow_goes_back_as_it_came_and_does_not_depend_on_its_pieces(coordinates: Coordinates) -> None:
    x, u = (rows[3] for rows in drawn(coordinates, 8))
    after = coordinates.flow(x, u, 0.3)
    np.testing.assert_allclose(coordinates.flow(after, u, -0.3), x, rtol=1e-6, atol=1e-5)
    np.testing.assert_allclose(coordinates.flow(coordinates.flow(x, u, 0.13), u, 0.17), after, rtol=1e-7, atol=1e-6)


@both
def test_inputs_one_after_the_other_lead_where_one_flow_after_the_other_does(coordinates: Coordinates) -> None:
    rng = np.random.default_rng(4)
    x, inputs = rng.normal(size=coordinates.state_size), rng.normal(0.0, 500.0, (5, coordinates.input_size))
    durations = [0.004, 0.001, 0.02, 0.004, 0.003]
    expected = x
    for u, dt in zip(inputs, durations, strict=True):
        expected = coordinates.flow(expected, u, dt)
    np.testing.assert_array_equal(coordinates.flow_through(x, inputs, durations), expected)


@both
def test_an_array_of_another_size_is_refused(coordinates: Coordinates) -> None:
    for call in (coordinates.to_joints, coordinates.from_joints, coordinates.place):
        with pytest.raises(ValueError, match=r"shape \(7,\)"):
            call(np.zeros(7))


@pytest.fixture
def plan() -> Plan:
    """Two arcs, the second from another state than the one in which the first one ends."""
    x = np.array([[100.0, 0, 0, 0, 0, -50.0], [101.0, 1.0, 0.1, 0.05, 40.0, -55.0], [0, 0, 0, 0, 0, 0]])
    u = np.array([[500.0, -1900.0, 20.0], [0.0, -2500.0, -10.0]])
    return Plan(np.array([1.0, 1.4, 2.0]), x, u, np.zeros(2, np.int64))


def test_a_plan_flies_on_from_the_first_state_of_each_arc(plan: Plan) -> None:
    np.testing.assert_allclose(PLANAR.state_at(plan, 1.3), PLANAR.flow(plan.x[0], plan.u[0], 0.3), rtol=1e-12)
    np.testing.assert_array_equal(PLANAR.state_at(plan, 1.4), plan.x[1])
    np.testing.assert_allclose(PLANAR.state_at(plan, 1.9), PLANAR.flow(plan.x[1], plan.u[1], 0.5), rtol=1e-12)


def test_before_its_start_a_plan_stands_and_after_its_end_it_flies_on(plan: Plan) -> None:
    np.testing.assert_array_equal(PLANAR.state_at(plan, 0.0), plan.x[0])
    np.testing.assert_allclose(PLANAR.state_at(plan, 2.5), PLANAR.flow(plan.x[1], plan.u[1], 1.1), rtol=1e-12)
    times = np.array([0.0, 1.3, 1.9, 2.5])
    np.testing.assert_array_equal(PLANAR.state_at(plan, times), [PLANAR.state_at(plan, float(t)) for t in times])
    for t, arc in ((0.0, 0), (1.0, 0), (1.4, 1), (9.0, 1)):
        np.testing.assert_array_equal(PLANAR.input_at(plan, t), plan.u[arc])


def test_what_is_handed_out_is_not_the_plans_own(plan: Plan) -> None:
    PLANAR.state_at(plan, 1.4)[:] = np.nan
    PLANAR.input_at(plan, 1.4)[:] = np.nan
    assert np.isfinite(plan.x).all()
    assert np.isfinite(plan.u).all()
