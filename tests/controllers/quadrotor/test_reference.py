"""The reference beside a plan: exact, continuous, and no further from the plan than is said."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from mathnavi.controllers.quadrotor.kernels import target_at
from mathnavi.controllers.quadrotor.tracker import ReferenceFilter, deviation
from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.kernels import arc_at
from tests.quadrotor import HIGH, plan_of, turning

OMEGA = 9.0
TURN = plan_of([((4.0, 0.0, 0.0), 0.7), ((-3.0, 1.0, 2.0), 0.9), ((0.0, 0.0, 0.0), 2.0)])


def followed(plan: Plan, preview: float, step: float = 0.01, end: float = 8.0) -> tuple[Array, Array]:
    """Times (n,) and references (n, 4, 3)."""
    reference = ReferenceFilter(OMEGA, preview, 1.0)
    t = np.arange(0.0, end, step)
    return t, np.array([reference.at(plan, float(at)) for at in t])


@pytest.mark.parametrize("preview", [0.0, 0.25])
def test_it_is_the_solution_of_its_differential_equation(preview: float) -> None:
    def rate(t: float, z: Array) -> Array:
        state = z.reshape(4, 3)
        target = target_at(TURN.t, TURN.x, TURN.u, arc_at(TURN.t, t + preview), t)
        e = state - target
        snap = -(OMEGA**4) * e[0] - 4.0 * OMEGA**3 * e[1] - 6.0 * OMEGA**2 * e[2] - 4.0 * OMEGA * e[3]
        return np.concatenate([state[1:].ravel(), snap])

    t, z = followed(TURN, preview, end=2.5)
    start = np.zeros((4, 3))
    start[0] = HIGH
    solved = solve_ivp(rate, (0.0, 2.5), start.ravel(), t_eval=t, rtol=1e-9, atol=1e-10, max_step=0.01)
    np.testing.assert_allclose(z.reshape(-1, 12), solved.y.T, rtol=0.0, atol=3e-4)


def test_how_often_it_is_asked_changes_nothing() -> None:
    (t, often), (_, seldom) = followed(TURN, 0.25, 0.01), followed(TURN, 0.25, 0.2)
    np.testing.assert_allclose(often[::20], seldom[: len(often[::20])], rtol=0.0, atol=1e-9)
    assert len(t) == 800


def test_on_a_long_arc_it_is_the_plan() -> None:
    _, z = followed(plan_of([((1.0, -2.0, 0.5), 9.0)]), 0.25, end=6.0)
    np.testing.assert_allclose(z[-1, 2], [1.0, -2.0, 0.5], atol=1e-9)
    np.testing.assert_allclose(z[-1, 3], 0.0, atol=1e-8)


def test_the_area_under_a_known_response_is_the_one_of_the_book() -> None:
    assert deviation(OMEGA, 0.0).position == pytest.approx(1.8131 / OMEGA**2, rel=1e-3)


def test_to_begin_a_turn_before_it_keeps_closer() -> None:
    causal, foreseen = deviation(OMEGA, 0.0), deviation(OMEGA, 0.25)
    assert foreseen.position < 0.5 * causal.position
    assert foreseen.velocity < 0.7 * causal.velocity
    assert 1.0 <= foreseen.acceleration < 1.2 < causal.acceleration


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6), preview=st.sampled_from([0.0, 0.25]))
def test_it_stays_as_near_to_any_plan_as_is_said(seed: int, preview: float) -> None:
    a_max, plan = 4.0, turning(np.random.default_rng(seed), 4.0, 10.0)
    t, z = followed(plan, preview, 0.02)
    planned = np.array([state_at(plan, float(at)) for at in t])
    # The first arc is not foreseen: the vehicle is at rest when the plan is made.
    allowed = deviation(OMEGA, 0.0)
    assert np.linalg.norm(z[:, 0] - planned[:, :3], axis=1).max() <= a_max * allowed.position
    assert np.linalg.norm(z[:, 1] - planned[:, 3:], axis=1).max() <= a_max * allowed.velocity
    assert np.linalg.norm(z[:, 2], axis=1).max() <= a_max * allowed.acceleration
    settled = t > 2.0
    assert np.linalg.norm(z[settled, 2], axis=1).max() <= a_max * deviation(OMEGA, preview).acceleration + 1e-3


def test_a_plan_that_is_elsewhere_is_begun_anew() -> None:
    reference = ReferenceFilter(OMEGA, 0.25, 1.0)
    reference.at(TURN, 0.0)
    far = plan_of([((0.0, 0.0, 0.0), 5.0)], HIGH + 50.0)
    np.testing.assert_array_equal(reference.at(far, 1.0)[0], HIGH + 50.0)


@pytest.mark.parametrize("preview", [0.0, 0.25])
def test_a_plan_that_takes_over_unchanged_changes_nothing(preview: float) -> None:
    """Between two control steps the reference was on its way by the old plan; the new one begins at the second."""
    once, twice = ReferenceFilter(OMEGA, preview, 1.0), ReferenceFilter(OMEGA, preview, 1.0)
    rest = Plan(np.array([0.5, *TURN.t[1:]]), TURN.x.copy(), TURN.u, TURN.phase)
    rest.x[0] = state_at(TURN, 0.5)
    for k in range(100):
        t = 0.01 * k
        np.testing.assert_allclose(once.at(TURN, t), twice.at(TURN if t < 0.495 else rest, t), rtol=0.0, atol=1e-9)
