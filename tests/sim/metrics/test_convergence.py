"""Convergence rates of errors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.sim.metrics.convergence import decay_rate

T = np.linspace(0.0, 10.0, 1001)


@given(st.floats(-0.5, 5.0), st.floats(0.1, 100.0))
def test_the_rate_of_an_exponential_is_found(rate: float, size: float) -> None:
    assert decay_rate(T, size * np.exp(-rate * T)) == pytest.approx(rate, abs=1e-6)


def test_what_remains_at_the_end_does_not_count() -> None:
    error = np.hypot(np.exp(-3.0 * T), 1e-8)
    assert decay_rate(T, error) == pytest.approx(3.0, rel=1e-3)
    assert decay_rate(T, error, floor=1e-12) < 2.5


def test_without_an_error_there_is_no_rate() -> None:
    assert math.isnan(decay_rate(T, np.zeros(len(T))))
    assert math.isnan(decay_rate(T[:2], np.array([1.0, 0.5])))
