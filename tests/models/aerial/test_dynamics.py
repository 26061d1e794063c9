"""The aerial vehicle's motion: CasADi, numpy, plans and MuJoCo say the same."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.dynamics import TICK, continuous_dynamics, discrete_dynamics, flow, input_at, state_at
from mathnavi.models.aerial.entity import build_model
from mathnavi.models.aerial.kernels import offset_from
from mathnavi.models.terrain.height_field import HeightField

SIDE = 80_000.0  # [m]


def vectors(bound: float, size: int = 3) -> st.SearchStrategy[Array]:
    return st.lists(st.floats(-bound, bound), min_size=size, max_size=size).map(np.array)


durations = st.floats(0.0, 30.0)


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return build_model(HeightField(np.zeros((3, 3)), 0.5 * SIDE), ["uav"], 40.0)


def plan_of(inputs: Array, lengths: Array, start: Array, t_start: float) -> Plan:
    x, t = [start], [t_start]
    for u, h in zip(inputs, lengths, strict=True):
        x.append(flow(x[-1], u, float(h)))
        t.append(t[-1] + float(h))
    return Plan(np.array(t), np.array(x), inputs, np.zeros(len(inputs), np.int64))


@pytest.fixture
def plan() -> Plan:
    rng = np.random.default_rng(3)
    start = np.array([100.0, 200.0, 3000.0, 10.0, -5.0, 2.0])
    return plan_of(rng.uniform(-20.0, 20.0, (6, 3)), rng.uniform(0.5, 3.0, 6), start, 10.0)


@given(p=vectors(8e4), v=vectors(300.0), u=vectors(40.0), h=durations)
def test_casadi_and_numpy_flows_agree(p: Array, v: Array, u: Array, h: float) -> None:
    x = np.concatenate([p, v])
    np.testing.assert_allclose(flow(x, u, h), np.array(discrete_dynamics()(x, u, h)).ravel(), rtol=1e-14, atol=1e-9)


@given(p=vectors(8e4), v=vectors(300.0), u=vectors(23.0))
def test_a_mujoco_tick_is_the_exact_flow(model: mujoco.MjModel, p: Array, v: Array, u: Array) -> None:
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = p + np.array([0.0, 0.0, 2e5]), v, u  # far up
    x = np.concatenate([data.qpos, data.qvel])
    mujoco.mj_step(model, data)
    np.testing.assert_allclose(np.concatenate([data.qpos, data.qvel]), flow(x, u, TICK), rtol=0.0, atol=1e-9)


@given(v=vectors(300.0), u=vectors(40.0), a=durations, b=durations)
def test_the_flow_is_a_semigroup(v: Array, u: Array, a: float, b: float) -> None:
    x = np.concatenate([np.zeros(3), v])
    np.testing.assert_allclose(flow(flow(x, u, a), u, b), flow(x, u, a + b), rtol=1e-10, atol=1e-8)


@given(v=vectors(300.0), u=vectors(40.0))
def test_the_continuous_dynamics_are_the_derivative_of_the_flow(v: Array, u: Array) -> None:
    x, h = np.concatenate([np.zeros(3), v]), 1e-3
    slope = (flow(x, u, h) - flow(x, u, -h)) / (2.0 * h)
    np.testing.assert_allclose(slope, np.array(continuous_dynamics()(x, u)).ravel(), atol=1e-9)


def test_one_flow_for_many_states_is_that_of_each() -> None:
    rng = np.random.default_rng(0)
    x, u, h = rng.normal(size=(5, 6)), rng.normal(size=(5, 3)), rng.uniform(0.0, 2.0, (5, 1))
    one_by_one = [flow(x[i], u[i], float(h[i, 0])) for i in range(5)]
    np.testing.assert_allclose(flow(x, u, h), one_by_one, rtol=1e-15)


def test_a_plan_is_at_its_breakpoints_where_it_says(plan: Plan) -> None:
    for t, x in zip(plan.t, plan.x, strict=True):
        np.testing.assert_allclose(state_at(plan, float(t)), x, atol=1e-9)


def test_a_plan_waits_before_its_start_and_rests_after_its_end(plan: Plan) -> None:
    np.testing.assert_array_equal(state_at(plan, plan.t_start - 5.0), plan.x[0])
    np.testing.assert_array_equal(state_at(plan, plan.t_end + 5.0), plan.x[-1])
    np.testing.assert_array_equal(input_at(plan, plan.t_start - 5.0), np.zeros(3))
    np.testing.assert_array_equal(input_at(plan, plan.t_end + 5.0), np.zeros(3))


def test_many_times_are_each_time(plan: Plan) -> None:
    t = np.concatenate([np.linspace(plan.t_start - 1.0, plan.t_end + 1.0, 200), plan.t])
    np.testing.assert_allclose(state_at(plan, t), [state_at(plan, float(now)) for now in t], rtol=0.0, atol=1e-12)


def test_the_offset_from_a_plan_is_that_from_its_position(plan: Plan) -> None:
    state = np.arange(6.0)
    for t in np.linspace(plan.t_start - 1.0, plan.t_end + 1.0, 50):
        offset = offset_from(plan.t, plan.x, plan.u, float(t), state)
        assert offset == tuple(state[:3] - state_at(plan, float(t))[:3])


def test_the_input_of_a_plan_moves_its_state(plan: Plan) -> None:
    for t in np.linspace(plan.t_start, plan.t_end - 0.02, 100):
        if np.abs(plan.t - t).min() > 0.011:  # no breakpoint on the way
            after = flow(state_at(plan, float(t)), input_at(plan, float(t)), 0.01)
            np.testing.assert_allclose(state_at(plan, float(t) + 0.01), after, atol=1e-9)


def test_round_off_in_a_time_does_not_choose_the_arc_before(plan: Plan) -> None:
    for k in range(len(plan.u)):
        np.testing.assert_array_equal(input_at(plan, float(plan.t[k]) * (1.0 - 2e-16)), plan.u[k])


def test_asking_a_plan_does_not_hand_out_its_arrays(plan: Plan) -> None:
    before = plan.x.copy(), plan.u.copy()
    for t in (plan.t_start - 1.0, plan.t_start, plan.t_end + 1.0):
        state_at(plan, t)[:] = np.nan
        input_at(plan, t)[:] = np.nan
    state_at(plan, plan.t)[:] = np.nan
    np.testing.assert_array_equal(plan.x, before[0])
    np.testing.assert_array_equal(plan.u, before[1])
