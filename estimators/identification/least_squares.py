"""Linear least squares whose residuals are coloured: estimates, their covariance, and what the data do not show.

    y = A theta + e,      theta^ = (A'A)^-1 A'y,      cov theta^ = (A'A)^-1 S (A'A)^-1.

Residuals of a mechanism are no white noise: what a model of friction lacks lasts as long as a motion does. S is the
estimate of Newey and West (1987), which allows for any correlation that fades within L samples,

    S = sum_{|l| <= L} (1 - |l| / (L + 1)) sum_k a_k e_k e_{k-l} a_{k-l}',

with the L of Andrews (1991) for each column a e as an autoregression of first order, the longest of them.

What is not excited shows in the singular values of A with columns of unit length: a small one says that a combination
of parameters, its right singular vector, changes nothing that was measured.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mathnavi.interfaces.signals import Array

CONFIDENCE = 1.959963984540054  # standard deviations of a two-sided interval of 95 %
_ANDREWS = 1.1447  # of Bartlett's weights
_WHITEST, _REDDEST = 0.0, 0.97  # correlations of neighbours that are assumed
_UNSEEN = 0.03  # of the greatest singular value, below which a combination of parameters is not excited
_PART_OF = 0.3  # of a unit vector, from which on a parameter is part of a combination


@dataclass(frozen=True)
class Fit:
    """Result of a least squares problem with p parameters."""

    theta: Array  # (p,)
    covariance: Array  # (p, p)
    residual: Array  # (n,)
    singular_values: Array  # (p,) over the greatest, of the columns with unit length
    unseen: tuple[tuple[int, ...], ...]  # parameters of each combination that is not excited

    @property
    def deviation(self) -> Array:
        """Standard deviations (p,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


def fit(A: Array, y: Array) -> Fit:
    """Fit y (n,) by the columns of A (n, p), whose rows are in the order of time; columns of zeros have theta = 0."""
    n, p = A.shape
    length = np.sqrt(np.square(A).sum(axis=0))
    there = length > 0.0
    scale = np.where(there, length, 1.0)
    U, s, Vt = np.linalg.svd(A / scale, full_matrices=False)
    ratio = s / s[0] if s[0] > 0.0 else s
    kept = ratio > np.finfo(float).eps * max(n, p)
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=kept)
    theta = (Vt.T @ (inverse * (U.T @ y))) / scale
    residual = y - A @ theta
    bread = ((Vt.T * inverse**2) @ Vt) / np.outer(scale, scale)
    covariance = bread @ long_run(A * residual[:, np.newaxis]) @ bread * (n / max(1, n - p))
    unseen = tuple(
        tuple(int(k) for k in np.flatnonzero(np.abs(Vt[i]) >= _PART_OF)) for i in np.flatnonzero(ratio < _UNSEEN)
    )
    return Fit(theta, covariance, residual, ratio, unseen)


def long_run(scores: Array) -> Array:
    """Long-run sum of squares S (p, p) of scores (n, p) by Newey and West, with Andrews' length."""
    n = len(scores)
    lag = correlated_for(scores)
    S = scores.T @ scores
    for k in range(1, min(lag, n - 1) + 1):
        part = scores[k:].T @ scores[:-k]
        S = S + (1.0 - k / (lag + 1.0)) * (part + part.T)
    return np.asarray(S, dtype=np.float64)


def correlated_for(scores: Array) -> int:
    """Samples L over which scores (n, p) are taken to be correlated."""
    before, after = scores[:-1], scores[1:]
    squares = np.square(before).sum(axis=0)
    rho = np.divide((before * after).sum(axis=0), squares, out=np.zeros(scores.shape[1]), where=squares > 0.0)
    rho = np.clip(rho, _WHITEST, _REDDEST)
    alpha = float((4.0 * rho**2 / (1.0 - rho**2) ** 2).max(initial=0.0))
    length: float = _ANDREWS * (alpha * len(scores)) ** (1.0 / 3.0)
    return math.ceil(length)
