"""The observer (C.5), compiled: its gradient, its step, and the maps between its state and the pose.

A robot at x = (x_1, x_2, phi) with l range sensors at angles alpha_i off its heading measures rho_i against the curve
theta. Its observer state is z = Psi(x) = (s_1, ..., s_l, phi), and

    theta(s_i) = (x_1, x_2) + rho_i R_{phi + alpha_i} e_1.                                                       (C.4)

    v_i(z) = theta(s_i) - rho_i R_{phi + alpha_i} e_1,           the robot's position by ray i,
    V_rho = sum_{i < j} |v_i - v_j|^2 = |r|^2,                   r = sqrt(m) (v_i - v_mean), stacked,
    Q_i = t_i' R_phi w_i,   w_i = u_1 e_2 + rho_dot_i R_{alpha_i} e_2 - rho_i u_2 R_{alpha_i} e_1,

over the m rays that were read: a NaN range is left out of both, a NaN range rate is left out of Q. With
beta_i = phi + alpha_i, t_i = theta'(s_i) and n_i = -rho_i R_{beta_i} e_2, dv_i / ds_i = t_i and dv_i / dphi = n_i.

z is feasible where V_rho = 0, and equivalent to the truth in output flow only where Q = 0. The proof of Proposition C.2
assumes that V_rho + |Q|^2 / 2 is locally positive definite around the truth to second order, that is, rank [J_v; J_q] =
l + 1 there, with J_v = dr / dz and J_q = dQ / dz.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.kernels import (
    WallShape,
    cast_ray,
    curve_point,
    curve_second_derivative,
    curve_tangent,
    is_inside,
)
from mathnavi.models.unicycle.kernels import integrate, wrapped

LONGEST_STEP = 0.5  # [rad] of any component of z in one correction


DescentGains = tuple[float, float]
"""gains k_V [1/(m^2 s)] of V_rho and k_Q [s/m^4] of |Q|^2 / 2"""


@njit(cache=True, nogil=True)
def descent(
    table: Array, alpha: Array, z: Array, rho: Array, rho_dot: Array, u: Array, gains: DescentGains
) -> tuple[Array, Array, float, float]:
    """Gradient (l + 1,) of k_V V_rho + k_Q |Q|^2 / 2, the matrix H (l + 1, l + 1), V_rho [m^2] and |Q|^2 / 2.

    ``table`` (K + 1, 4) are the coefficients of the wall, alpha (l,) [rad], z (l + 1,), rho (l,) [m], rho_dot (l,)
    [m/s] and u (2,) [m/s, rad/s]. H = 2 k_V J_v' J_v + k_Q J_q' J_q with J_v = dr/dz and J_q = dQ/dz equals the Hessian
    on the truth, where r = 0 and Q = 0.
    """
    k_V, k_Q = gains
    l = len(alpha)  # noqa: E741
    phi = z[l]
    gradient, H = np.zeros(l + 1), np.zeros((l + 1, l + 1))
    v, t, n = np.zeros((l, 2)), np.zeros((l, 2)), np.zeros((l, 2))
    v_x = v_y = n_x = n_y = 0.0
    m = 0
    for i in range(l):
        if math.isnan(rho[i]):
            continue
        c, s = math.cos(phi + alpha[i]), math.sin(phi + alpha[i])
        x, y = curve_point(table, z[i])
        t[i, 0], t[i, 1] = curve_tangent(table, z[i])
        v[i, 0], v[i, 1] = x - rho[i] * c, y - rho[i] * s
        n[i, 0], n[i, 1] = rho[i] * s, -rho[i] * c
        v_x, v_y, n_x, n_y = v_x + v[i, 0], v_y + v[i, 1], n_x + n[i, 0], n_y + n[i, 1]
        m += 1
    if m == 0:
        return gradient, H, 0.0, 0.0
    v_x, v_y, n_x, n_y = v_x / m, v_y / m, n_x / m, n_y / m
    V = 0.0
    for i in range(l):
        if math.isnan(rho[i]):
            continue
        r_x, r_y = v[i, 0] - v_x, v[i, 1] - v_y
        V += m * (r_x * r_x + r_y * r_y)
        gradient[i] += 2.0 * k_V * m * (r_x * t[i, 0] + r_y * t[i, 1])
        gradient[l] += 2.0 * k_V * m * (r_x * n[i, 0] + r_y * n[i, 1])
        for j in range(l):  # a lost ray has t_j = 0
            H[i, j] -= 2.0 * k_V * (t[i, 0] * t[j, 0] + t[i, 1] * t[j, 1])
        H[i, i] += 2.0 * k_V * m * (t[i, 0] * t[i, 0] + t[i, 1] * t[i, 1])
        bent = 2.0 * k_V * m * (t[i, 0] * (n[i, 0] - n_x) + t[i, 1] * (n[i, 1] - n_y))
        H[i, l], H[l, i] = H[i, l] + bent, H[l, i] + bent
        H[l, l] += 2.0 * k_V * m * ((n[i, 0] - n_x) ** 2 + (n[i, 1] - n_y) ** 2)
    squares = 0.0
    c, s = math.cos(phi), math.sin(phi)
    for i in range(l):
        if math.isnan(rho[i]) or math.isnan(rho_dot[i]):
            continue
        c_i, s_i = math.cos(alpha[i]), math.sin(alpha[i])
        a = -rho_dot[i] * s_i - rho[i] * u[1] * c_i
        b = u[0] + rho_dot[i] * c_i - rho[i] * u[1] * s_i
        w_x, w_y = c * a - s * b, s * a + c * b  # R_phi w_i
        bend_x, bend_y = curve_second_derivative(table, z[i])
        Q = t[i, 0] * w_x + t[i, 1] * w_y
        by_s, by_phi = bend_x * w_x + bend_y * w_y, t[i, 1] * w_x - t[i, 0] * w_y
        squares += Q * Q
        gradient[i] += k_Q * by_s * Q
        gradient[l] += k_Q * by_phi * Q
        H[i, i] += k_Q * by_s * by_s
        H[i, l], H[l, i] = H[i, l] + k_Q * by_s * by_phi, H[l, i] + k_Q * by_s * by_phi
        H[l, l] += k_Q * by_phi * by_phi
    return gradient, H, V, 0.5 * squares


@njit(cache=True, nogil=True)
def corrected(
    table: Array, alpha: Array, z: Array, rho: Array, rho_dot: Array, u: Array, gains: DescentGains, dt: float
) -> tuple[Array, float, float]:
    """Take the linearly implicit step z - dt (I + dt H)^-1 gradient over dt [s] from z (l + 1,).

    Returns z after it (l + 1,), and V_rho and |Q|^2 / 2 before it. An explicit step would be unstable: the largest
    eigenvalue of H is in the hundreds and more. No component changes by more than ``LONGEST_STEP``.
    """
    gradient, H, V, squares = descent(table, alpha, z, rho, rho_dot, u, gains)
    if not (np.isfinite(gradient).all() and np.isfinite(H).all()):
        return z.copy(), V, squares
    change = -dt * np.linalg.solve(np.eye(len(z)) + dt * H, gradient)
    for i in range(len(z)):
        change[i] = min(max(change[i], -LONGEST_STEP), LONGEST_STEP)
    return z + change, V, squares


# ---- the maps Phi and Psi


@njit(cache=True, nogil=True)
def output(wall: WallShape, alpha: Array, z: Array, rho: Array) -> Array:
    """Phi: the pose (3,) at the mean of the v_i of the rays that were read, moved back within the wall.

    alpha (l,) [rad], z (l + 1,), rho (l,) [m]; NaN where z does not determine it.
    """
    coefficients, _ = wall
    l = len(alpha)  # noqa: E741
    x = y = 0.0
    m = 0
    for i in range(l):
        if not math.isnan(rho[i]):
            q_x, q_y = curve_point(coefficients, z[i])
            x += q_x - rho[i] * math.cos(z[l] + alpha[i])
            y += q_y - rho[i] * math.sin(z[l] + alpha[i])
            m += 1
    if m == 0 or not math.isfinite(x + y + z[l]):
        return np.full(3, math.nan)
    x, y = kept_within(wall, x / m, y / m)
    return np.array([x, y, z[l]])


@njit(cache=True, nogil=True)
def anchored(wall: WallShape, alpha: Array, z: Array, rho: Array, otherwise: Array) -> Array:
    """Phi(z) (3,) by the ranges rho (l,) [m], or ``otherwise`` (3,) if they or z do not determine it."""
    pose = output(wall, alpha, z, rho)
    return pose if not math.isnan(pose[0]) else otherwise


@njit(cache=True, nogil=True)
def kept_within(wall: WallShape, x: float, y: float) -> tuple[float, float]:
    """The point (x, y) [m] if it is within the wall, otherwise a point just within the nearest part of the wall."""
    coefficients, polyline = wall
    if is_inside(coefficients, polyline, x, y):
        return x, y
    n = len(polyline) - 1
    best, nearest = math.inf, 0
    for k in range(n):
        far = (polyline[k, 0] - x) ** 2 + (polyline[k, 1] - y) ** 2
        if far < best:
            best, nearest = far, k
    before, after = polyline[(nearest - 1) % n], polyline[nearest + 1]
    t_x, t_y = after[0] - before[0], after[1] - before[1]  # the wall is on the right, its inside on the left
    inset = 0.1
    while inset > 1e-9:
        p_x, p_y = polyline[nearest, 0] - inset * t_y, polyline[nearest, 1] + inset * t_x
        if is_inside(coefficients, polyline, p_x, p_y):
            return p_x, p_y
        inset *= 0.5
    return coefficients[0, 0], coefficients[0, 2]


@njit(cache=True, nogil=True)
def seen_from(wall: WallShape, alpha: Array, pose: Array, near: Array) -> Array:
    """Psi: z (l + 1,) of a pose (3,) within the wall, each s_i on the turn that is nearest to ``near`` (l + 1,).

    For a ray that misses the wall, s_i is that of ``near``, or any.
    """
    coefficients, polyline = wall
    l = len(alpha)  # noqa: E741
    z = np.empty(l + 1)
    for i in range(l):
        _, s = cast_ray(coefficients, polyline, pose[0], pose[1], pose[2] + alpha[i])
        around = near[i] if not math.isnan(near[i]) else 0.0
        z[i] = around + wrapped(s - around) if not math.isnan(s) else around
    z[l] = pose[2]
    return z


@njit(cache=True, nogil=True)
def observed(
    wall: WallShape,
    alpha: Array,
    z: Array,
    predicted: Array,
    readings: Array,
    u: Array,
    gains: DescentGains,
    dt: float,
) -> tuple[Array, Array, Array]:
    """Correct the observer by readings (2, l) of rho [m] and rho_dot [m/s] under the input u (2,) over dt [s].

    ``z`` (l + 1,) is the state after the feed-forward, NaN where that is not known, and ``predicted`` the pose (3,) by
    odometry, which replaces lost rays. Returns z (l + 1,), the pose (3,) and (V_rho, |Q|^2 / 2) (2,).
    """
    coefficients, _ = wall
    l = len(alpha)  # noqa: E741
    seen = seen_from(wall, alpha, predicted, z)
    for i in range(l + 1):
        if math.isnan(z[i]):
            z[i] = seen[i]
    z, V, squares = corrected(coefficients, alpha, z, readings[0], readings[1], u, gains, dt)
    pose = output(wall, alpha, z, readings[0])
    if math.isnan(pose[0]):
        return seen, predicted.copy(), np.zeros(2)
    for i in range(l):
        if math.isnan(readings[0, i]):
            z[i] = seen_from(wall, alpha, pose, z)[i]
    return z, pose, np.array([V, squares])


@njit(cache=True, nogil=True)
def pushed_forward(
    wall: WallShape, alpha: Array, z: Array, pose: Array, inputs: Array, period: float
) -> tuple[Array, Array]:
    """Propagate z (l + 1,) and ``pose`` (3,) under the ``inputs`` (m, 2), each held for a period [s].

    The difference of z from Psi of the pose is kept.
    """
    here, after = seen_from(wall, alpha, pose, z), pose
    for u in inputs:
        after = integrate(after, u[0], u[1], period)
    after = after.copy()
    after[0], after[1] = kept_within(wall, after[0], after[1])
    return z + (seen_from(wall, alpha, after, here) - here), after
