"""Solutions of ordinary differential equations, to a stated error, and where they end."""

from __future__ import annotations

import math

import casadi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.models.runge_kutta import FARTHEST, TOLERANCE, Flow, classical_step

NO_INPUT = np.empty(0)
OSCILLATOR = Flow(lambda x, u: casadi.vertcat(x[1], -x[0]), 2, 0)
SQUARE = Flow(lambda x, u: x**2, 1, 0)  # x = 1 / (1 / x(0) - t)


@given(st.floats(0.01, 20.0), st.floats(-math.pi, math.pi))
def test_it_is_as_exact_as_it_says(dt: float, phase: float) -> None:
    found = OSCILLATOR(np.array([math.cos(phase), -math.sin(phase)]), NO_INPUT, dt)
    steps = 1.0 + 5.0 * dt  # each of them may err by the tolerance
    np.testing.assert_allclose(
        found, [math.cos(dt + phase), -math.sin(dt + phase)], rtol=0.0, atol=4.0 * TOLERANCE * steps
    )


def test_an_input_is_held() -> None:
    driven = Flow(lambda x, u: -x + u, 1, 1)
    found = driven(np.array([2.0]), np.array([3.0]), 0.7)
    assert found[0] == pytest.approx(3.0 - math.exp(-0.7), abs=1e-10)


@given(st.floats(0.01, 100.0))
def test_a_solution_that_escapes_is_followed_to_its_end(start: float) -> None:
    x, reached = SQUARE.reach(np.array([start]), NO_INPUT, 1e3)
    assert reached == pytest.approx(1.0 / start, rel=1e-7)
    assert np.isfinite(x).all()
    assert x[0] > FARTHEST


@given(st.floats(0.01, 100.0), st.floats(0.0, 0.99))
def test_a_solution_that_does_not_escape_yet_is_followed_all_the_way(start: float, share: float) -> None:
    dt = share / start
    x, reached = SQUARE.reach(np.array([start]), NO_INPUT, dt)
    assert reached == dt
    assert x[0] == pytest.approx(1.0 / (1.0 / start - dt), rel=1e-5)


def test_what_it_is_given_is_not_changed_and_not_handed_back() -> None:
    x = np.array([1.0, 0.0])
    kept = x.copy()
    assert OSCILLATOR(x, NO_INPUT, 0.0) is not x
    OSCILLATOR(x, NO_INPUT, 0.3)
    np.testing.assert_array_equal(x, kept)


def test_a_law_that_is_not_finite_ends_where_it_begins() -> None:
    broken = Flow(lambda x, u: casadi.sqrt(x - 2.0), 1, 0)
    x, reached = broken.reach(np.array([1.0]), NO_INPUT, 1.0)
    assert x[0] == 1.0
    assert reached == 0.0


def test_a_step_in_which_one_of_several_states_is_not_a_number_is_not_taken() -> None:
    beside = Flow(lambda x, u: casadi.vertcat(-x[0], casadi.sqrt(x[1] - 2.0)), 2, 0)
    x, reached = beside.reach(np.array([1.0, 1.0]), NO_INPUT, 1.0)
    np.testing.assert_array_equal(x, [1.0, 1.0])
    assert reached == 0.0


def test_a_start_beyond_every_bound_has_escaped() -> None:
    cross = Flow(lambda x, u: casadi.vertcat(x[1] ** 2, x[0] * x[1] ** 3), 2, 0)
    x, reached = cross.reach(np.array([1e300, 1e300]), NO_INPUT, 1.0)
    assert np.isfinite(x).all()
    assert reached < 1e-10


def test_the_classical_step_is_of_order_four_and_the_same_for_numbers_and_expressions() -> None:
    x, h = casadi.SX.sym("x", 2), casadi.SX.sym("h")
    symbolic = casadi.Function("step", [x, h], [classical_step(lambda at, c: casadi.vertcat(at[1], -at[0]), x, h)])
    start, errors = np.array([1.0, 0.0]), []
    for step in (0.1, 0.05):
        after = classical_step(lambda at, c: np.array([at[1], -at[0]]), start, step)
        np.testing.assert_array_equal(after, np.array(symbolic(start, step)).ravel())
        errors.append(np.abs(after - [math.cos(step), -math.sin(step)]).max())
    assert errors[0] / errors[1] == pytest.approx(2.0**5, rel=0.05)
