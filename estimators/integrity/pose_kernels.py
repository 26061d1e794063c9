"""Innovations of ranges, and dead reckoning, from what an estimator of a pose publishes: (x, P) (3,), (3, 3); compiled.

From the estimate of the last update, (x, P), the pose moves by the odometry u over dt,

    x- = f(x, u),      P- = F P F' + G W G' + s_b^2 (G u)(G u)',

s_b being the deviation of the odometry's scale error. A ray reads z_i = h_i(x-) + nu_i, of variance

    S_ij = H_i P- H_j' + delta_ij (r_i + tr(h_i'' P- h_i'' P-) / 2)      (see ``kalman_kernels``).

**Dead reckoning**: copies of former estimates, branches, are moved by the odometry alone. After n updates what the
readings have moved the estimate by, d = x_k - x_branch, is tested by d' P_branch^-1 d against chi-square with three
degrees of freedom: an upper bound of the exact covariance, that of the sum of the corrections. It finds what a filter
follows: a fault that it has absorbed, and odometry that is wrong.

Wheels that slip are within P_branch where an estimator has found that they do. A ray that drifts looks like that to a
filter with two others; so dead reckoning is also tested as if they did not, strictly. While wheels are taken to slip an
estimate is worse than theirs that do not: what is beyond d' (P_branch + P_k)^-1 d too can be no such error, and is a
reason to doubt the estimate.

**Odometry that is left out** has the variance W' of a robot that moves anyhow in the predictions. Branches are moved by
what it reads, as declared; their d is then tested by d' (P_branch + P_k)^-1 d, for the estimate does not follow them: a
test of the odometry alone.

All of an update is one kernel, ``observe``: a call from Python costs as much as its arithmetic.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.integrity.pose_protection import deviations, note_motion, respond, square
from mathnavi.estimators.integrity.windows import IMPOSSIBLE, RECKONED, Flags, add, worst_of
from mathnavi.estimators.integrity.witness import is_possible
from mathnavi.estimators.ranging.bank_kernels import BY_HEADING, GRIP
from mathnavi.estimators.ranging.kalman_kernels import expected_range, square_trace
from mathnavi.estimators.ranging.reading_kernels import is_within
from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.field.kernels import WallShape
from mathnavi.models.unicycle.kernels import motion, wrapped

RELATIVE, ABSOLUTE, LONGEST, SCALE, W_1, W_2, FASTEST, TURNING, Z, LEFT_1, LEFT_2, ALERTED = range(12)
"""constants of an update: relative and absolute [m] deviation of a range, length [m] of a lost one, s_b, variances of
the odometry and the largest that can be [m/s, rad/s], threshold of a mean, variances of odometry that is left out,
updates until an alert"""
_MOST_SLIP = 10.0  # times its mean that slip may be in a moment, as after a turn
_P, _S, AGE, _SLIPPED, _GRIPPING = 3, 12, 15, 16, 17
# columns of a branch: x (3,), P (3, 3) without the scale error, s = dx/db (3,), updates or -1, 1 where wheels have
# slipped since it began, and P (3, 3) as if they had not
_WIDTH = 26
LAST, FIRST, NOW, TIMES = range(4)
"""rows of repeats (4, l): last reading [m], range [m] expected at the first and at the last of those that repeated it
to the last bit, and their number"""


def no_branches(count: int) -> Array:
    """Room (B, 26) for ``count`` branches: former estimates that the odometry alone moves."""
    branches = np.zeros((count, _WIDTH))
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
    rays: Array,
    constants: Array,
    lengths: Integers,
    energy: Array,
    sums: Array,
    branches: Array,
    repeats: Array,
    responses: Array,
    since: Array,
    level: Array,
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
    responds: bool,
) -> tuple[float, int, int, int, float, float, float, float]:
    """Take an update of an estimator from x (3,), P (3, 3) to those ``after`` it, dt [s] later.

    It reads ranges rho (l,) and odometry (2,), both NaN for none; the ``command`` (2,) takes the place of odometry.
    ``used`` (l + 1,) says which rays the estimator was given, and whether it was made for the odometry as declared;
    ``k`` is the number of updates in the sums, and ``kappa`` the variance over the declared one; ``sigma`` is the
    deviation of ranges over the declared one, and ``slip`` [m^2/s] the process noise of wheels, where an estimator
    finds them itself. ``responds`` is True in the updates in which a branch may begin.

    Writes the protection ``level`` (6,): the errors [m], [rad] that a fault may have caused, three standard deviations,
    and both together. Returns the worst statistic over its threshold, its test and its channel, the largest number of
    repeated readings, and the ratios of dead reckoning: of the odometry where it is left out, else 0, over all windows
    and over those but the longest, the strict one, and that of a doubt.
    """
    count = len(rays)
    reckons = is_within(odometry, constants[FASTEST : TURNING + 1])
    spared = not used[count]
    u = odometry if reckons else command
    slip = max(slip - GRIP, 0.0) * dt
    scale, one = constants[SCALE], np.zeros((1, _WIDTH))
    for i in range(3):
        one[0, i] = x[i]
        for j in range(3):
            one[0, _P + 3 * i + j] = P[i, j]
    _move(one[0], u, constants[LEFT_1:] if spared else constants[W_1:], _MOST_SLIP * slip, dt)
    x_now, P_now = one[0, :_P], np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            P_now[i, j] = one[0, _P + 3 * i + j] + scale * scale * one[0, _S + i] * one[0, _S + j]
    noise = sigma * constants[RELATIVE], sigma * constants[ABSOLUTE], constants[LONGEST]
    e, white, expected, H = innovations((coefficients, polyline), rays, noise, x_now, P_now, rho, used)
    add(sums, k, e, white)
    most = _note_repeats(repeats, rho, expected)
    note_motion(since, one[0, 0] - x[0], one[0, 1] - x[1], one[0, 2], dt, e)
    if not is_possible(x_after, P_after):
        return math.inf, IMPOSSIBLE, -1, most, 0.0, 0.0, 0.0, 0.0
    ratio, test, channel = worst_of(sums, k + 1, used[:count], lengths, kappa, constants[Z], energy)
    own = recent = strict = doubted = 0.0
    if reckons:
        dead, short, strict, doubted = reckoned(
            branches, lengths[len(lengths) > 1 :], x_after, P_after, u, constants, slip, dt, spared
        )
        least = kappa * energy[3]
        dead, short, strict, doubted = dead / least, short / least, strict / least, doubted / least
        if spared:
            own, recent = dead, short
        elif dead > ratio:
            ratio, test, channel = dead, RECKONED, -1
    else:
        branches[:, AGE] = -1.0
    if responds:
        R, opened = np.empty(count), np.empty((len(branches), 3, 3))
        for i in range(count):
            R[i] = (noise[0] * expected[i]) ** 2 + noise[1] ** 2
        for n in range(len(branches)):
            for i in range(3):
                for j in range(3):
                    along = scale * scale * branches[n, _S + i] * branches[n, _S + j]
                    opened[n, i, j] = branches[n, _P + 3 * i + j] + along
        position, heading = respond(
            responses, branches[:, AGE], opened, since, H, R, P_now, used, lengths, constants[ALERTED], kappa,
            constants[Z], energy[3],
        )  # fmt: skip
        if branches[:, AGE].max() < constants[ALERTED]:  # it has begun again
            position, heading = max(position, level[0]), max(heading, level[1])
        level[0], level[1] = position, heading
    level[2], level[3] = deviations(P_after)
    level[4], level[5] = level[0] + level[2], level[1] + level[3]
    return ratio, test, channel, most, own, recent, strict, doubted


@njit(cache=True, nogil=True)
def begin_branch(branches: Array, responses: Array, x: Array, P: Array) -> None:
    """Begin a branch at an estimate x (3,), P (3, 3), in a place that is free, and its responses."""
    for n in range(len(branches)):
        if branches[n, AGE] < 0.0:
            for i in range(3):
                branches[n, i], branches[n, _S + i] = x[i], 0.0
                for j in range(3):
                    branches[n, _P + 3 * i + j] = P[i, j]
            branches[n, AGE] = branches[n, _SLIPPED] = 0.0
            responses[n] = 0.0
            return


@njit(cache=True, nogil=True)
def _move(branch: Array, u: Array, W: Array, slip: float, dt: float) -> None:
    """Move a branch (26,) in place over dt [s] under the odometry u (2,): x, P = F P F' + G W G', s = F s - G u.

    W begins with the variances of u. ``slip`` [m^2] is the variance of a position by wheels that slip meanwhile.
    """
    d_x, d_y, a_x, a_y, b_x, b_y = motion(branch[2], u[0], u[1], dt)
    branch[0] += d_x
    branch[1] += d_y
    branch[2] += u[1] * dt
    s = branch[_S:]
    s[0] += -d_y * s[2] - a_x * u[0] - b_x * u[1]
    s[1] += d_x * s[2] - a_y * u[0] - b_y * u[1]
    s[2] -= dt * u[1]
    by = a_x, a_y, b_x, b_y
    if slip > 0.0 and branch[_SLIPPED] == 0.0:
        branch[_SLIPPED] = 1.0
        branch[_GRIPPING:] = branch[_P:_S]
    if branch[_SLIPPED] > 0.0:
        _spread(branch[_GRIPPING:], d_x, d_y, by, W, 0.0, dt)
    _spread(branch[_P:], d_x, d_y, by, W, slip, dt)


@inner_njit(nogil=True)
def _spread(
    P: Array, d_x: float, d_y: float, by: tuple[float, float, float, float], W: Array, slip: float, dt: float
) -> None:
    """P <- F P F' + G W G' and the slip, of P (9,), in place, for a motion and its derivatives ``by`` odometry."""
    (a_x, a_y, b_x, b_y), W_x, W_y = by, W[0], W[1]
    for j in range(3):  # F is the identity but for two entries
        P[j] -= d_y * P[6 + j]
        P[3 + j] += d_x * P[6 + j]
    for j in range(3):
        P[3 * j] -= d_y * P[3 * j + 2]
        P[3 * j + 1] += d_x * P[3 * j + 2]
    across = a_x * W_x * a_y + b_x * W_y * b_y
    P[0] += a_x * W_x * a_x + b_x * W_y * b_x + slip
    P[1] += across
    P[3] += across
    P[4] += a_y * W_x * a_y + b_y * W_y * b_y + slip
    P[2] += b_x * W_y * dt
    P[6] += b_x * W_y * dt
    P[5] += b_y * W_y * dt
    P[7] += b_y * W_y * dt
    P[8] += dt * W_y * dt + slip * BY_HEADING**2


@njit(cache=True, nogil=True)
def innovations(
    wall: WallShape, rays: Array, noise: tuple[float, float, float], x: Array, P: Array, z: Array, used: Flags
) -> tuple[Array, Array, Array, Array]:
    """e (l,), w (l,), the expected ranges (l,) and H (l, 3) of readings z (l,) from the prediction x (3,), P (3, 3).

    e is NaN where nothing was read or a ray has no information, w also where a ray is not ``used``. ``noise`` is
    the relative and the absolute deviation of a range, and the length [m] from which on one is lost.
    """
    n = len(z)
    e, white, expected = np.full(n, np.nan), np.full(n, np.nan), np.full(n, np.nan)
    H, PH, D, nu, r = np.empty((n, 3)), np.empty((n, 3)), np.empty(3), np.empty(n), np.empty(n)
    L, rows, count = np.zeros((n, n)), np.empty(n, np.int64), 0
    for i in range(n):
        h, B, C, E = expected_range(wall, x, rays[i], H[i], D)
        expected[i] = h
        if math.isnan(h) or not 0.0 < z[i] < noise[2]:
            continue
        nu[i], r[i] = z[i] - h, (noise[0] * h) ** 2 + noise[1] ** 2 + 0.5 * square_trace(P, D, E, B, C, H[i])
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
                    return e, np.full(n, np.nan), expected, H
                L[a, a] = math.sqrt(s)
            else:
                L[a, b] = s / L[b, b]
                total -= L[a, b] * white[j]
        white[i] = total / L[a, a]
    return e, white, expected, H


@njit(cache=True, nogil=True)
def reckoned(
    branches: Array,
    lengths: Integers,
    x: Array,
    P: Array,
    u: Array,
    constants: Array,
    slip: float,
    dt: float,
    spared: bool,
) -> tuple[float, float, float, float]:
    """Move the branches over dt [s], and return the largest d' P^-1 d of those whose age is one of ``lengths``: over
    all, over those but the longest, as if no wheel had slipped, and so with the covariance of the estimate added.
    ``spared``: the estimate x (3,), P (3, 3) was made without the odometry.
    """
    worst, short, strict, doubted, scale = 0.0, 0.0, 0.0, 0.0, constants[SCALE] * constants[SCALE]
    S, d = np.empty((3, 3)), np.empty(3)
    for n in range(len(branches)):
        branch = branches[n]
        if branch[AGE] < 0.0:
            continue
        _move(branch, u, constants[W_1:], slip, dt)
        branch[AGE] += 1.0
        for length in lengths:
            if branch[AGE] != length:
                continue
            for i in range(3):
                d[i] = x[i] - branch[i]
            d[2] = wrapped(d[2])
            for column in (_P, _GRIPPING):
                if column == _GRIPPING and branch[_SLIPPED] == 0.0:
                    continue
                for i in range(3):
                    for j in range(3):
                        S[i, j] = branch[column + 3 * i + j] + scale * branch[_S + i] * branch[_S + j]
                        if spared:
                            S[i, j] += P[i, j]
                if column == _P:
                    value = square(S, d)
                    worst = max(worst, value)
                    if length < lengths[-1]:
                        short = max(short, value)
                else:
                    value = square(S, d)
                    strict = max(strict, value)
                    if value > doubted:
                        for i in range(3):
                            for j in range(3):
                                S[i, j] += P[i, j] * (not spared)
                        doubted = max(doubted, square(S, d))
        if branch[AGE] >= lengths[-1]:
            branch[AGE] = -1.0
    return worst, short, strict, doubted


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
