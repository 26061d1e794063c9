"""Extended Kalman filters of a unicycle that reads beacons, several side by side, compiled.

The state is the pose with three constant errors, (x_1, x_2, phi, b_1, b_2, c): those of the odometry's scale,
u_i = (1 - b_i) u_i_measured, and that of all ranges, (1 + c) rho; the places of beacons that are not known come after
them, two numbers each, d in all. The odometry also has white noise, so that what it adds over h [s] has the covariance
h diag(w_1, w_2) in (distance, turn). With F, G the derivatives of the exact motion,

    P <- A P A' + G diag(w) G' / h.

Readings are scalars and their noises are independent, so one after the other is used. Of a reading y with the
expectation h(x), its gradient H and its second derivative D,

    nu = y - h - tr(D P) / 2,   s = H P H' + r + tr(D P D P) / 2,   x <- x + beta P H' nu / s,

r being its variance; the terms with D are the mean and the variance of the linearisation error. A share epsilon of the
readings are outliers, uniform over a length L: a reading is no outlier with the probability beta,

    p = (1 - epsilon) N(nu; 0, s),   beta = p / (p + epsilon / L),   likelihood = p + epsilon / L,
    P <- P - (beta - beta (1 - beta) nu^2 / s) P H' H P / s.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.unicycle.kernels import motion, wrapped

STATES = 6
"""number of the states that are not places of beacons"""
RANGE, BEARING, DIFFERENCE = 0, 1, 2
"""kinds of readings"""
_NEAREST = 1e-3  # [m] distance of a beacon within which its direction is not known
_MOST_UNLIKELY = 700.0  # logarithm of a density at which it is nought


@njit(cache=True, nogil=True)
def predict(x: Array, P: Array, u_1: float, u_2: float, h: float, w_1: float, w_2: float) -> None:
    """Move states x (N, d) with covariances P (N, d, d) for h [s] by odometry u [m/s, rad/s], in place.

    ``w_1`` [m^2/s] and ``w_2`` [rad^2/s] are the densities of its noise.
    """
    A = np.eye(x.shape[1])
    Q = np.zeros((x.shape[1], x.shape[1]))
    for n in range(len(x)):
        v_1, v_2 = (1.0 - x[n, 3]) * u_1, (1.0 - x[n, 4]) * u_2
        dx, dy, gx_1, gy_1, gx_2, gy_2 = motion(x[n, 2], v_1, v_2, h)
        x[n, 0] += dx
        x[n, 1] += dy
        x[n, 2] = wrapped(x[n, 2] + v_2 * h)
        A[0, 2], A[1, 2] = -dy, dx
        A[0, 3], A[1, 3] = -gx_1 * u_1, -gy_1 * u_1
        A[0, 4], A[1, 4], A[2, 4] = -gx_2 * u_2, -gy_2 * u_2, -h * u_2
        q_1, q_2 = w_1 / h, w_2 / h
        Q[0, 0] = q_1 * gx_1 * gx_1 + q_2 * gx_2 * gx_2
        Q[0, 1] = q_1 * gx_1 * gy_1 + q_2 * gx_2 * gy_2
        Q[1, 1] = q_1 * gy_1 * gy_1 + q_2 * gy_2 * gy_2
        Q[0, 2], Q[1, 2], Q[2, 2] = q_2 * gx_2 * h, q_2 * gy_2 * h, q_2 * h * h
        Q[1, 0], Q[2, 0], Q[2, 1] = Q[0, 1], Q[0, 2], Q[1, 2]
        P[n] = A @ P[n] @ A.T + Q


@njit(cache=True, nogil=True)
def transition(x: Array, u_1: float, u_2: float, h: float, w_1: float, w_2: float) -> tuple[Array, Array, Array]:
    """State (d,) after h [s] from x (d,), its Jacobian A (d, d) and the covariance Q (d, d); as ``predict``."""
    after, Q = x.copy().reshape(1, len(x)), np.zeros((1, len(x), len(x)))
    predict(after, Q, u_1, u_2, h, w_1, w_2)
    v_1, v_2 = (1.0 - x[3]) * u_1, (1.0 - x[4]) * u_2
    dx, dy, gx_1, gy_1, gx_2, gy_2 = motion(x[2], v_1, v_2, h)
    A = np.eye(len(x))
    A[0, 2], A[1, 2] = -dy, dx
    A[0, 3], A[1, 3] = -gx_1 * u_1, -gy_1 * u_1
    A[0, 4], A[1, 4], A[2, 4] = -gx_2 * u_2, -gy_2 * u_2, -h * u_2
    return after[0], A, Q[0]


@njit(cache=True, nogil=True)
def offset(x: Array, i: int, places: Array, columns: Integers) -> tuple[float, float, float]:
    """Vector [m] from the robot to beacon i, and its length."""
    k = columns[i]
    b_1, b_2 = (places[i, 0], places[i, 1]) if k < 0 else (x[k], x[k + 1])
    return b_1 - x[0], b_2 - x[1], math.hypot(b_1 - x[0], b_2 - x[1])


@njit(cache=True, nogil=True)
def _add(H: Array, D: Array, k: int, g_1: float, g_2: float, d_11: float, d_12: float, d_22: float) -> None:
    """Add a gradient g and a second derivative by the offset of a beacon, which is its place, in the state from ``k``
    on unless that is negative, less that of the robot.
    """
    H[0] -= g_1
    H[1] -= g_2
    for a in (0, k):
        if a < 0:
            continue
        for b in (0, k):
            if b >= 0:
                sign = 1.0 if a == b else -1.0
                D[a, b] += sign * d_11
                D[a, b + 1] += sign * d_12
                D[a + 1, b] += sign * d_12
                D[a + 1, b + 1] += sign * d_22
    if k >= 0:
        H[k] += g_1
        H[k + 1] += g_2


@njit(cache=True, nogil=True)
def expected(x: Array, kind: int, i: int, places: Array, columns: Integers) -> tuple[float, Array, Array, float]:
    """Reading of beacon i at a state x (d,), its gradient H (d,), its second derivative D (d, d) by the positions, and
    the distance [m] on which its noise depends.

    ``places`` (n, 2) are those of the beacons, and ``columns`` (n,) where in the state that is which is not known, -1
    where it is. The gradient is zero if the robot is at the beacon.
    """
    H, D = np.zeros(len(x)), np.zeros((len(x), len(x)))
    dx, dy, rho = offset(x, i, places, columns)
    if rho < _NEAREST:
        return rho, H, D, rho
    e_1, e_2 = dx / rho, dy / rho
    if kind == BEARING:
        per = 1.0 / (rho * rho)
        _add(
            H, D, columns[i], -e_2 / rho, e_1 / rho,
            2.0 * e_1 * e_2 * per, (e_2 * e_2 - e_1 * e_1) * per, -2.0 * e_1 * e_2 * per,
        )  # fmt: skip
        H[2] = -1.0
        return wrapped(math.atan2(dy, dx) - x[2]), H, D, rho
    scale = 1.0 + x[5]
    per = scale / rho
    _add(H, D, columns[i], scale * e_1, scale * e_2, per * e_2 * e_2, -per * e_1 * e_2, per * e_1 * e_1)
    if kind == DIFFERENCE:
        fx, fy, first = offset(x, 0, places, columns)
        if first < _NEAREST:
            return scale * (rho - first), np.zeros(len(x)), np.zeros((len(x), len(x))), rho
        f_1, f_2, per = fx / first, fy / first, scale / first
        _add(H, D, columns[0], -scale * f_1, -scale * f_2, -per * f_2 * f_2, per * f_1 * f_2, -per * f_1 * f_1)
        rho -= first
    H[5] = rho
    return scale * rho, H, D, abs(rho)


@njit(cache=True, nogil=True)
def condition(
    x: Array, P: Array, log_weights: Array, y: float, kind: int, i: int, places: Array, columns: Integers,
    errors: Array, found: Array,
) -> None:  # fmt: skip
    """Condition states x (N, d) with covariances P (N, d, d) on a reading y of beacon i, in place; as ``expected``.

    ``log_weights`` (N,) grow by the logarithms of the likelihoods. ``errors`` (5,) are the absolute and the relative
    deviation of the reading, epsilon, L, and the nu^2 / s from which a reading is rejected even with epsilon = 0.
    ``found`` (N, 3) gets nu, s and beta; beta is zero for a rejected reading.
    """
    absolute, relative, epsilon, L, gate = errors[0], errors[1], errors[2], errors[3], errors[4]
    for n in range(len(x)):
        h, H, D, rho = expected(x[n], kind, i, places, columns)
        noise = absolute * absolute + (relative * rho) ** 2
        PH = P[n] @ H
        DP = D @ P[n]
        nu = y - h
        if kind == BEARING:
            nu = wrapped(nu)
        nu -= 0.5 * np.trace(DP)
        s = H @ PH + noise + 0.5 * (DP * DP.T).sum()
        square = nu * nu / s
        log_density = -0.5 * (square + math.log(2.0 * math.pi * s)) + math.log1p(-epsilon)
        density = math.exp(max(log_density, -_MOST_UNLIKELY))
        beta = density / (density + epsilon / L)
        if square > gate:
            beta = 0.0
            log_weights[n] += max(log_density, math.log(max(epsilon, 1e-6) / L))
        else:
            log_weights[n] += math.log(density + epsilon / L)
            x[n] += beta * nu / s * PH
            x[n, 2] = wrapped(x[n, 2])
            kept = beta - beta * (1.0 - beta) * square
            for j in range(len(H)):
                for k in range(len(H)):
                    P[n, j, k] -= kept * PH[j] * PH[k] / s
        found[n, 0], found[n, 1], found[n, 2] = nu, s, beta


@njit(cache=True, nogil=True)
def _places_meet(d: Array, x: Array, P: Array, near: float, length: float, angle: float) -> bool:
    """True if all places in a difference d (d,) from a state x (d,) are near by its covariance P; see ``merged``."""
    for k in range(STATES, len(d), 2):
        a, b, c = P[k, k], P[k, k + 1], P[k + 1, k + 1]
        square = c * d[k] * d[k] - 2.0 * b * d[k] * d[k + 1] + a * d[k + 1] * d[k + 1]
        rho = math.hypot(x[k] - x[0], x[k + 1] - x[1])
        noise = min(length, rho * angle)
        if square >= near * (a * c - b * b) or d[k] * d[k] + d[k + 1] * d[k + 1] >= 2.0 * rho * noise:
            return False
    return True


@njit(cache=True, nogil=True)
def merged(
    x: Array, P: Array, weights: Array, near: float, length: float, angle: float
) -> tuple[Array, Array, Array, Integers]:
    """States, covariances and weights after each that is near a heavier one was merged with that.

    Near are those within a squared Mahalanobis distance of ``near``, by the covariance of the heavier one, of the pose
    and of each of the places in the state; places also must be so near that the circle about the robot departs from its
    chord between them by less than ``noise`` [m] / 4. The last array holds where those that were kept are among the
    given ones.
    """
    order, count, size = np.argsort(-weights), len(weights), x.shape[1]
    taken, kept = np.zeros(count, dtype=np.bool_), 0
    x_out, P_out, w_out = np.empty_like(x), np.empty_like(P), np.empty(count)
    places = np.empty(count, dtype=np.int64)
    d = np.empty(size)
    for a in range(count):
        i = order[a]
        if taken[i]:
            continue
        taken[i] = True
        inverse = np.linalg.inv(np.ascontiguousarray(P[i, :3, :3]))
        total, mean, square = weights[i], np.zeros(size), np.zeros((size, size))
        square += weights[i] * P[i]
        for b in range(a + 1, count):
            j = order[b]
            if taken[j]:
                continue
            for k in range(size):
                d[k] = x[j, k] - x[i, k]
            d[2] = wrapped(d[2])
            if d[:3] @ (inverse @ d[:3]) < near and _places_meet(d, x[i], P[i], near, length, angle):
                taken[j] = True
                total += weights[j]
                for k in range(size):
                    mean[k] += weights[j] * d[k]
                    for m in range(size):
                        square[k, m] += weights[j] * (P[j, k, m] + d[k] * d[m])
        mean /= total
        x_out[kept] = x[i] + mean
        x_out[kept, 2] = wrapped(x_out[kept, 2])
        P_out[kept] = square / total - np.outer(mean, mean)
        w_out[kept], places[kept] = total, i
        kept += 1
    return x_out[:kept].copy(), P_out[:kept].copy(), w_out[:kept].copy(), places[:kept].copy()


@njit(cache=True, nogil=True)
def separations(
    x: Array, P: Array, others: Array, covariances: Array, least: float, deviations: float, squares: Array,
    levels: Array,
) -> None:  # fmt: skip
    """Compare the pose of a state x (d,) of covariance P (d, d) with those of ``others`` (N, d).

    With P = L L' of the pose, the differences d_i = x_i - x of poses are, whitened, w = L^-1 d_i, of the covariance
    M = L^-1 (P_i - P) L^-T or, where x_i is of more readings, -M. ``squares`` (N,) get w' |M|^-1 w, eigenvalues of M
    counting as ``least`` at least; ``levels`` (N, 2) get |d_i| + ``deviations`` standard deviations of P_i, of the
    position and of the heading.
    """
    L = np.linalg.cholesky(P[:3, :3].copy())
    w, M = np.empty(3), np.empty((3, 3))
    for n in range(len(others)):
        Q = covariances[n]
        w[0], w[1], w[2] = others[n, 0] - x[0], others[n, 1] - x[1], wrapped(others[n, 2] - x[2])
        middle, half = 0.5 * (Q[0, 0] + Q[1, 1]), 0.5 * (Q[0, 0] - Q[1, 1])
        largest = middle + math.hypot(half, Q[0, 1])
        levels[n, 0] = math.hypot(w[0], w[1]) + deviations * math.sqrt(max(largest, 0.0))
        levels[n, 1] = abs(w[2]) + deviations * math.sqrt(max(Q[2, 2], 0.0))
        for i in range(3):  # L^-1 from the left, then its transpose from the right
            for j in range(3):
                M[i, j] = Q[i, j] - P[i, j]
                for k in range(i):
                    M[i, j] -= L[i, k] * M[k, j]
                M[i, j] /= L[i, i]
            for k in range(i):
                w[i] -= L[i, k] * w[k]
            w[i] /= L[i, i]
        for i in range(3):
            for j in range(3):
                for k in range(j):
                    M[i, j] -= M[i, k] * L[j, k]
                M[i, j] /= L[j, j]
        values, axes = np.linalg.eigh(0.5 * (M + M.T))
        squares[n] = 0.0
        for k in range(3):
            along = axes[0, k] * w[0] + axes[1, k] * w[1] + axes[2, k] * w[2]
            squares[n] += along * along / max(abs(values[k]), least)
