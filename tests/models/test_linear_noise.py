"""The discretisation of a linear system under white noise, for steps of any length."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm, solve_continuous_lyapunov

from mathnavi.models.linear_noise import discretised


@given(h=st.floats(1e-3, 100.0), tau=st.floats(1e-3, 100.0), rms=st.floats(0.1, 10.0))
def test_it_is_that_of_a_first_order_process(h: float, tau: float, rms: float) -> None:
    F, Q = discretised(np.array([[-1.0 / tau]]), np.array([[2.0 * rms**2 / tau]]), h)
    assert F[0, 0] == pytest.approx(np.exp(-h / tau), abs=1e-12)
    assert Q[0, 0] == pytest.approx(-(rms**2) * np.expm1(-2.0 * h / tau), rel=1e-9)


@given(seed=st.integers(0, 1000), h=st.floats(0.01, 50.0))
def test_the_stationary_covariance_stays(seed: int, h: float) -> None:
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(3, 3)) - 5.0 * np.eye(3)
    W = np.diag(rng.uniform(0.1, 1.0, 3))
    stationary = solve_continuous_lyapunov(A, -W)
    F, Q = discretised(A, W, h)
    np.testing.assert_allclose(F @ stationary @ F.T + Q, stationary, atol=1e-10)
    np.testing.assert_allclose(F, expm(h * A), atol=1e-10)
