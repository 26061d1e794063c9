"""Curves are followed all the way: round where they close, to the boundary where they do not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.estimators.observability.continuation import End, Equations, trace_curve
from mathnavi.interfaces.signals import Array


def sphere_and_plane(radius: float, height: float) -> Equations:
    def equations(x: Array) -> tuple[Array, Array]:
        return np.array([x @ x - radius**2, x[2] - height]), np.vstack([2.0 * x, [0.0, 0.0, 1.0]])

    return equations


@settings(max_examples=10, deadline=None)
@given(radius=st.floats(0.05, 0.6), share=st.floats(-0.9, 0.9), at=st.floats(-math.pi, math.pi))
def test_a_closed_curve_is_followed_once_round(radius: float, share: float, at: float) -> None:
    height = share * radius
    r = math.sqrt(radius**2 - height**2)
    start = np.array([r * math.cos(at), r * math.sin(at), height])
    curve = trace_curve(sphere_and_plane(radius, height), start, 0.01)
    assert curve.closed
    closed = np.vstack([curve.points, curve.points[0]])
    np.testing.assert_allclose(np.linalg.norm(curve.points, axis=1), radius, atol=1e-10)
    length = np.linalg.norm(np.diff(closed, axis=0), axis=1).sum()
    assert length == pytest.approx(2.0 * math.pi * r, rel=(0.01 / r) ** 2 + 1e-9)


def test_a_curve_that_turns_back_ends_at_both_boundaries() -> None:
    """y = x^2 within y < 1, from its foot: neither coordinate could be the parameter all along."""

    def equations(x: Array) -> tuple[Array, Array]:
        if x[1] > 1.0:
            return np.array([math.nan]), np.full((1, 2), math.nan)
        return np.array([x[0] ** 2 - x[1]]), np.array([[2.0 * x[0], -1.0]])

    curve = trace_curve(equations, np.zeros(2), 0.05)
    assert curve.ends == (End.BOUNDARY, End.BOUNDARY)
    np.testing.assert_allclose(np.sort(curve.points[[0, -1], 0]), [-1.0, 1.0], atol=1e-8)
    assert np.linalg.norm(np.diff(curve.points, axis=0), axis=1).max() < 0.06


def test_a_curve_that_bends_within_a_step_is_kept() -> None:
    curve = trace_curve(sphere_and_plane(0.02, 0.0), np.array([0.02, 0.0, 0.0]), 0.05)
    assert curve.closed
    np.testing.assert_allclose(np.linalg.norm(curve.points, axis=1), 0.02, atol=1e-10)


def test_a_curve_without_end_is_given_up() -> None:
    curve = trace_curve(lambda x: (x[1:], np.array([[0.0, 1.0]])), np.zeros(2), 0.5, longest=10.0)
    assert curve.ends == (End.TOO_LONG, End.TOO_LONG)


def test_bad_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="is not on the curve"):
        trace_curve(sphere_and_plane(1.0, 0.0), np.array([0.5, 0.0, 0.0]))
    for step, longest in ((0.0, 1.0), (math.inf, 1.0), (0.1, -1.0)):
        with pytest.raises(ValueError, match="allowed: positive numbers"):
            trace_curve(sphere_and_plane(1.0, 0.0), np.array([1.0, 0.0, 0.0]), step, longest)
