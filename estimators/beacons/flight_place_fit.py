"""Batch fit of a beacon's place b (3,) to its ranges from a way p_k (N, 3) that is estimated without them.

    minimise  c(b) = sum_k w_k (y_k - |p_k - b|)^2,    w_k = 1 / (sigma^2 + e_k' P_k e_k),

e_k the direction of the range and P_k the covariance of the position, by Levenberg and Marquardt's steps from places
all around the way, at the range that was read in its middle, and from the mirror images of the best place in the plane
of the way and across it. Where readings may be anything, r^2 is replaced by Cauchy's q log(1 + r^2 / q).

From a way in a plane the mirror image of a place has the same ranges, from a straight one each place on a circle. So
all minima are returned that fit nearly as well, with their costs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mathnavi.interfaces.signals import Array

_AROUND = 24  # directions in which fits begin
_COARSE, _STEPS, _POLISH = 40, 15, 8  # readings of the first steps, and numbers of steps
_CAUCHY = 25.0  # q
_APART = 16.0  # squared Mahalanobis distance from which on a place is another one
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))
NEARLY = 60.0
"""largest cost of another minimum that is returned, less the least"""


@dataclass(frozen=True, eq=False)
class PlaceFit:
    """A place that ranges fit."""

    place: Array  # (3,) [m]
    information: Array  # (3, 3) [1/m^2]
    cost: float

    @property
    def deviation(self) -> float:
        """Standard deviation [m] in the worst direction; inf where one is not observed."""
        least = float(np.linalg.eigvalsh(self.information)[0])
        return 1.0 / math.sqrt(least) if least > 0.0 else math.inf


def place_fits(p: Array, P: Array, y: Array, sigma: float, *, outliers: bool) -> list[PlaceFit]:
    """Places that fit ranges y (N,) [m] of deviation ``sigma`` [m] from positions p (N, 3) [m] of covariances P (N, 3,
    3), the best first, and all whose costs are greater by no more than ``NEARLY``.
    """
    n = len(y)
    variance = np.full(n, sigma**2)
    coarse = np.unique(np.linspace(0, n - 1, min(n, _COARSE)).astype(np.int64))
    k = np.arange(_AROUND)
    z = 1.0 - (2.0 * k + 1.0) / _AROUND
    r = np.sqrt(1.0 - z * z)
    around = np.column_stack([r * np.cos(_GOLDEN * k), r * np.sin(_GOLDEN * k), z])
    begun = p[n // 2] + y[n // 2] * around
    found = _descended(begun, p[coarse], y[coarse], variance[coarse], _STEPS, cauchy=False)
    centre = p.mean(axis=0)
    axes = np.linalg.svd(p - centre, full_matrices=True)[2] if n < 4 else np.linalg.eigh(np.cov((p - centre).T))[1].T
    cost = _costs(found, p[coarse], y[coarse], variance[coarse], cauchy=False)
    found = found[np.argsort(cost, kind="stable")]
    images = [found[0] - 2.0 * np.outer(e, e) @ (found[0] - centre) for e in axes]
    found = np.vstack([found[: _AROUND // 2], images])
    e = p - found[0]
    e /= np.maximum(np.linalg.norm(e, axis=1), 1e-6)[:, None]
    variance = variance + np.einsum("ni,nij,nj->n", e, P, e)
    found = _descended(found, p[coarse], y[coarse], variance[coarse], _STEPS, cauchy=outliers)
    distinct = _distinct(found, p[coarse], y[coarse], variance[coarse], outliers=outliers)
    places = np.array([each.place for each in distinct])
    polished = _descended(places, p, y, variance, _POLISH, cauchy=outliers)
    fits = _distinct(polished, p, y, variance, outliers=outliers)
    return [each for each in fits if each.cost <= fits[0].cost + NEARLY]


def _distinct(places: Array, p: Array, y: Array, variance: Array, *, outliers: bool) -> list[PlaceFit]:
    """Fits at places (K, 3) that are not one and the same, the best first."""
    costs = _costs(places, p, y, variance, cauchy=outliers)
    kept: list[PlaceFit] = []
    for k in np.argsort(costs, kind="stable").tolist():
        J, _, w = _linear(places[k : k + 1], p, y, variance, cauchy=outliers)
        information = np.einsum("n,ni,nj->ij", w[0], J[0], J[0])
        away = [each.place - places[k] for each in kept]
        if all(
            float(d @ each.information @ d) > _APART and float(d @ d) > 1e-6 for d, each in zip(away, kept, strict=True)
        ):
            kept.append(PlaceFit(places[k], information, float(costs[k])))
    return kept


def _linear(b: Array, p: Array, y: Array, variance: Array, *, cauchy: bool) -> tuple[Array, Array, Array]:
    """Derivatives (K, N, 3) of ranges from p (N, 3) to b (K, 3), residuals (K, N) and weights (K, N)."""
    d = b[:, None, :] - p
    rho = np.maximum(np.sqrt(np.einsum("kni,kni->kn", d, d)), 1e-6)
    r = y - rho
    w = np.broadcast_to(1.0 / variance, r.shape)
    return d / rho[:, :, None], r, w / (1.0 + w * r * r / _CAUCHY) if cauchy else w


def _costs(b: Array, p: Array, y: Array, variance: Array, *, cauchy: bool) -> Array:
    """Costs (K,) at places (K, 3)."""
    squares = np.square(_linear(b, p, y, variance, cauchy=False)[1]) / variance
    costs: Array = (_CAUCHY * np.log1p(squares / _CAUCHY) if cauchy else squares).sum(axis=1)
    return costs


def _descended(b: Array, p: Array, y: Array, variance: Array, steps: int, *, cauchy: bool) -> Array:
    """Places (K, 3) after some steps from b (K, 3), each with its own damping."""
    damping, cost = np.full(len(b), 1e-3), _costs(b, p, y, variance, cauchy=cauchy)
    for _ in range(steps):
        J, r, w = _linear(b, p, y, variance, cauchy=cauchy)
        A = np.einsum("kn,kni,knj->kij", w, J, J)
        g = np.einsum("kn,kni,kn->ki", w, J, r)
        scale = np.maximum(np.trace(A, axis1=1, axis2=2), 1e-12)
        tried = b + np.linalg.solve(A + (damping * scale)[:, None, None] * np.eye(3), g[:, :, None])[:, :, 0]
        new = _costs(tried, p, y, variance, cauchy=cauchy)
        better = new < cost
        b, cost = np.where(better[:, None], tried, b), np.where(better, new, cost)
        damping = np.clip(np.where(better, 0.2 * damping, 5.0 * damping), 1e-9, 1e3)
    return b
