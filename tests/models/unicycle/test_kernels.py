"""The motion of a unicycle under inputs that are held is exact, and so are its derivatives."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.kernels import integrate, integrate_jacobians, sinc, sinc_derivative

poses = st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-7.0, 7.0)).map(np.array)
speeds, rates = st.floats(-2.0, 2.0), st.one_of(st.floats(-5.0, 5.0), st.floats(-1e-3, 1e-3), st.just(0.0))
times = st.floats(1e-3, 2.0)


@given(poses, speeds, rates, times)
def test_it_moves_as_the_differential_equation_has_it(x: Array, u_1: float, u_2: float, dt: float) -> None:
    """Example C.1."""
    path = solve_ivp(
        lambda t, x: [u_1 * math.cos(x[2]), u_1 * math.sin(x[2]), u_2], (0.0, dt), x, rtol=1e-10, atol=1e-12
    )
    np.testing.assert_allclose(integrate(x, u_1, u_2, dt), path.y[:, -1], rtol=0.0, atol=1e-8)


@given(poses, speeds, rates, times, st.floats(0.01, 0.99))
def test_two_parts_of_a_motion_are_the_whole(x: Array, u_1: float, u_2: float, dt: float, share: float) -> None:
    halfway = integrate(x, u_1, u_2, share * dt)
    np.testing.assert_allclose(
        integrate(halfway, u_1, u_2, (1.0 - share) * dt), integrate(x, u_1, u_2, dt), rtol=0.0, atol=1e-12
    )


@given(poses, speeds, rates, times)
def test_the_derivatives_are_those_of_differences(x: Array, u_1: float, u_2: float, dt: float) -> None:
    F, G = integrate_jacobians(x, u_1, u_2, dt)
    step = 1e-6
    for i in range(3):
        d = step * np.eye(3)[i]
        slope = (integrate(x + d, u_1, u_2, dt) - integrate(x - d, u_1, u_2, dt)) / (2.0 * step)
        np.testing.assert_allclose(F[:, i], slope, rtol=0.0, atol=1e-8)
    for j in range(2):
        d = step * np.eye(2)[j]
        slope = (integrate(x, u_1 + d[0], u_2 + d[1], dt) - integrate(x, u_1 - d[0], u_2 - d[1], dt)) / (2.0 * step)
        np.testing.assert_allclose(G[:, j], slope, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_series_about_nought_join_the_formulas(sign: float) -> None:
    below, above = sign * 0.999999e-3, sign * 1.000001e-3
    assert sinc(below) == pytest.approx(sinc(above), abs=1e-14 + 2e-9 * 4e-4)
    assert sinc_derivative(below) == pytest.approx(sinc_derivative(above), abs=1e-9)
    assert sinc(0.0) == 1.0
    assert sinc_derivative(0.0) == 0.0
