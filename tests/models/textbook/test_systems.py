"""The systems of the text, against the text."""

from __future__ import annotations

import math

import casadi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.interfaces.signals import Array
from mathnavi.models.textbook.library import (
    DISTANCE,
    EXAMPLE_2_1,
    EXAMPLE_2_2,
    SYSTEMS,
    camera_and_flags,
    error_dynamics,
    observer,
)
from mathnavi.models.textbook.system import System

EVERY = [*SYSTEMS.values(), camera_and_flags(distance_known=False)]
NUMBER = st.floats(-2.0, 2.0)


@pytest.mark.parametrize("system", EVERY, ids=lambda system: system.title)
def test_sizes_fit_together(system: System) -> None:
    n, p, m = len(system.states), len(system.inputs), len(system.outputs)
    x, u = np.array(system.start), np.zeros(p)
    assert x.shape == (n,) == (len(system.start_error),)
    assert len(system.constant) == len(system.amplitude) == p
    assert system.rate(x, u).shape == (n,)
    assert system.output(x, u).shape == (m,)
    rates = (system.flow(x, u, 1e-5) - x) / 1e-5
    np.testing.assert_allclose(rates, system.rate(x, u), atol=1e-3)


@given(NUMBER, NUMBER, NUMBER)
def test_example_2_1_is_the_printed_one(x_1: float, x_2: float, u: float) -> None:
    x, held = np.array([x_1, x_2]), np.array([u])
    np.testing.assert_allclose(EXAMPLE_2_1.rate(x, held), [-x_1 + u * x_2**3, x_2 + x_1**2], atol=1e-12)
    assert EXAMPLE_2_1.output(x, held) == [x_1]


@given(NUMBER, NUMBER, NUMBER, NUMBER)
def test_example_2_2_is_the_printed_one(x_1: float, x_2: float, x_3: float, u: float) -> None:
    x, held = np.array([x_1, x_2, x_3]), np.array([u])
    np.testing.assert_allclose(EXAMPLE_2_2.rate(x, held), [u, x_1 + x_2**2, -x_3 + x_2], atol=1e-12)
    assert EXAMPLE_2_2.output(x, held) == [x_2]


def evolved(system: System, start: tuple[float, ...], u: float, duration: float = 1.0) -> Array:
    x, held, seen = np.array(start), np.array([u]), []
    for _ in range(20):
        seen.append(system.output(x, held)[0])
        x = system.flow(x, held, duration / 20)
    return np.array(seen)


def test_in_example_2_1_nothing_is_learnt_without_an_input() -> None:
    apart = evolved(EXAMPLE_2_1, (0.2, 0.3), 0.0) - evolved(EXAMPLE_2_1, (0.2, -0.8), 0.0)
    np.testing.assert_allclose(apart, 0.0, atol=1e-10)
    apart = evolved(EXAMPLE_2_1, (0.2, 0.3), 1.0) - evolved(EXAMPLE_2_1, (0.2, -0.8), 1.0)
    assert np.abs(apart[1:]).min() > 1e-3


def test_the_examples_escape_when_they_are_said_to() -> None:
    _, reached = EXAMPLE_2_1.reach(np.array(EXAMPLE_2_1.start), np.ones(1), 5.0)
    assert reached == pytest.approx(1.9079584, abs=1e-7)
    x, t = np.array([0.1, -0.5, 0.0]), 0.0
    while True:
        x, reached = EXAMPLE_2_2.reach(x, np.array([math.sin(t + 5e-4)]), 1e-3)
        if reached < 1e-3:
            break
        t += 1e-3
    assert t + reached == pytest.approx(2.649, abs=1e-3)


@given(*[NUMBER] * 7, st.floats(0.1, 5.0), st.floats(0.1, 5.0))
def test_the_observer_of_example_2_2_errs_linearly(
    x_1: float, x_2: float, x_3: float, e_1: float, e_2: float, e_3: float, u: float, alpha: float, beta: float
) -> None:
    x, e = np.array([x_1, x_2, x_3]), np.array([e_1, e_2, e_3])
    rate = casadi.DM(observer(casadi.DM(x + e), casadi.DM(u), casadi.DM(x_2), alpha, beta)).full().ravel()
    error = rate - EXAMPLE_2_2.rate(x, np.array([u]))
    np.testing.assert_allclose(error, error_dynamics(alpha, beta) @ e, atol=1e-10)
    assert np.linalg.eigvals(error_dynamics(alpha, beta)).real.max() < 0.0


@given(st.floats(-3.0, 3.0), st.floats(-3.0, -0.3), st.floats(-math.pi, math.pi))
def test_the_camera_sees_flags_where_they_are(x_1: float, x_2: float, phi: float) -> None:
    """In the frame of the camera a flag lies (ahead, to the left); its image is to the right of the centre."""
    for place, y in zip(
        (DISTANCE, 0.0), camera_and_flags().output(np.array([x_1, x_2, phi]), np.zeros(2)), strict=True
    ):
        ahead = math.cos(phi) * (place - x_1) - math.sin(phi) * x_2
        left = -math.sin(phi) * (place - x_1) - math.cos(phi) * x_2
        assert y * ahead == pytest.approx(-left, abs=1e-6 * (1.0 + abs(y)))


def test_an_unknown_distance_is_a_state_that_stays() -> None:
    known, unknown = camera_and_flags(), camera_and_flags(distance_known=False)
    x, u = np.array([1.0, -2.0, 1.2]), np.array([0.4, 0.2])
    longer = np.append(x, DISTANCE)
    np.testing.assert_array_equal(unknown.rate(longer, u), [*known.rate(x, u), 0.0])
    np.testing.assert_array_equal(unknown.output(longer, u), known.output(x, u))
    assert camera_and_flags(distance_known=False) is unknown


def test_angles_are_compared_within_half_a_turn() -> None:
    difference = camera_and_flags().difference(np.array([[1.0, 2.0, 3.1], [0.0, 0.0, 0.1]]), np.array([1.0, 0.0, -3.1]))
    np.testing.assert_allclose(
        difference, [[0.0, 2.0, 6.2 - 2.0 * math.pi], [-1.0, 0.0, 3.2 - 2.0 * math.pi]], atol=1e-12
    )
