"""The noise and the outliers of ranges are learned while a filter runs, whatever shifts its residuals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mathnavi.estimators.ranging.noise_kernels import (
    WINDOW,
    NoiseSums,
    declared_noise,
    learn_noise,
    noise_of,
    remember,
)
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array

LONGEST, DEVIATION = 8.0, 0.1  # [m]


@njit(cache=True)
def _learn(sums: NoiseSums, residuals: Array) -> None:
    recent, count = np.zeros((residuals.shape[1], WINDOW)), np.zeros(residuals.shape[1], np.int64)
    variance = np.full(residuals.shape[1], DEVIATION**2)
    for k in range(len(residuals)):
        remember(recent, count, residuals[k], variance)
        learn_noise(sums, recent, count, residuals[k], variance, LONGEST)


def learned(residuals: Array, outliers: float = 0.0) -> tuple[float, float]:
    """sigma and epsilon after residuals (n, l) [m]."""
    sums = declared_noise(outliers)
    _learn(sums, residuals)
    sigma, epsilon = noise_of(sums)
    return sigma, epsilon


def residuals_of(sigma: float, epsilon: float, count: int = 2000, seed: int = 0) -> Array:
    """Residuals (count, 2) [m] of ranges of 3 m."""
    rng = np.random.default_rng(seed)
    good = sigma * DEVIATION * rng.standard_normal((count, 2))
    return np.where(rng.random((count, 2)) < epsilon, rng.uniform(0.0, LONGEST, (count, 2)) - 3.0, good)


@pytest.mark.parametrize(("sigma", "epsilon"), [(1.0, 0.0), (2.0, 0.0), (1.0, 0.3), (2.0, 0.3), (4.0, 0.1)])
def test_noise_and_outliers_are_found_from_what_is_declared(sigma: float, epsilon: float) -> None:
    found_sigma, found_epsilon = learned(residuals_of(sigma, epsilon))
    assert found_sigma == pytest.approx(sigma, rel=0.12)
    assert found_epsilon == pytest.approx(epsilon, abs=0.04)


@pytest.mark.parametrize(
    "shift", [lambda k: np.full(len(k), 1.5), lambda k: 0.005 * k, lambda k: 0.8 * np.sin(0.03 * k)]
)
def test_an_error_of_the_pose_is_no_noise(shift: Callable[[Array], Array]) -> None:
    k = np.arange(2000, dtype=np.float64)
    sigma, epsilon = learned(residuals_of(1.0, 0.0) + shift(k)[:, None])
    assert sigma == pytest.approx(1.0, rel=0.12)
    assert epsilon < 0.02


def test_lost_rays_change_nothing() -> None:
    residuals = residuals_of(2.0, 0.1, 300)
    one = learned(residuals)
    with_gaps = np.repeat(residuals, 2, axis=0)
    with_gaps[1::2] = np.nan
    assert learned(with_gaps) == one


def test_what_is_declared_holds_until_readings_say_otherwise() -> None:
    sigma, epsilon = noise_of(declared_noise(0.2))
    assert sigma == 1.0
    assert epsilon == pytest.approx(0.2)
