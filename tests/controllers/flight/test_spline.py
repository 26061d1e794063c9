"""Coefficients of cubic B-splines, held against scipy's."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes
from scipy.ndimage import spline_filter

from mathnavi.controllers.flight.spline import coefficients


@given(shape=array_shapes(min_dims=1, max_dims=3, min_side=2, max_side=40), seed=st.integers(0, 2**32 - 1))
def test_coefficients_have_the_bits_of_scipys(shape: tuple[int, ...], seed: int) -> None:
    values = np.random.default_rng(seed).uniform(-100.0, 3000.0, shape)
    inner = coefficients(values)[(slice(1, -1),) * len(shape)]
    np.testing.assert_array_equal(inner, spline_filter(values, order=3, mode="mirror"))


@given(shape=array_shapes(min_dims=1, max_dims=3, min_side=2, max_side=9), seed=st.integers(0, 2**32 - 1))
def test_the_spline_passes_through_the_values(shape: tuple[int, ...], seed: int) -> None:
    """At node i it is (c[i - 1] + 4 c[i] + c[i + 1]) / 6 along each axis, the border included."""
    values = np.random.default_rng(seed).uniform(-100.0, 3000.0, shape)
    c = coefficients(values)
    for axis in range(c.ndim):
        along = np.moveaxis(c, axis, 0)
        c = np.moveaxis((along[:-2] + 4.0 * along[1:-1] + along[2:]) / 6.0, 0, axis)
    np.testing.assert_allclose(c, values, atol=1e-9)
