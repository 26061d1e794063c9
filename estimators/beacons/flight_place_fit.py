"""Batch fit of a beacon's place b (3,) to what is read of it from a way p_k (N, 3) that is estimated without it.

    minimise  c(b) = sum_k w_k (y_k - h_k(p_k, b))^2,    w_k = 1 / (R_k + g_k' P_k g_k),

h_k a range, an azimuth or an elevation of ``beacon_readings``, R_k the variance of its noise, g_k its derivative by the
position, of covariance P_k, by Levenberg and Marquardt's steps. A difference is a range once the range from p_k to
beacon 0 is added. Its g_k, the difference of two directions, may be anything from 0 to 2 long at another place, where
g_k' P_k g_k is at most twice the sum of what both directions have: that is taken. Readings shortly after one another
have the error of the position in common, by which another place than the true one may fit better; so P_k counts three
times, for few places are to be excluded before filters compare them. Of ranges alone it does not, of which g_k is
nearly the same for all. Of each beacon there is one difference an instant, so that the noise of
the arrival from beacon 0 is independent from one to the next: R_k is twice that of a range.

The steps begin where a reading says that the place is: all around the way at the range that was read in its middle, and
along the rays of three bearings, at distances from 10 m to 100 km; and from the mirror images of the best place in the
plane of the way and across it. Where readings may be anything, r^2 is replaced by Cauchy's q log(1 + r^2 / q).

From a way in a plane the mirror image of a place has the same ranges, from a straight one each place on a circle. So
all minima are returned that fit nearly as well, with their costs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.aerial.beacon_readings import AZIMUTH, DIFFERENCE, ELEVATION, NEAREST, RANGE
from mathnavi.models.angles import wrapped

_AROUND = 24  # directions in which fits begin, and places on rays at which they do
_ON_RAYS = (0.25, 0.5, 0.75)  # of the way, where the bearings were read
_NEAR, _FAR = 10.0, 1e5  # [m] along them
_COARSE, _STEPS, _POLISH = 40, 15, 8  # readings of a kind in the first steps, and numbers of steps
_CAUCHY = 25.0  # q
_IN_COMMON = 3.0  # times that the variance of a position counts, but for ranges alone
_APART = 16.0  # squared Mahalanobis distance from which on a place is another one
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))
NEARLY = 60.0
"""largest cost of another minimum that is returned, less the least"""


@dataclass(frozen=True, eq=False)
class PlaceFit:
    """A place that readings fit."""

    place: Array  # (3,) [m]
    information: Array  # (3, 3) [1/m^2]
    cost: float

    @property
    def deviation(self) -> float:
        """Standard deviation [m] in the worst direction; inf where one is not observed."""
        least = float(np.linalg.eigvalsh(self.information)[0])
        return 1.0 / math.sqrt(least) if least > 0.0 else math.inf


@dataclass(frozen=True, eq=False)
class PlaceReadings:
    """Numbers (N,) that were read of one beacon, those of a kind one after the other, in the order of their times."""

    kinds: Integers  # (N,) of ``beacon_readings``
    y: Array  # (N,) [m, rad]; a difference with the range to beacon 0 from p added
    variance: Array  # (N,) of their noise, that of a difference with the arrival from beacon 0
    p: Array  # (N, 3) [m] positions from which they were read
    P: Array  # (N, 3, 3) [m^2] their covariances
    reference: Array  # (N, 3) derivative of the range to beacon 0 by p, of a difference; else 0

    def of(self, which: Integers) -> PlaceReadings:
        """Some of them."""
        some = (self.y[which], self.variance[which], self.p[which], self.P[which], self.reference[which])
        return PlaceReadings(self.kinds[which], *some)

    def spread(self, place: Array) -> PlaceReadings:
        """The same with variances that the positions add to, for a ``place`` (3,)."""
        e = self.p - place
        g = e / np.maximum(np.linalg.norm(e, axis=1), NEAREST)[:, None]
        for kind in (AZIMUTH, ELEVATION):
            of_kind = self.kinds == kind
            g[of_kind] = _bearings(kind, e[of_kind])[1]  # but for its sign
        added = np.einsum("ni,nij,nj->n", g, self.P, g)
        if not (self.kinds == RANGE).all():
            differs = self.kinds == DIFFERENCE
            both = added + np.einsum("ni,nij,nj->n", self.reference, self.P, self.reference)
            added = _IN_COMMON * np.where(differs, 2.0 * both, added)
        return replace(self, variance=self.variance + added)


def place_fits(read: PlaceReadings, *, outliers: bool) -> list[PlaceFit]:
    """Places that fit what was read, the best first, and all whose costs are greater by no more than ``NEARLY``."""
    p, n = read.p, len(read.y)
    by_kind = [np.flatnonzero(read.kinds == kind) for kind in np.unique(read.kinds)]
    coarse = np.concatenate(
        [each[np.unique(np.linspace(0, len(each) - 1, min(len(each), _COARSE)).astype(np.int64))] for each in by_kind]
    )
    found = _descended(_begun(read), read.of(coarse), _STEPS, cauchy=False)
    centre = p.mean(axis=0)
    axes = np.linalg.svd(p - centre, full_matrices=True)[2] if n < 4 else np.linalg.eigh(np.cov((p - centre).T))[1].T
    found = found[np.argsort(_costs(found, read.of(coarse), cauchy=False), kind="stable")]
    images = [found[0] - 2.0 * np.outer(e, e) @ (found[0] - centre) for e in axes]
    read = read.spread(found[0])
    found = np.vstack([found[: _AROUND // 2], images])
    found = _descended(found, read.of(coarse), _STEPS, cauchy=outliers)
    places = np.array([each.place for each in _distinct(found, read.of(coarse), outliers=outliers)])
    fits = _distinct(_descended(places, read, _POLISH, cauchy=outliers), read, outliers=outliers)
    return [each for each in fits if each.cost <= fits[0].cost + NEARLY]


def _begun(read: PlaceReadings) -> Array:
    """Places (K, 3) [m] at which fits begin."""
    k = np.arange(_AROUND)
    z = 1.0 - (2.0 * k + 1.0) / _AROUND
    r = np.sqrt(1.0 - z * z)
    around = np.column_stack([r * np.cos(_GOLDEN * k), r * np.sin(_GOLDEN * k), z])
    angles = (read.kinds == AZIMUTH) | (read.kinds == ELEVATION)
    ranges, azimuths, elevations = map(np.flatnonzero, (~angles, read.kinds == AZIMUTH, read.kinds == ELEVATION))
    begun = [read.p[k] + read.y[k] * around for k in ranges[len(ranges) // 2 :][:1]]
    distances = np.geomspace(_NEAR, _FAR, _AROUND // len(_ON_RAYS))
    for share in _ON_RAYS if angles.any() else ():
        rows = [each[int(share * len(each))] if len(each) else -1 for each in (azimuths, elevations)]
        az, el = (float(read.y[k]) if k >= 0 else 0.0 for k in rows)  # on the horizon, where there is no elevation
        ray = np.array([math.cos(az) * math.cos(el), math.sin(az) * math.cos(el), math.sin(el)])
        begun.append(read.p[max(rows)] + distances[:, None] * ray)
    return np.vstack(begun)


def _distinct(places: Array, read: PlaceReadings, *, outliers: bool) -> list[PlaceFit]:
    """Fits at places (K, 3) that are not one and the same, the best first."""
    costs = _costs(places, read, cauchy=outliers)
    kept: list[PlaceFit] = []
    for k in np.argsort(costs, kind="stable").tolist():
        J, _, w = _linear(places[k : k + 1], read, cauchy=outliers)
        information = np.einsum("n,ni,nj->ij", w[0], J[0], J[0])
        away = [each.place - places[k] for each in kept]
        if all(
            float(d @ each.information @ d) > _APART and float(d @ d) > 1e-6 for d, each in zip(away, kept, strict=True)
        ):
            kept.append(PlaceFit(places[k], information, float(costs[k])))
    return kept


def _linear(b: Array, read: PlaceReadings, *, cauchy: bool) -> tuple[Array, Array, Array]:
    """Derivatives (K, N, 3) of the numbers by places b (K, 3), residuals (K, N) and weights (K, N)."""
    d = b[:, None, :] - read.p
    rho = np.maximum(np.sqrt(np.einsum("kni,kni->kn", d, d)), NEAREST)
    J, r = d / rho[:, :, None], read.y - rho
    for kind in (AZIMUTH, ELEVATION):
        of_kind: NDArray[np.bool_] = read.kinds == kind
        if of_kind.any():
            h, J[:, of_kind] = _bearings(kind, d[:, of_kind])
            r[:, of_kind] = wrapped(read.y[of_kind] - h)
    w = np.broadcast_to(1.0 / read.variance, r.shape)
    return J, r, w / (1.0 + w * r * r / _CAUCHY) if cauchy else w


def _bearings(kind: int, d: Array) -> tuple[Array, Array]:
    """Azimuths or elevations (...) of d (..., 3), and their derivatives (..., 3)."""
    x, y, z = np.moveaxis(d, -1, 0)
    rr = np.maximum(x * x + y * y, NEAREST**2)
    if kind == AZIMUTH:
        return np.arctan2(y, x), np.stack([-y / rr, x / rr, np.zeros_like(x)], axis=-1)
    r, square = np.sqrt(rr), rr + z * z
    return np.arctan2(z, r), np.stack([-z * x / r, -z * y / r, r], axis=-1) / square[..., None]


def _costs(b: Array, read: PlaceReadings, *, cauchy: bool) -> Array:
    """Costs (K,) at places (K, 3)."""
    squares = np.square(_linear(b, read, cauchy=False)[1]) / read.variance
    costs: Array = (_CAUCHY * np.log1p(squares / _CAUCHY) if cauchy else squares).sum(axis=1)
    return costs


def _descended(b: Array, read: PlaceReadings, steps: int, *, cauchy: bool) -> Array:
    """Places (K, 3) after some steps from b (K, 3), each with its own damping."""
    damping, cost = np.full(len(b), 1e-3), _costs(b, read, cauchy=cauchy)
    for _ in range(steps):
        J, r, w = _linear(b, read, cauchy=cauchy)
        A = np.einsum("kn,kni,knj->kij", w, J, J)
        g = np.einsum("kn,kni,kn->ki", w, J, r)
        scale = np.maximum(np.trace(A, axis1=1, axis2=2), 1e-12)
        tried = b + np.linalg.solve(A + (damping * scale)[:, None, None] * np.eye(3), g[:, :, None])[:, :, 0]
        new = _costs(tried, read, cauchy=cauchy)
        better = new < cost
        b, cost = np.where(better[:, None], tried, b), np.where(better, new, cost)
        damping = np.clip(np.where(better, 0.2 * damping, 5.0 * damping), 1e-9, 1e3)
    return b
