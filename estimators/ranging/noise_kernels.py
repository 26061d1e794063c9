"""The noise of ranges, estimated while a filter runs, compiled.

The declared standard deviation of each range is sqrt(r); the true one is sigma sqrt(r), with a share epsilon of
outliers. An error of the estimated pose shifts the residuals e = (rho - h) / sqrt(r) of a ray by nearly the same amount
for many readings, noise shifts each on its own: so the middle one of the last n = 9 residuals of a ray is compared with
their median,

    d = e_middle - median(e),     var d = (1 - 2 / n + var median) sigma^2 = 0.944 sigma^2   for a Gaussian,

which neither a steadily growing error nor up to four outliers change much. d belongs to an outlier with the probability
1 - beta, p = (1 - epsilon) N(d; 0, 0.944 sigma^2), beta = p / (p + epsilon sqrt(r) / L), L the longest range in sight.
Sums with exponential forgetting, S <- lambda S + ..., make this an online expectation maximisation (Neal and Hinton,
1998):

    sigma^2 = sum beta d^2 / 0.944 / sum beta,     epsilon = sum (1 - beta) / sum 1,

both starting at the declared values, which count as ``_PRIOR`` readings.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array, Integers

WINDOW = 9
"""n: number of residuals of a ray that are kept"""

_SPREAD = 0.944  # variance of the middle one of WINDOW Gaussian numbers less their median
_PRIOR = 50.0  # readings that the declared errors count as
_MEMORY = 1.0 - 1.0 / 2000.0  # lambda of a reading
_LEAST_OUTLIERS, _MOST_OUTLIERS = 2e-3, 0.8
_LEAST_VARIANCE, _MOST_VARIANCE = 0.25, 1e4  # sigma^2


class NoiseSums(NamedTuple):
    """Sums with exponential forgetting, changed in place."""

    squares: Array  # (2,) sum of beta d^2 / 0.944, and of beta
    outliers: Array  # (2,) sum of 1 - beta, and of 1


def declared_noise(outliers: float) -> NoiseSums:
    """Initial sums for the declared noise, with a share of ``outliers``."""
    return NoiseSums(_PRIOR * np.ones(2), _PRIOR * np.array([outliers, 1.0]))


@njit(cache=True, nogil=True)
def noise_of(sums: NoiseSums) -> tuple[float, float]:
    """sigma, the true standard deviation over the declared one, and epsilon, the share of outliers."""
    variance = min(max(sums.squares[0] / sums.squares[1], _LEAST_VARIANCE), _MOST_VARIANCE)
    return math.sqrt(variance), min(max(sums.outliers[0] / sums.outliers[1], _LEAST_OUTLIERS), _MOST_OUTLIERS)


@inner_njit(nogil=True)
def remember(recent: Array, count: Integers, residual: Array, variance: Array) -> None:
    """Append a residual (l,) [m], NaN where a ray read nothing, over the declared deviation to those of each ray.

    ``recent`` (l, WINDOW) and their number ``count`` (l,) are changed in place.
    """
    for i in range(len(residual)):
        if math.isnan(residual[i]):
            continue
        for k in range(WINDOW - 1):
            recent[i, k] = recent[i, k + 1]
        recent[i, WINDOW - 1] = residual[i] / math.sqrt(variance[i])
        count[i] += 1


@inner_njit(nogil=True)
def learn_noise(
    sums: NoiseSums, recent: Array, count: Integers, residual: Array, variance: Array, longest: float
) -> None:
    """Update the sums, in place, by the rays whose readings ``remember`` has just appended."""
    for i in range(len(residual)):
        if math.isnan(residual[i]) or count[i] < WINDOW:
            continue
        sigma, epsilon = noise_of(sums)
        d = recent[i, WINDOW // 2] - _median(recent[i])
        spread = _SPREAD * sigma * sigma
        p = (1.0 - epsilon) * math.exp(-0.5 * d * d / spread) / math.sqrt(2.0 * math.pi * spread)
        beta = p / (p + epsilon * math.sqrt(variance[i]) / longest)
        sums.squares[0] = _MEMORY * sums.squares[0] + beta * d * d / _SPREAD
        sums.squares[1] = _MEMORY * sums.squares[1] + beta
        sums.outliers[0] = _MEMORY * sums.outliers[0] + 1.0 - beta
        sums.outliers[1] = _MEMORY * sums.outliers[1] + 1.0


@njit(cache=True, nogil=True)
def _median(values: Array) -> float:
    """Median of WINDOW values (WINDOW,)."""
    ordered = np.empty(WINDOW)
    for k in range(WINDOW):
        j = k
        while j > 0 and ordered[j - 1] > values[k]:
            ordered[j] = ordered[j - 1]
            j -= 1
        ordered[j] = values[k]
    return float(ordered[WINDOW // 2])
