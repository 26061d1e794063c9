"""Gauss and Newton's steps of all readings since a beginning at once, compiled; see ``batch``.

Poses X_k (N, 3) at the stages with readings, and the constants theta (p,), which are the scale errors and the unknown
places, are the state (X_k, theta) of ``kernels`` at each stage. With the motion X_{k+1} = f_k(X_k, theta) + n_k, the
covariance Q_k of n_k, and the weight beta of each reading, that it is no outlier, the step is the minimum of

    |(X_0, theta) - m|^2_Lambda / 2 + sum |X_{k+1} - f_k|^2_{Q_k^{-1}} / 2 + sum beta (y - h)^2 / (2 sigma^2)

linearised. Its matrix is block-tridiagonal in the poses with a border of theta: eliminating one pose after the other
leaves the information matrix (d, d) of the newest pose and theta.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.beacons.kernels import BEARING, expected
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.unicycle.kernels import motion, wrapped

_SIDEWAYS = 1e-7  # [m^2, rad^2] variance of a motion in any direction: less than matters, enough to be inverted
_ROBUST = 2.0  # sigma from which on a residual weighs less in the robust cost


@njit(cache=True, nogil=True)
def moved(X: Array, theta: Array, pieces: Array) -> tuple[Array, Array, Array, Array]:
    """Pose (3,) to which pieces (M, 5) of duration [s], odometry and densities of its noise lead from X (3,), its
    derivatives A (3, 3) by X and B (3, 2) by the scale errors of odometry, and the covariance Q (3, 3).
    """
    x, A, B, Q = X.copy(), np.eye(3), np.zeros((3, 2)), _SIDEWAYS * np.eye(3)
    G = np.zeros((3, 2))
    for n in range(len(pieces)):
        h, u_1, u_2 = pieces[n, 0], pieces[n, 1], pieces[n, 2]
        v_1, v_2 = (1.0 - theta[0]) * u_1, (1.0 - theta[1]) * u_2
        dx, dy, gx_1, gy_1, gx_2, gy_2 = motion(x[2], v_1, v_2, h)
        x[0] += dx
        x[1] += dy
        x[2] = wrapped(x[2] + v_2 * h)
        for j in range(3):  # F = I but for F_02 = -dy and F_12 = dx; A <- F A, Q <- F Q F'
            A[0, j] -= dy * A[2, j]
            A[1, j] += dx * A[2, j]
            Q[0, j] -= dy * Q[2, j]
            Q[1, j] += dx * Q[2, j]
        for i in range(3):
            Q[i, 0] -= dy * Q[i, 2]
            Q[i, 1] += dx * Q[i, 2]
        for j in range(2):
            B[0, j] -= dy * B[2, j]
            B[1, j] += dx * B[2, j]
        G[0, 0], G[1, 0], G[0, 1], G[1, 1], G[2, 1] = gx_1, gy_1, gx_2, gy_2, h
        for i in range(3):
            B[i, 0] -= G[i, 0] * u_1
            B[i, 1] -= G[i, 1] * u_2
            for j in range(3):
                Q[i, j] += (pieces[n, 3] * G[i, 0] * G[j, 0] + pieces[n, 4] * G[i, 1] * G[j, 1]) / h
    return x, A, B, Q


@njit(cache=True, nogil=True)
def weighed(nu: float, sigma: float, epsilon: float, L: float, robust: bool) -> tuple[float, float]:
    """Weight beta of a residual nu in the next step, and its cost.

    The cost is the negative logarithm of the density, less that at nu = 0; the robust one, that of Cauchy's density,
    also draws residuals that are far off.
    """
    square = (nu / sigma) ** 2
    if robust:
        far = _ROBUST * _ROBUST
        return 1.0 / (1.0 + square / far), 0.5 * far * math.log1p(square / far)
    top = (1.0 - epsilon) / (math.sqrt(2.0 * math.pi) * sigma)
    floor = epsilon / L
    density = top * math.exp(-0.5 * square)
    if density + floor < 1e-300:
        return 1.0, 0.5 * square
    return density / (density + floor), -math.log((density + floor) / (top + floor))


@njit(cache=True, nogil=True)
def cost_of(
    X: Array, theta: Array, prior: tuple[Array, Array], pieces: Array, firsts: Integers, readings: Array,
    places: Array, columns: Integers, errors: Array, robust: bool,
) -> float:  # fmt: skip
    """Cost of poses X (N, 3) and constants theta (p,); arguments as ``step``."""
    m, information = prior
    e = np.concatenate((X[0] - m[:3], theta - m[3:]))
    e[2] = wrapped(e[2])
    cost: float = 0.5 * (e @ (information @ e))
    for k in range(1, len(X)):
        x, _, _, Q = moved(X[k - 1], theta, pieces[firsts[k - 1] : firsts[k]])
        r = X[k] - x
        r[2] = wrapped(r[2])
        cost += 0.5 * (r @ np.linalg.solve(Q, r))
    for n in range(len(readings)):
        kind = int(readings[n, 1])
        state = np.concatenate((X[int(readings[n, 0])], theta))
        h, _, _, rho = expected(state, kind, int(readings[n, 2]), places, columns)
        nu = readings[n, 3] - h
        if kind == BEARING:
            nu = wrapped(nu)
        sigma = math.hypot(errors[kind, 0], errors[kind, 1] * rho)
        cost += weighed(nu, sigma, errors[kind, 2], errors[kind, 3], robust)[1]
    return cost


@njit(cache=True, nogil=True)
def step(
    X: Array, theta: Array, prior: tuple[Array, Array], pieces: Array, firsts: Integers, readings: Array,
    places: Array, columns: Integers, errors: Array, robust: bool, damping: float,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Steps (N, 3) of the poses X (N, 3) and (p,) of theta (p,), and the information matrix (d, d) of the newest state.

    ``prior`` is m (d,) and Lambda (d, d). Pieces (M, 5), as in ``moved``, from stage k to the next are those from
    ``firsts[k]`` (N,) on; readings (n, 4) are stage, kind, beacon and value, in the order of the stages; ``places`` and
    ``columns`` as in ``expected``; ``errors`` (3, 4) absolute and relative deviation, share of outliers and their
    length of each kind. ``damping`` is Levenberg and Marquardt's, relative to the diagonal.
    """
    N, p = len(X), len(theta)
    d = 3 + p
    m, information = prior
    e = np.concatenate((X[0] - m[:3], theta - m[3:]))
    e[2] = wrapped(e[2])
    M, g = information.copy(), -(information @ e)  # of (X_k, theta): M delta = g
    DU = np.empty((3, d))
    D, U, gains = np.empty((N, 3, 3)), np.empty((N, 3, d)), np.empty((N, 3))
    J, WJ, n = np.zeros((3, 3 + d)), np.zeros((3, 3 + d)), 0
    for k in range(N):
        state = np.concatenate((X[k], theta))
        while n < len(readings) and int(readings[n, 0]) == k:
            kind = int(readings[n, 1])
            h, H, _, rho = expected(state, kind, int(readings[n, 2]), places, columns)
            nu = readings[n, 3] - h
            if kind == BEARING:
                nu = wrapped(nu)
            sigma = math.hypot(errors[kind, 0], errors[kind, 1] * rho)
            per = weighed(nu, sigma, errors[kind, 2], errors[kind, 3], robust)[0] / (sigma * sigma)
            for i in range(d):
                if H[i] != 0.0:
                    g[i] += per * H[i] * nu
                    for j in range(d):
                        M[i, j] += per * H[i] * H[j]
            n += 1
        for i in range(3):
            M[i, i] *= 1.0 + damping
        if k == N - 1:
            break
        x, A, B, Q = moved(X[k], theta, pieces[firsts[k] : firsts[k + 1]])
        r = X[k + 1] - x
        r[2] = wrapped(r[2])
        W = np.linalg.inv(Q)
        J[:, :3] = -A  # of r by (X_k, X_{k+1}, theta); nought from column 8 on
        J[:, 3:6] = np.eye(3)
        J[:, 6:8] = -B
        whole, right = np.zeros((3 + d, 3 + d)), np.zeros(3 + d)  # of (X_k, X_{k+1}, theta)
        whole[:3, :3], whole[:3, 6:], whole[6:, :3], whole[6:, 6:] = M[:3, :3], M[:3, 3:], M[3:, :3], M[3:, 3:]
        right[:3], right[6:] = g[:3], g[3:]
        for j in range(8):
            for i in range(3):
                WJ[i, j] = W[i, 0] * J[0, j] + W[i, 1] * J[1, j] + W[i, 2] * J[2, j]
        for i in range(8):
            for j in range(8):
                whole[i, j] += J[0, i] * WJ[0, j] + J[1, i] * WJ[1, j] + J[2, i] * WJ[2, j]
            right[i] -= WJ[0, i] * r[0] + WJ[1, i] * r[1] + WJ[2, i] * r[2]
        D[k] = np.linalg.inv(np.ascontiguousarray(whole[:3, :3]))
        U[k] = whole[:3, 3:]
        gains[k] = right[:3]
        for j in range(d):
            for i in range(3):
                DU[i, j] = D[k, i, 0] * U[k, 0, j] + D[k, i, 1] * U[k, 1, j] + D[k, i, 2] * U[k, 2, j]
        for i in range(d):
            g[i] = right[3 + i]
            for a in range(3):
                g[i] -= DU[a, i] * gains[k, a]
            for j in range(d):
                M[i, j] = whole[3 + i, 3 + j] - (U[k, 0, i] * DU[0, j] + U[k, 1, i] * DU[1, j] + U[k, 2, i] * DU[2, j])
    damped = M.copy()
    for i in range(3, d):
        damped[i, i] *= 1.0 + damping
    last = np.linalg.solve(damped, g)
    steps, now = np.empty((N, 3)), last.copy()
    steps[N - 1] = last[:3]
    for k in range(N - 2, -1, -1):
        own = D[k] @ (gains[k] - U[k] @ now)
        steps[k] = own
        now[:3] = own
    return steps, last[3:].copy(), M


@njit(cache=True, nogil=True)
def ring_costs(ring: Array, poses: Array, rho: Array, sigma: Array) -> Array:
    """Robust costs (K,) of places (K, 2) of a beacon by its distances rho (n,) [m] from positions ``poses`` (n, 2), of
    standard deviations sigma (n,).
    """
    costs = np.zeros(len(ring))
    for k in range(len(ring)):
        for n in range(len(rho)):
            nu = rho[n] - math.hypot(ring[k, 0] - poses[n, 0], ring[k, 1] - poses[n, 1])
            costs[k] += weighed(nu, sigma[n], 0.0, 1.0, True)[1]
    return costs


@njit(cache=True, nogil=True)
def ray_costs(ray: Array, poses: Array, bearings: Array, sigma: Array) -> Array:
    """Robust costs (K,) of places (K, 2) of a beacon by its bearings (n,) [rad] from poses (n, 3), of standard
    deviations sigma (n,).
    """
    costs = np.zeros(len(ray))
    for k in range(len(ray)):
        for n in range(len(bearings)):
            direction = math.atan2(ray[k, 1] - poses[n, 1], ray[k, 0] - poses[n, 0])
            costs[k] += weighed(wrapped(bearings[n] - direction + poses[n, 2]), sigma[n], 0.0, 1.0, True)[1]
    return costs
