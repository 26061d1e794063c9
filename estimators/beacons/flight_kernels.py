"""Kalman filters of a flight side by side, each without what one sensor says; compiled.

Each has the model and the second-order update of ``flight``. A state has ten numbers: p, v and g (3,) each, and the
noise n_0 of the arrival from beacon 0, which the range differences of an instant share.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.aerial.beacon_readings import AZIMUTH, DIFFERENCE, ELEVATION, NEAREST, RANGE

FIX = 4
"""kind of a number of a position fix, the coordinate of the axis that stands in the place of its beacon"""
SHARED = 9
"""number of n_0 in a state"""


@njit(cache=True, nogil=True)
def predict_flights(x: Array, P: Array, F: Array, B: Array, Q: Array) -> None:
    """Predict states x (N, 10), P (N, 10, 10) in place: F (3, 3), Q (3, 3) of an axis, B (9,) by the input."""
    moved, row = np.empty(9), np.empty((9, 9))
    for n in range(len(x)):
        for s in range(3):
            for a in range(3):
                total = B[3 * s + a]
                for r in range(s, 3):
                    total += F[s, r] * x[n, 3 * r + a]
                moved[3 * s + a] = total
        x[n, :9] = moved
        for i in range(9):
            s, a = i // 3, i % 3
            for j in range(9):
                total = 0.0
                for r in range(s, 3):
                    total += F[s, r] * P[n, 3 * r + a, j]
                row[i, j] = total
        for i in range(9):
            for j in range(i, 9):
                s, a = j // 3, j % 3
                total = Q[i // 3, s] if i % 3 == a else 0.0
                for r in range(s, 3):
                    total += F[s, r] * row[i, 3 * r + a]
                P[n, i, j] = P[n, j, i] = total


@njit(cache=True, nogil=True)
def _reading(kind: int, place: Array, p: Array, g: Array, D: Array) -> float:
    """Number of a kind but a difference or a fix that is read of a ``place`` (3,) from p; see ``reading_of``.

    Its derivative is added to g (3,), its second derivative to D (3, 3).
    """
    x, y, z = p[0] - place[0], p[1] - place[1], p[2] - place[2]
    rr = max(x * x + y * y, NEAREST**2)
    square = max(x * x + y * y + z * z, NEAREST**2)
    if kind == AZIMUTH:
        xy, other = 2.0 * x * y / rr**2, (y * y - x * x) / rr**2
        g[0] -= y / rr
        g[1] += x / rr
        D[0, 0] += xy
        D[1, 1] -= xy
        D[0, 1] += other
        D[1, 0] += other
        return math.atan2(-y, -x)
    if kind == ELEVATION:
        r = math.sqrt(rr)
        bent, tilted, turned = 2.0 * r * z / square**2, (rr - z * z) / square**2, z / (square * r)
        c, s = x / r, y / r
        g[0] += z * c / square
        g[1] += z * s / square
        g[2] -= r / square
        D[0, 0] += turned * s * s - bent * c * c
        D[1, 1] += turned * c * c - bent * s * s
        D[0, 1] -= (turned + bent) * c * s
        D[1, 0] -= (turned + bent) * c * s
        D[2, 2] += bent
        D[0, 2] += tilted * c
        D[2, 0] += tilted * c
        D[1, 2] += tilted * s
        D[2, 1] += tilted * s
        return math.atan2(-z, r)
    rho = math.sqrt(square)
    d = (x / rho, y / rho, z / rho)
    for i in range(3):
        g[i] += d[i]
        D[i, i] += 1.0 / rho
        for j in range(3):
            D[i, j] -= d[i] * d[j] / rho
    return rho


@njit(cache=True, nogil=True)
def condition_flights(
    x: Array, P: Array, y: Array, kinds: Integers, beacons: Integers, places: Array, variance: Array, common: float,
    gate: float, without: Integers, refused: Array,
) -> None:  # fmt: skip
    """Condition states x (N, 10), P (N, 10, 10) in place on the numbers of an instant, one after the other.

    Args:
        x, P: states and covariances.
        y: (m,) the numbers; NaN for none.
        kinds: (m,) their kinds, of which the range differences are the last ones.
        beacons: (m,) their beacons; of a fix the axis.
        places: (n, 3) [m] of the beacons.
        variance: (m,) of their noise, of a difference but for n_0.
        common: [m^2] variance of n_0.
        gate: nu^2 / S above which a number is not used.
        without: (N,) the beacon that is not used, or -1 for the fixes, -2 for none.
        refused: (N,) share of the numbers that each state was not conditioned on by the gate; NaN for no number.
    """
    g, D, A, PH = np.empty(3), np.empty((3, 3)), np.empty((3, 3)), np.empty(10)
    for n in range(len(x)):
        state, C = x[n], P[n]
        shares, count, gone = False, 0, 0
        for k in range(len(y)):
            kind = kinds[k]
            own = -1 if kind == FIX else beacons[k]
            if not math.isfinite(y[k]) or own == without[n]:
                continue
            if kind == DIFFERENCE and not shares:
                shares = True
                state[SHARED] = 0.0
                C[SHARED, :] = 0.0
                C[:, SHARED] = 0.0
                C[SHARED, SHARED] = 1e10 if without[n] == 0 else common
            g[:] = 0.0
            D[:] = 0.0
            if kind == FIX:
                expected = state[beacons[k]]
                g[beacons[k]] = 1.0
            elif kind == DIFFERENCE:
                expected = -_reading(RANGE, places[0], state[:3], g, D)
                for i in range(3):
                    g[i] = -g[i]
                    for j in range(3):
                        D[i, j] = -D[i, j]
                expected += _reading(RANGE, places[beacons[k]], state[:3], g, D) - state[SHARED]
            else:
                expected = _reading(kind, places[beacons[k]], state[:3], g, D)
            S = variance[k]
            if kind != FIX:
                for i in range(3):
                    for j in range(3):
                        A[i, j] = D[i, 0] * C[0, j] + D[i, 1] * C[1, j] + D[i, 2] * C[2, j]
                expected += 0.5 * (A[0, 0] + A[1, 1] + A[2, 2])
                square = 0.0
                for i in range(3):
                    for j in range(3):
                        square += A[i, j] * A[j, i]
                S += 0.5 * max(square, 0.0)
            nu = y[k] - expected
            if kind == AZIMUTH:
                nu = (nu + math.pi) % (2.0 * math.pi) - math.pi
            size = 10 if kind == DIFFERENCE else 9
            for i in range(size):
                PH[i] = C[i, 0] * g[0] + C[i, 1] * g[1] + C[i, 2] * g[2]
                if kind == DIFFERENCE:
                    PH[i] -= C[i, SHARED]
            S += g[0] * PH[0] + g[1] * PH[1] + g[2] * PH[2]
            if kind == DIFFERENCE:
                S -= PH[SHARED]
            count += 1
            if not nu * nu <= gate * S:
                gone += 1
                continue
            for i in range(size):
                state[i] += PH[i] * nu / S
                for j in range(size):
                    C[i, j] -= PH[i] * PH[j] / S
        refused[n] = gone / count if count else math.nan


@njit(cache=True, nogil=True)
def flight_separations(
    x: Array, P: Array, others: Array, covariances: Array, deviations: float, levels: Array
) -> None:  # fmt: skip
    """Compare a state x (6,) of covariance P (6, 6) with ``others`` (N, 10) of ``covariances`` (N, 10, 10).

    ``levels`` (N + 1, 3) get, of each and of the state itself in the last row, |x_i - x| and ``deviations`` standard
    deviations in the worst direction, of position [m] and velocity [m/s], and the largest standard deviation of the
    position [m].
    """
    last = len(others)
    for n in range(last + 1):
        for part in range(2):
            apart, block = 0.0, np.empty((3, 3))
            for i in range(3):
                for j in range(3):
                    a, b = 3 * part + i, 3 * part + j
                    block[i, j] = P[a, b] if n == last else covariances[n, a, b]
                if n < last:
                    apart += (others[n, 3 * part + i] - x[3 * part + i]) ** 2
            largest = math.sqrt(max(np.linalg.eigvalsh(block)[2], 0.0))
            levels[n, part] = math.sqrt(apart) + deviations * largest
            if part == 0:
                levels[n, 2] = largest
