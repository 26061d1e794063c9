"""Square roots of covariances, and of what rounding has made indefinite."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.estimators.kalman_steps import square_root

seeds = st.integers(0, 2**32 - 1)


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_the_root_of_a_covariance_is_upper_triangular_and_squares_to_it(seed: int) -> None:
    root = np.random.default_rng(seed).standard_normal((4, 4))
    P = root @ root.T + 1e-9 * np.eye(4)
    U = square_root(P)
    np.testing.assert_allclose(U.T @ U, P, atol=1e-9)
    np.testing.assert_array_equal(U, np.triu(U))


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_the_root_of_a_matrix_that_is_indefinite_is_that_of_the_nearest_which_is_not(seed: int) -> None:
    Q = np.linalg.qr(np.random.default_rng(seed).standard_normal((4, 4)))[0]
    U = square_root(Q * [2.0, 1.0, 0.5, -1e-3] @ Q.T)
    np.testing.assert_allclose(U.T @ U, Q * [2.0, 1.0, 0.5, 0.0] @ Q.T, atol=1e-9)
    np.testing.assert_allclose(U, np.triu(U), atol=1e-12)
