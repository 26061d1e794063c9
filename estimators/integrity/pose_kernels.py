"""Innovations of ranges, and dead reckoning, from what an estimator of a pose publishes: (x, P) (3,), (3, 3); compiled.

From the estimate of the last update, (x, P), the pose moves by the odometry u over dt,

    x- = f(x, u),      P- = F P F' + G W G' + s_b^2 (G u)(G u)',

s_b being the deviation of the odometry's scale error. A ray reads z_i = h_i(x-) + nu_i, of variance

    S_ij = H_i P- H_j' + delta_ij (r_i + tr(h_i'' P- h_i'' P-) / 2)      (see ``kalman_kernels``).

**Dead reckoning**: copies of former estimates, branches, are moved by the odometry alone. After n updates what the
readings have moved the estimate by, d = x_k - x_branch, is tested by d' P_branch^-1 d against chi-square with three
degrees of freedom: an upper bound of the exact covariance, that of the sum of the corrections. It finds what a filter
follows: a fault that it has absorbed, and odometry that is wrong.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mathnavi.estimators.integrity.windows import Flags
from mathnavi.estimators.ranging.kalman_kernels import expected_range, square_trace
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.field.kernels import WallShape
from mathnavi.models.unicycle.kernels import integrate, integrate_jacobians, wrapped


class Branches(NamedTuple):
    """Copies of former estimates that the odometry alone moves."""

    x: Array  # (B, 3)
    P: Array  # (B, 3, 3) without the odometry's scale error
    s: Array  # (B, 3) dx/db, b being that error
    age: Integers  # (B,) updates; -1 for a place that is free


def no_branches(count: int) -> Branches:
    """Room for ``count`` branches."""
    return Branches(np.zeros((count, 3)), np.zeros((count, 3, 3)), np.zeros((count, 3)), np.full(count, -1, np.int64))


@njit(cache=True, nogil=True)
def predicted(x: Array, P: Array, u: Array, W: Array, scale: float, dt: float) -> tuple[Array, Array]:
    """Pose x- (3,) and its covariance P- (3, 3) after dt [s] under the odometry u (2,) of variances W (2,)."""
    F, G = integrate_jacobians(x, u[0], u[1], dt)
    after = integrate(x, u[0], u[1], dt)
    moved = F @ P @ F.T
    for i in range(3):
        b_i = scale * (G[i, 0] * u[0] + G[i, 1] * u[1])
        for j in range(3):
            b_j = scale * (G[j, 0] * u[0] + G[j, 1] * u[1])
            moved[i, j] += G[i, 0] * W[0] * G[j, 0] + G[i, 1] * W[1] * G[j, 1] + b_i * b_j
    return after, moved


@njit(cache=True, nogil=True)
def innovations(
    wall: WallShape, angles: Array, noise: tuple[float, float, float], x: Array, P: Array, z: Array, used: Flags
) -> tuple[Array, Array, Array]:
    """e (l,), w (l,) and the expected ranges (l,) of readings z (l,) from the prediction x (3,), P (3, 3).

    e is NaN where nothing was read or a ray has no information, w also where a ray is not ``used`` (l,). ``noise`` is
    the relative and the absolute deviation of a range, and the length [m] from which on one is lost.
    """
    n = len(z)
    e, white, expected = np.full(n, np.nan), np.full(n, np.nan), np.full(n, np.nan)
    H, D, nu, r = np.empty((n, 3)), np.empty(3), np.empty(n), np.empty(n)
    L, rows, count = np.zeros((n, n)), np.empty(n, np.int64), 0
    for i in range(n):
        h, B, C = expected_range(wall, x[0], x[1], x[2] + angles[i], H[i], D)
        expected[i] = h
        if math.isnan(h) or not 0.0 < z[i] < noise[2]:
            continue
        nu[i], r[i] = z[i] - h, (noise[0] * h) ** 2 + noise[1] ** 2 + 0.5 * square_trace(P, D, h, B, C, H[i])
        e[i] = nu[i] / math.sqrt(H[i] @ P @ H[i] + r[i])
        if used[i]:
            rows[count] = i
            count += 1
    for a in range(count):  # Cholesky's factor of S, row by row, and w by forward substitution
        i = rows[a]
        PH = P @ H[i]
        total = nu[i]
        for b in range(a + 1):
            j = rows[b]
            s = H[j] @ PH
            if a == b:
                s += r[i]
            for c in range(b):
                s -= L[a, c] * L[b, c]
            if a == b:
                if not s > 0.0:
                    return e, np.full(n, np.nan), expected
                L[a, a] = math.sqrt(s)
            else:
                L[a, b] = s / L[b, b]
                total -= L[a, b] * white[j]
        white[i] = total / L[a, a]
    return e, white, expected


@njit(cache=True, nogil=True)
def reckoned(branches: Branches, lengths: Integers, x: Array, u: Array, W: Array, scale: float, dt: float) -> float:
    """Move the branches over dt [s], and return the largest d' P^-1 d of those whose age is one of ``lengths``."""
    worst = 0.0
    for n in range(len(branches.age)):
        if branches.age[n] < 0:
            continue
        F, G = integrate_jacobians(branches.x[n], u[0], u[1], dt)
        branches.x[n] = integrate(branches.x[n], u[0], u[1], dt)
        branches.P[n] = F @ branches.P[n] @ F.T
        branches.s[n] = F @ branches.s[n] - G @ u
        for i in range(3):
            for j in range(3):
                branches.P[n, i, j] += G[i, 0] * W[0] * G[j, 0] + G[i, 1] * W[1] * G[j, 1]
        branches.age[n] += 1
        for length in lengths:
            if branches.age[n] == length:
                d = x - branches.x[n]
                d[2] = wrapped(d[2])
                S = branches.P[n].copy()
                for i in range(3):
                    for j in range(3):
                        S[i, j] += scale * scale * branches.s[n, i] * branches.s[n, j]
                worst = max(worst, _square(S, d))
        if branches.age[n] >= lengths[-1]:
            branches.age[n] = -1
    return worst


@njit(cache=True, nogil=True)
def _square(S: Array, d: Array) -> float:
    """d' S^-1 d (3,) by Cholesky's factor; 0 if S is not positive definite."""
    L, total = np.zeros((3, 3)), 0.0
    y = np.zeros(3)
    for i in range(3):
        y[i] = d[i]
        for j in range(i + 1):
            s = S[i, j]
            for c in range(j):
                s -= L[i, c] * L[j, c]
            if i == j:
                if not s > 0.0:
                    return 0.0
                L[i, i] = math.sqrt(s)
            else:
                L[i, j] = s / L[j, j]
                y[i] -= L[i, j] * y[j]
        y[i] /= L[i, i]
        total += y[i] * y[i]
    return total


@njit(cache=True, nogil=True)
def branch(branches: Branches, x: Array, P: Array) -> None:
    """Begin a branch at an estimate x (3,), P (3, 3), in a place that is free."""
    for n in range(len(branches.age)):
        if branches.age[n] < 0:
            branches.x[n], branches.P[n], branches.s[n], branches.age[n] = x, P, 0.0, 0
            return


class Repeats(NamedTuple):
    """Readings that are repeated to the last bit."""

    last: Array  # (l,) [m] last reading
    first: Array  # (l,) [m] expected at the first of them
    now: Array  # (l,) [m] expected at the last
    times: Integers  # (l,) that it was repeated


def no_repeats(rays: int) -> Repeats:
    """Repeats before the first reading of each ray."""
    last, first, now = np.full((3, rays), np.nan)
    return Repeats(last, first, now, np.zeros(rays, np.int64))


@njit(cache=True, nogil=True)
def note_repeats(repeats: Repeats, z: Array, expected: Array) -> int:
    """Take readings z (l,), NaN for none, and what was expected (l,); returns the largest number of repeats."""
    most = 0
    for i in range(len(z)):
        if math.isnan(z[i]):
            continue
        if z[i] == repeats.last[i]:
            repeats.times[i] += 1
        else:
            repeats.times[i], repeats.last[i], repeats.first[i] = 0, z[i], expected[i]
        repeats.now[i] = expected[i]
        most = max(most, repeats.times[i])
    return most
