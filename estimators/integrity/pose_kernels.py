"""Innovations of ranges, and dead reckoning, from what an estimator of a pose publishes: (x, P) (3,), (3, 3); compiled.

From the estimate of the last update, (x, P), the pose moves by the odometry u over dt,

    x- = f(x, u),      P- = F P F' + G W G' + s_b^2 (G u)(G u)',

s_b being the deviation of the odometry's scale error. A ray reads z_i = h_i(x-) + nu_i, of variance

    S_ij = H_i P- H_j' + delta_ij (r_i + tr(h_i'' P- h_i'' P-) / 2)      (see ``kalman_kernels``).

**Dead reckoning**: copies of former estimates, branches, are moved by the odometry alone. After n updates what the
readings have moved the estimate by, d = x_k - x_branch, is tested by d' P_branch^-1 d against chi-square with three
degrees of freedom: an upper bound of the exact covariance, that of the sum of the corrections. It finds what a filter
follows: a fault that it has absorbed, and odometry that is wrong.

All of an update is one kernel, ``observe``: a call from Python costs as much as its arithmetic.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.integrity.windows import IMPOSSIBLE, RECKONED, Flags, add, worst_of
from mathnavi.estimators.integrity.witness import is_possible
from mathnavi.estimators.ranging.bank_kernels import BY_HEADING, GRIP
from mathnavi.estimators.ranging.kalman_kernels import expected_range, square_trace
from mathnavi.estimators.ranging.reading_kernels import is_within
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.field.kernels import WallShape
from mathnavi.models.unicycle.kernels import motion, wrapped

RELATIVE, ABSOLUTE, LONGEST, SCALE, W_1, W_2, FASTEST, TURNING, Z = range(9)
"""constants of an update: relative and absolute [m] deviation of a range, length [m] of a lost one, s_b, variances of
the odometry and the largest that can be [m/s, rad/s], threshold of a mean"""
_MOST_SLIP = 10.0  # times its mean that slip may be in a moment, as after a turn
_P, _S, AGE = 3, 12, 15  # columns of a branch: x (3,), P (3, 3) without the scale error, s = dx/db (3,), updates or -1
LAST, FIRST, NOW, TIMES = range(4)
"""rows of repeats (4, l): last reading [m], range [m] expected at the first and at the last of those that repeated it
to the last bit, and their number"""


def no_branches(count: int) -> Array:
    """Room (B, 16) for ``count`` branches: former estimates that the odometry alone moves."""
    branches = np.zeros((count, AGE + 1))
    branches[:, AGE] = -1.0
    return branches


def no_repeats(rays: int) -> Array:
    """Repeats (4, l) before the first reading of each ray."""
    repeats = np.full((4, rays), np.nan)
    repeats[TIMES] = 0.0
    return repeats


@njit(cache=True, nogil=True)
def observe(
    coefficients: Array,
    polyline: Array,
    angles: Array,
    constants: Array,
    lengths: Integers,
    energy: Array,
    sums: Array,
    branches: Array,
    repeats: Array,
    k: int,
    kappa: float,
    sigma: float,
    slip: float,
    x: Array,
    P: Array,
    x_after: Array,
    P_after: Array,
    dt: float,
    rho: Array,
    odometry: Array,
    command: Array,
    used: Flags,
) -> tuple[float, int, int, int]:
    """Take an update of an estimator from x (3,), P (3, 3) to those ``after`` it, dt [s] later.

    It reads ranges rho (l,) and odometry (2,), both NaN for none; the ``command`` (2,) takes the place of odometry.
    ``used`` (l,) says which rays the estimator was given; ``k`` is the number of updates in the sums, and ``kappa`` the
    variance over the declared one; ``sigma`` is the deviation of ranges over the declared one, and ``slip`` [m^2/s] the
    process noise of wheels, where an estimator finds them itself. Returns the worst statistic over its threshold, its
    test and its channel, and the largest number of repeated readings.
    """
    reckons = is_within(odometry, constants[FASTEST : TURNING + 1])
    u = odometry if reckons else command
    slip = max(slip - GRIP, 0.0) * dt
    scale, one = constants[SCALE], np.zeros((1, AGE))
    for i in range(3):
        one[0, i] = x[i]
        for j in range(3):
            one[0, _P + 3 * i + j] = P[i, j]
    _move(one[0], u, constants, _MOST_SLIP * slip, dt)
    x_now, P_now = one[0, :_P], np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            P_now[i, j] = one[0, _P + 3 * i + j] + scale * scale * one[0, _S + i] * one[0, _S + j]
    noise = sigma * constants[RELATIVE], sigma * constants[ABSOLUTE], constants[LONGEST]
    e, white, expected = innovations((coefficients, polyline), angles, noise, x_now, P_now, rho, used)
    add(sums, k, e, white)
    most = _note_repeats(repeats, rho, expected)
    if not is_possible(x_after, P_after):
        return math.inf, IMPOSSIBLE, -1, most
    ratio, test, channel = worst_of(sums, k + 1, used, lengths, kappa, constants[Z], energy)
    if reckons:
        dead = _reckoned(branches, lengths[1:], x_after, u, constants, slip, dt) / (kappa * energy[3])
        if dead > ratio:
            ratio, test, channel = dead, RECKONED, -1
    else:
        branches[:, AGE] = -1.0
    return ratio, test, channel, most


@njit(cache=True, nogil=True)
def begin_branch(branches: Array, x: Array, P: Array) -> None:
    """Begin a branch at an estimate x (3,), P (3, 3), in a place that is free."""
    for n in range(len(branches)):
        if branches[n, AGE] < 0.0:
            for i in range(3):
                branches[n, i], branches[n, _S + i] = x[i], 0.0
                for j in range(3):
                    branches[n, _P + 3 * i + j] = P[i, j]
            branches[n, AGE] = 0.0
            return


@njit(cache=True, nogil=True)
def _move(branch: Array, u: Array, constants: Array, slip: float, dt: float) -> None:
    """Move a branch (16,) in place over dt [s] under the odometry u (2,): x, P = F P F' + G W G', s = F s - G u.

    ``slip`` [m^2] is the variance of a position by wheels that slip meanwhile.
    """
    W_x, W_y = constants[W_1], constants[W_2]
    d_x, d_y, a_x, a_y, b_x, b_y = motion(branch[2], u[0], u[1], dt)
    branch[0] += d_x
    branch[1] += d_y
    branch[2] += u[1] * dt
    s, P = branch[_S:], branch[_P:]
    s[0] += -d_y * s[2] - a_x * u[0] - b_x * u[1]
    s[1] += d_x * s[2] - a_y * u[0] - b_y * u[1]
    s[2] -= dt * u[1]
    for j in range(3):  # F is the identity but for two entries
        P[j] -= d_y * P[6 + j]
        P[3 + j] += d_x * P[6 + j]
    for j in range(3):
        P[3 * j] -= d_y * P[3 * j + 2]
        P[3 * j + 1] += d_x * P[3 * j + 2]
    across = a_x * W_x * a_y + b_x * W_y * b_y
    P[0] += a_x * W_x * a_x + b_x * W_y * b_x
    P[1] += across
    P[3] += across
    P[4] += a_y * W_x * a_y + b_y * W_y * b_y
    P[2] += b_x * W_y * dt
    P[6] += b_x * W_y * dt
    P[5] += b_y * W_y * dt
    P[7] += b_y * W_y * dt
    P[8] += dt * W_y * dt + slip * BY_HEADING**2
    P[0] += slip
    P[4] += slip


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
    H, PH, D, nu, r = np.empty((n, 3)), np.empty((n, 3)), np.empty(3), np.empty(n), np.empty(n)
    L, rows, count = np.zeros((n, n)), np.empty(n, np.int64), 0
    for i in range(n):
        h, B, C = expected_range(wall, x[0], x[1], x[2] + angles[i], H[i], D)
        expected[i] = h
        if math.isnan(h) or not 0.0 < z[i] < noise[2]:
            continue
        nu[i], r[i] = z[i] - h, (noise[0] * h) ** 2 + noise[1] ** 2 + 0.5 * square_trace(P, D, h, B, C, H[i])
        for j in range(3):
            PH[i, j] = P[j, 0] * H[i, 0] + P[j, 1] * H[i, 1] + P[j, 2] * H[i, 2]
        e[i] = nu[i] / math.sqrt(H[i, 0] * PH[i, 0] + H[i, 1] * PH[i, 1] + H[i, 2] * PH[i, 2] + r[i])
        if used[i]:
            rows[count] = i
            count += 1
    for a in range(count):  # Cholesky's factor of S, row by row, and w by forward substitution
        i = rows[a]
        total = nu[i]
        for b in range(a + 1):
            j = rows[b]
            s = H[j, 0] * PH[i, 0] + H[j, 1] * PH[i, 1] + H[j, 2] * PH[i, 2]
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
def _reckoned(
    branches: Array, lengths: Integers, x: Array, u: Array, constants: Array, slip: float, dt: float
) -> float:
    """Move the branches over dt [s], and return the largest d' P^-1 d of those whose age is one of ``lengths``."""
    worst, S, d, square = 0.0, np.empty((3, 3)), np.empty(3), constants[SCALE] * constants[SCALE]
    for n in range(len(branches)):
        branch = branches[n]
        if branch[AGE] < 0.0:
            continue
        _move(branch, u, constants, slip, dt)
        branch[AGE] += 1.0
        for length in lengths:
            if branch[AGE] == length:
                for i in range(3):
                    d[i] = x[i] - branch[i]
                    for j in range(3):
                        S[i, j] = branch[_P + 3 * i + j] + square * branch[_S + i] * branch[_S + j]
                d[2] = wrapped(d[2])
                worst = max(worst, _square(S, d))
        if branch[AGE] >= lengths[-1]:
            branch[AGE] = -1.0
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
def _note_repeats(repeats: Array, z: Array, expected: Array) -> int:
    """Take readings z (l,), NaN for none, and what was expected (l,); returns the largest number of repeats."""
    most = 0
    for i in range(len(z)):
        if math.isnan(z[i]):
            continue
        if z[i] == repeats[LAST, i]:
            repeats[TIMES, i] += 1.0
        else:
            repeats[TIMES, i], repeats[LAST, i], repeats[FIRST, i] = 0.0, z[i], expected[i]
        repeats[NOW, i] = expected[i]
        most = max(most, int(repeats[TIMES, i]))
    return most
