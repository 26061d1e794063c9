"""Consistency and accuracy of an estimator, from many independent runs.

**Consistency.** If an error e (d,) is Gaussian with the covariance P that the estimator states, then e' P^-1 e (NEES)
is chi-square distributed with d degrees of freedom, and so is, with one for each ray, the normalised innovation squared
(NIS). The sum over n independent runs has n d degrees, so that the average lies between

    chi^2_{n d}(tail) / n   and   chi^2_{n d}(1 - tail) / n

with the given probability. Above that interval the estimator is overconfident, below it is too cautious (Bar-Shalom, Li
and Kirubarajan, 2001, section 5.4).

**Root mean square** of the errors of n runs with RMS r_i over time: sqrt(mean r_i^2). Its band is the bootstrap
percentile interval over runs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.sim.records.statistics import checked_sample

_ROUND_OFF = 1e-14  # of an eigenvalue, over the largest
_AT_ONCE = 1_000_000  # numbers that are drawn together


@dataclass(frozen=True)
class Consistency:
    """Average of a normalised squared error over runs, and the interval where it should be."""

    average: float
    low: float
    high: float
    runs: int
    confidence: float = 0.95

    @property
    def holds(self) -> bool:
        """True if the average lies within the band."""
        return self.low <= self.average <= self.high

    def text(self) -> str:
        """Text for the reader: the average and its interval."""
        where = "in" if self.holds else "not in"
        return f"{self.average:.2f} {where} [{self.low:.2f}, {self.high:.2f}] (n = {self.runs})"


@dataclass(frozen=True)
class RootMeanSquare:
    """Root mean square error of several runs, with its bootstrap limits."""

    value: float
    low: float  # NaN for a single run
    high: float
    runs: int
    confidence: float = 0.95

    def text(self) -> str:
        """Text for the reader, in the unit of the values."""
        if math.isnan(self.low):
            return f"{self.value:.3g} (n = {self.runs})"
        return f"{self.value:.3g} [{self.low:.3g}, {self.high:.3g}] (n = {self.runs})"


def normalised_error_squared(error: Array, covariance: Array) -> Array:
    """NEES (n,), e' P^-1 e of errors e (n, d) with covariances P (n, d, d).

    NaN where P is not positive definite by more than round-off.
    """
    nees = np.full(len(error), np.nan)
    finite = np.flatnonzero(np.isfinite(covariance).all(axis=(1, 2)))
    if len(finite):
        eigenvalues = np.linalg.eigvalsh(covariance[finite])
        regular = finite[eigenvalues[:, 0] > _ROUND_OFF * np.abs(eigenvalues[:, -1])]
        e = error[regular]
        nees[regular] = (e * np.linalg.solve(covariance[regular], e[..., np.newaxis])[..., 0]).sum(axis=1)
    return nees


def consistency(squares: Sequence[float] | Array, degrees: int, confidence: float = 0.95) -> Consistency:
    """Mean of normalised squared errors (n,) of independent runs, each with ``degrees`` degrees of freedom.

    Raises ArgumentError for no errors, for NaN, for degrees < 1 and for a confidence that is not between 0 and 1.
    """
    values = checked_sample(squares, "squares", confidence)
    if degrees < 1:
        raise ArgumentError(f"degrees = {degrees!r}; allowed: a whole number >= 1")
    n, tail = len(values), 0.5 * (1.0 - confidence)
    low, high = (float(chdtri(n * degrees, p)) / n for p in (1.0 - tail, tail))
    return Consistency(float(values.mean()), low, high, n, confidence)


def root_mean_square(
    values: Sequence[float] | Array, rng: np.random.Generator, confidence: float = 0.95, resamples: int = 9999
) -> RootMeanSquare:
    """Root mean square of RMS values (n,) of independent runs; no band for a single run. ArgumentError for none and
    NaN.
    """
    squares = np.square(checked_sample(values, "values", confidence))
    if resamples < 1:
        raise ArgumentError(f"resamples = {resamples!r}; allowed: a whole number >= 1")
    n, value = len(squares), math.sqrt(squares.mean())
    if n == 1:
        return RootMeanSquare(value, math.nan, math.nan, 1, confidence)
    step = max(1, _AT_ONCE // n)
    means = [
        squares[rng.integers(n, size=(min(step, resamples - k), n))].mean(axis=1) for k in range(0, resamples, step)
    ]
    tails = (0.5 * (1.0 - confidence), 0.5 * (1.0 + confidence))
    low, high = np.sqrt(np.quantile(np.concatenate(means), tails, method="inverted_cdf"))
    return RootMeanSquare(value, float(low), float(high), n, confidence)
