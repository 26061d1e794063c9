"""Protection levels of a pose: the error that a fault may cause before a test can find it; compiled.

A filter follows a reading that is off by a bias b, and by how much is linear. With the motion F and the gain K of a
filter of the published covariance, the estimate's response a (3,) to a bias of one that began with a branch is

    a <- F a + g,   c_j = delta_ij - H_j a,   a <- a + sum_j K_j c_j,   K = P H' R^-1,

where g is zero and i the ray at fault, or delta_ij is zero and g moves the pose by odometry that is one too large: the
channels are the rays and the two odometries. c_j is what the innovation of ray j is off by, a share 1 - a of the bias
where a filter absorbs the share a. A bias b is found with the probability 1 - p where

    b |sum_j c_j / sqrt(s_j)| / sqrt(kappa n) >= z + z_p       (mean of a ray, over the window n in which it began),
    b sqrt(d' P_open^-1 d / kappa) >= sqrt(chi2_3) + z_p       (dead reckoning: d = a less the response of odometry),

for the non-central statistic exceeds its threshold with that probability: so b = (z + z_p) sqrt(kappa s / n) / (1 - a).
The least b, over the tests until now, is the largest bias that may have stayed unfound, and |a| b the error that it
causes. Branches begin all the time; the protection level is the largest |a| b over all channels and all branches that
are older than a second, the time to alert, which is that of a bias that began at the worst moment, and three standard
deviations. It holds for a bias of one channel that began within the longest window, but for its first second; one that
grows more slowly than that may reach further.

Several readings of a ray between two calls count as one of as much information: the response changes slowly.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.integrity.windows import Flags
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Integers

FOUND = 2.326
"""z_p of p = 0.01"""
DEVIATIONS = 3.0
"""standard deviations of a level"""
ALERT = 1.0
"""[s] that a fault may last before its error has to be within the level"""
_FREE, _BEST, _SUMS = 3, 6, 7  # columns of a response: a (3,), that of dead reckoning (3,), 1 / b, sums (l,)
D_X, D_Y, ALONG_X, ALONG_Y, TIME, COUNT, _READS = range(7)
"""columns of what has happened since the last call: motion (2,) [m], heading (2,) times time [s], time [s], number of
updates, and readings of each ray (l,)"""


def no_responses(branches: int, rays: int) -> Array:
    """Room (B, l + 2, 7 + l) for the responses of as many branches to a bias of each channel."""
    return np.zeros((branches, rays + 2, _SUMS + rays))


def nothing_since(rays: int) -> Array:
    """Changes since the last call (6 + l,): none."""
    return np.zeros(_READS + rays)


@njit(cache=True, nogil=True)
def note_motion(since: Array, d_x: float, d_y: float, heading: float, dt: float, e: Array) -> None:
    """Note an update over dt [s] in which the pose moved by (d_x, d_y) [m]; e (l,) is NaN of rays that read nothing."""
    since[D_X] += d_x
    since[D_Y] += d_y
    since[ALONG_X] += dt * math.cos(heading)
    since[ALONG_Y] += dt * math.sin(heading)
    since[TIME] += dt
    since[COUNT] += 1.0
    for i in range(len(e)):
        if math.isfinite(e[i]):
            since[_READS + i] += 1.0


@njit(cache=True, nogil=True)
def respond(
    responses: Array,
    ages: Array,
    opened: Array,
    since: Array,
    H: Array,
    R: Array,
    P: Array,
    used: Flags,
    lengths: Integers,
    alert: float,
    kappa: float,
    z: float,
    reckoned: float,
) -> tuple[float, float]:
    """Take what has happened ``since`` the last call, and return the errors [m], [rad] that a fault may have caused.

    They are infinite where nothing would ever find one.

    Args:
        responses: (B, l + 2, 7 + l) of the branches, changed in place.
        ages: (B,) updates since they began; negative for none.
        opened: (B, 3, 3) their covariances P_open.
        since: (6 + l,) what has happened; zero afterwards.
        H: (l, 3) derivatives of the ranges at the estimate.
        R: (l,) [m^2] variances of a range.
        P: (3, 3) covariance of a prediction.
        used: (l + 1,) the rays that are used, and whether the odometry is.
        lengths: (w,) updates of the windows, in ascending order; dead reckoning is tested in all but the first.
        alert: updates that a fault may last before it counts, or as many as the oldest branch has.
        kappa: variance of the innovations over the declared one.
        z: threshold of a mean.
        reckoned: threshold of a dead reckoning's square.
    """
    l = len(H)  # noqa: E741
    deviation, P_now, K, M = np.zeros(l), P.copy(), np.zeros((l, 3)), np.eye(3)
    p, q, d = np.empty(3), np.empty(3), np.empty(3)
    for i in range(l):
        reads = since[_READS + i]
        if not used[i] or reads == 0.0 or not math.isfinite(R[i]):
            continue
        for a in range(3):
            p[a] = P[a, 0] * H[i, 0] + P[a, 1] * H[i, 1] + P[a, 2] * H[i, 2]
            q[a] = P_now[a, 0] * H[i, 0] + P_now[a, 1] * H[i, 1] + P_now[a, 2] * H[i, 2]
        deviation[i] = math.sqrt(H[i, 0] * p[0] + H[i, 1] * p[1] + H[i, 2] * p[2] + R[i])
        s = H[i, 0] * q[0] + H[i, 1] * q[1] + H[i, 2] * q[2] + R[i] / reads
        for a in range(3):
            for b in range(3):
                P_now[a, b] -= q[a] * q[b] / s
    for i in range(l):
        if deviation[i] > 0.0:
            for a in range(3):
                along = P_now[a, 0] * H[i, 0] + P_now[a, 1] * H[i, 1] + P_now[a, 2] * H[i, 2]
                K[i, a] = along * since[_READS + i] / R[i]
                for b in range(3):
                    M[a, b] -= K[i, a] * H[i, b]
    count, d_x, d_y = since[COUNT], since[D_X], since[D_Y]
    mean_needed, square_needed = z + FOUND, math.sqrt(reckoned) + FOUND
    position = heading = 0.0
    alert = min(alert, ages.max())
    for n in range(len(responses)):
        if ages[n] < 0.0:
            continue
        window, tested = float(lengths[-1]), False
        for k in range(len(lengths)):
            if k > 0 and ages[n] - count < lengths[k] <= ages[n]:
                tested = True
        for k in range(len(lengths) - 1, -1, -1):
            if lengths[k] >= ages[n]:
                window = float(lengths[k])
        limit = math.sqrt(kappa * window) * mean_needed
        for c in range(l + 2):
            if (deviation[c] == 0.0) if c < l else (not used[l]):
                continue
            row = responses[n, c]
            p[0], p[1], p[2] = row[0] - d_y * row[2], row[1] + d_x * row[2], row[2]
            if c >= l:
                q[0], q[1], q[2] = (
                    row[_FREE] - d_y * row[_FREE + 2], row[_FREE + 1] + d_x * row[_FREE + 2], row[_FREE + 2],
                )  # fmt: skip
                if c == l:
                    for a in range(2):
                        p[a] += since[ALONG_X + a]
                        q[a] += since[ALONG_X + a]
                else:
                    p[2] += since[TIME]
                    q[2] += since[TIME]
                for a in range(3):
                    row[_FREE + a] = q[a]
            best = row[_BEST]
            for j in range(l):
                if deviation[j] > 0.0:
                    off = -(H[j, 0] * p[0] + H[j, 1] * p[1] + H[j, 2] * p[2])
                    if j == c:
                        off += 1.0
                    row[_SUMS + j] += since[_READS + j] * off / deviation[j]
                    best = max(best, abs(row[_SUMS + j]) / limit)
            for a in range(3):
                row[a] = M[a, 0] * p[0] + M[a, 1] * p[1] + M[a, 2] * p[2] + (K[c, a] if c < l else 0.0)
            if tested:
                for a in range(3):
                    d[a] = row[a] - row[_FREE + a]
                best = max(best, math.sqrt(square(opened[n], d) / kappa) / square_needed)
            row[_BEST] = best
            if ages[n] < alert:
                continue
            far, turned = math.hypot(row[0], row[1]), abs(row[2])
            if far > 0.0:
                position = max(position, far / best if best > 0.0 else math.inf)
            if turned > 0.0:
                heading = max(heading, turned / best if best > 0.0 else math.inf)
    since[:] = 0.0
    return position, heading


@njit(cache=True, nogil=True)
def square(S: Array, d: Array) -> float:
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
def deviations(P: Array) -> tuple[float, float]:
    """Three standard deviations [m], [rad] of a pose of covariance P (3, 3): of the position in its worst direction."""
    half, across = 0.5 * (P[0, 0] + P[1, 1]), 0.5 * (P[0, 0] - P[1, 1])
    largest = half + math.hypot(across, P[0, 1])
    return DEVIATIONS * math.sqrt(max(largest, 0.0)), DEVIATIONS * math.sqrt(max(P[2, 2], 0.0))
