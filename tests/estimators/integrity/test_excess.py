"""The excess of innovations is a lower bound, and one where they are no larger than chance makes them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import chdtri

from mathnavi.estimators.integrity.excess import chances, factor_of
from mathnavi.estimators.integrity.windows import Thresholds, Windows
from mathnavi.interfaces.signals import Array

PERIOD, LENGTH = 0.1, 50


def factor(e: Array, kappa: float = 1.0, P: float = 1.0, R: float = 1.0) -> float:
    """The factor of P after innovations e (n,) of one channel."""
    windows = Windows(Thresholds.of(1, PERIOD, (0.5, LENGTH * PERIOD)), 1, kappa)
    for each in e:
        windows.add(np.array([each]), np.full(1, np.nan))
    known = windows.thresholds
    return factor_of(windows.sums, windows.k, (1, 2), known.lengths, kappa, *chances(LENGTH), P, R)


def test_all_of_an_excess_is_put_to_the_prediction() -> None:
    twice = np.full(LENGTH, 2.0)
    r = max(4.0 * n / chdtri(n, 0.1) for n in (5, LENGTH))
    assert factor(twice) == pytest.approx(2.0 * r - 1.0, rel=1e-12)
    assert factor(twice, P=3.0, R=0.0) == pytest.approx(r, rel=1e-12)
    assert factor(twice, kappa=2.0) == pytest.approx(2.0 * max(r / 2.0, 1.0) - 1.0, rel=1e-12)
    assert factor(twice, P=0.0) == 1e6


def test_it_is_a_lower_bound_and_one_by_chance() -> None:
    rng = np.random.default_rng(0)
    as_declared = [factor(rng.standard_normal(LENGTH)) for _ in range(200)]
    assert np.mean(np.array(as_declared) > 1.0) < 0.02
    thrice = [factor(np.sqrt(3.0) * rng.standard_normal(LENGTH), R=0.0) for _ in range(200)]
    assert 0.8 < np.mean(np.array(thrice) < 3.0) < 1.0
    assert np.median(thrice) > 2.0
