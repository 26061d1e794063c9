"""Coordinates that make error dynamics linear: exact ones, power series, and their inverses."""

from __future__ import annotations

import itertools

import casadi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.interfaces.signals import Array
from mathnavi.models.textbook.library import EXAMPLE_2_2, KAZANTZIS_KRAVARIS, KRENER_ISIDORI
from mathnavi.models.textbook.maps import inverse, of_numbers
from mathnavi.models.textbook.power_series import PowerSeries, solved
from mathnavi.models.textbook.system import System

FORM = KRENER_ISIDORI.form
POLES = (-2.0, -3.0)
NUMBER = st.floats(-2.0, 2.0)


def residual_of_series(series: PowerSeries, system: System, x: Array) -> float:
    """The largest component of dT/dx F(x) - A T(x) + g(h(x)), with A = diag(POLES) and g(y) = -y (1, 1)'."""
    at = casadi.SX.sym("x", 2)
    T = series(at)
    carried = casadi.jacobian(T, at) @ system.f(at, casadi.SX.zeros(0))
    residual = carried - casadi.diag(POLES) @ T - casadi.repmat(system.h(at, casadi.SX.zeros(0)), 2, 1)
    return float(np.abs(np.array(casadi.Function("residual", [at], [residual])(x))).max())


@given(NUMBER, NUMBER, NUMBER)
def test_van_der_pol_is_linear_up_to_output_injection(x_1: float, x_2: float, u: float) -> None:
    assert FORM is not None
    x, held = casadi.SX.sym("x", 2), casadi.SX.sym("u")
    y = KRENER_ISIDORI.h(x, held)
    carried = casadi.jacobian(FORM.T_1(x), x) @ KRENER_ISIDORI.f(x, held)
    linear = casadi.DM(FORM.A) @ FORM.T_1(x) - FORM.g(y, held)
    seen = FORM.T_2(y) - casadi.DM(FORM.C) @ FORM.T_1(x)
    back = FORM.T_1_inverse(FORM.T_1(x)) - x
    residual = casadi.Function("residual", [x, held], [casadi.vertcat(carried - linear, seen, back)])([x_1, x_2], u)
    np.testing.assert_allclose(np.array(residual), 0.0, atol=1e-11)


@given(st.floats(-9.0, -0.5), st.floats(0.1, 4.0))
def test_a_gain_places_the_poles(pole: float, apart: float) -> None:
    assert FORM is not None
    poles = (pole, pole - apart)
    found = np.linalg.eigvals(FORM.A - FORM.gain(poles) @ FORM.C)
    np.testing.assert_allclose(np.sort(found), np.sort(poles), atol=1e-7)


@pytest.mark.parametrize("poles", [(-1.0,), (-1.0, -1.0), (-1.0, 2.0), (-1.0, float("nan"))])
def test_poles_that_do_not_fit_are_refused(poles: tuple[float, ...]) -> None:
    assert FORM is not None
    with pytest.raises(ValueError, match="allowed: 2 different finite numbers < 0"):
        FORM.gain(poles)
    with pytest.raises(ValueError, match="allowed: 2 different finite numbers < 0"):
        solved(KAZANTZIS_KRAVARIS, poles, 3)


def test_a_series_solves_its_equation_the_better_the_longer_it_is() -> None:
    x = np.array([0.5, -0.3])
    residuals = [residual_of_series(solved(KAZANTZIS_KRAVARIS, POLES, N), KAZANTZIS_KRAVARIS, x) for N in (1, 3, 5, 9)]
    assert all(later < 0.1 * earlier for earlier, later in itertools.pairwise(residuals))
    assert residuals[-1] < 3e-7


def test_a_series_of_a_linear_system_is_its_sylvester_equation() -> None:
    linear = System(
        "linear", "", ("x_1", "x_2"), (), ("y",),
        lambda x, u: casadi.vertcat(x[1], -x[0] - 0.4 * x[1]), lambda x, u: x[0], (0.0, 0.0), (0.0, 0.0),
    )  # fmt: skip
    series = solved(linear, POLES, 4)
    T, F = series.coefficients[:, series.exponents.sum(axis=1) == 1], np.array([[0.0, 1.0], [-1.0, -0.4]])
    T = T[:, ::-1]  # multi-indices are in order, (0, 1) before (1, 0)
    np.testing.assert_allclose(T @ F, np.diag(POLES) @ T + np.array([[1.0, 0.0], [1.0, 0.0]]), atol=1e-12)
    np.testing.assert_allclose(series.coefficients[:, series.exponents.sum(axis=1) > 1], 0.0, atol=1e-12)


def test_a_pole_that_resonates_is_refused() -> None:
    node = System(
        "node", "", ("x",), (), ("y",), lambda x, u: -x + x**2, lambda x, u: x[0], (0.0,), (0.0,)
    )  # whose eigenvalue is -1, so that -3 is a sum of three of them
    with pytest.raises(ValueError, match=r"poles: -3\.0 is a sum of eigenvalues"):
        solved(node, (-3.0,), 5)
    assert np.isfinite(solved(node, (-3.5,), 5).coefficients).all()


@pytest.mark.parametrize(
    ("system", "order", "expected"),
    [(EXAMPLE_2_2, 3, "without inputs"), (KAZANTZIS_KRAVARIS, 0, "1 to 15"), (KAZANTZIS_KRAVARIS, 16, "1 to 15")],
)
def test_what_has_no_series_is_refused(system: System, order: int, expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        solved(system, POLES, order)


def test_a_system_that_is_not_at_rest_at_the_origin_is_refused() -> None:
    moving = System("moving", "", ("x",), (), ("y",), lambda x, u: 1.0 - x, lambda x, u: x[0], (0.0,), (0.0,))
    with pytest.raises(ValueError, match="at rest with y = 0 at the origin"):
        solved(moving, (-2.0,), 3)


@given(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8))
def test_an_inverse_finds_back(x_1: float, x_2: float) -> None:
    to_z, to_x = SERIES
    x = np.array([x_1, x_2])
    found = to_x(to_z(x), np.zeros(2))
    assert found is not None
    np.testing.assert_allclose(found, x, atol=1e-9)


SERIES = of_numbers(solved(KAZANTZIS_KRAVARIS, POLES, 7), 2), inverse(solved(KAZANTZIS_KRAVARIS, POLES, 7), 2)


def test_where_there_is_no_inverse_it_says_so() -> None:
    square = inverse(lambda x: x**2 + 1.0, 1)
    assert square(np.array([0.0]), np.array([0.7])) is None  # its least value is 1
    assert square(np.array([5.0]), np.array([0.0])) is None  # its slope is zero there
    found = square(np.array([5.0]), np.array([0.5]))
    assert found is not None
    assert found[0] == pytest.approx(2.0)
