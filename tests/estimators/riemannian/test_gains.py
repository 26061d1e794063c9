"""IntrinsicGains: where their poles are, and that their slopes are those of the functions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.estimators.riemannian.gains import IntrinsicGains
from mathnavi.estimators.velocity.poles import triple_pole_weights


@given(st.floats(0.01, 1e4), st.floats(0.1, 30.0), st.floats(1e-4, 0.5))
def test_constant_gains_put_the_poles_of_the_sampled_error(omega: float, zeta: float, h: float) -> None:
    """(e_x, e_v) -> [[1 - alpha, (1 - alpha) h], [-beta, 1 - beta h]] (e_x, e_v) on R."""
    alpha, beta = IntrinsicGains(omega, zeta).weights(0.0, h)
    matrix = np.array([[1.0 - alpha, (1.0 - alpha) * h], [-beta, 1.0 - beta * h]])
    poles = np.exp(np.roots([1.0, 2.0 * zeta * omega, omega**2]).astype(complex) * h)
    assert np.trace(matrix) == pytest.approx(poles.sum().real, abs=1e-9)
    assert np.linalg.det(matrix) == pytest.approx(np.prod(poles).real, abs=1e-9)


@given(st.floats(0.1, 100.0), st.floats(1e-3, 0.1))
def test_with_a_disturbance_three_poles_are_one(omega: float, h: float) -> None:
    alpha, beta, gamma = triple_pole_weights(omega, h)
    predict = np.array([[1.0, h, 0.5 * h * h], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
    correct = np.eye(3) - np.outer([alpha, beta, gamma], [1.0, 0.0, 0.0])
    polynomial = np.poly(correct @ predict)
    assert polynomial == pytest.approx(np.poly(np.full(3, np.exp(-omega * h))), abs=1e-8)


def test_the_curvature_term_of_theorem_d_2_is_minus_one_at_the_truth() -> None:
    for kappa in (1.0, -1.0):
        matched = IntrinsicGains(2.0, 1.0, "constant", "matched", kappa)
        assert matched.curved(0.0) == -1.0
        assert matched.curved(1e-3) == pytest.approx(-1.0, abs=1e-6)
        assert (matched.curved(1.0) < -1.0) == (kappa > 0.0)
