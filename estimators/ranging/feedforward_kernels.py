"""Feed-forwards Psi_* F that carry the observer's state z from one instant to the next, compiled; (C.5) as printed has
none.

(C.5) as printed is a gradient descent only: on the truth, where V_rho = 0 and Q = 0, its right side is zero while
Psi(x) moves on. So it is no observer in the sense of Definition C.7, and lags by an error of order |Psi(x)'| / k. Each
feed-forward below gives Psi(x)' on the truth; off the truth they differ. All have the same arguments: the wall, alpha
(l,) [rad], z (l + 1,), the readings (2, l) of rho and rho_dot ``here`` and ``there``, the input u (2,) that is held for
dt [s] between them. What depends on a reading that is NaN is NaN.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.ranging.observer_kernels import kept_within, output, seen_from
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.kernels import WallShape, curve_tangent
from mathnavi.models.unicycle.kernels import integrate

LEAST_DENOMINATOR = 0.05  # [m] of s_rate: where a ray grazes the wall, s_i has no bounded rate


@njit(cache=True, nogil=True)
def s_rate(table: Array, alpha: Array, z: Array, rho: Array, u: Array) -> Array:
    """z' (l + 1,) = (s_1', ..., s_l', u_2) from (C.4), its rows along the rays left out:

    s_i' = (-u_1 sin alpha_i + rho_i u_2) / (theta'(s_i)' R_{phi + alpha_i} e_2).
    """
    l = len(alpha)  # noqa: E741
    rate = np.empty(l + 1)
    for i in range(l):
        t_x, t_y = curve_tangent(table, z[i])
        across = t_y * math.cos(z[l] + alpha[i]) - t_x * math.sin(z[l] + alpha[i])
        across = math.copysign(max(abs(across), LEAST_DENOMINATOR), across)
        rate[i] = (rho[i] * u[1] - u[0] * math.sin(alpha[i])) / across
    rate[l] = u[1]
    return rate


@njit(cache=True, nogil=True)
def rho_dot_rate(table: Array, alpha: Array, z: Array, rho: Array, rho_dot: Array, u: Array) -> Array:
    """z' (l + 1,) = (s_1', ..., s_l', u_2) from (C.4), projected on the wall:

    s_i' = theta'(s_i)' R_phi (u_1 e_1 + rho_dot_i R_{alpha_i} e_1 + rho_i u_2 R_{alpha_i} e_2) / |theta'(s_i)|^2.
    """
    l = len(alpha)  # noqa: E741
    rate = np.empty(l + 1)
    for i in range(l):
        t_x, t_y = curve_tangent(table, z[i])
        c, s = math.cos(z[l] + alpha[i]), math.sin(z[l] + alpha[i])
        q_x = u[0] * math.cos(z[l]) + rho_dot[i] * c - rho[i] * u[1] * s
        q_y = u[0] * math.sin(z[l]) + rho_dot[i] * s + rho[i] * u[1] * c
        rate[i] = (t_x * q_x + t_y * q_y) / (t_x * t_x + t_y * t_y)
    rate[l] = u[1]
    return rate


@njit(cache=True, nogil=True)
def stay(wall: WallShape, alpha: Array, z: Array, here: Array, there: Array, u: Array, dt: float) -> Array:
    """Return z (l + 1,) unchanged: no feed-forward, (C.5) as printed."""
    return z.copy()


@njit(cache=True, nogil=True)
def forward_s(wall: WallShape, alpha: Array, z: Array, here: Array, there: Array, u: Array, dt: float) -> Array:
    """Feed z (l + 1,) forward by ``s_rate``, integrated by Heun's method."""
    coefficients, _ = wall
    first = s_rate(coefficients, alpha, z, here[0], u)
    second = s_rate(coefficients, alpha, z + dt * first, there[0], u)
    return z + 0.5 * dt * (first + second)


@njit(cache=True, nogil=True)
def forward_rho_dot(wall: WallShape, alpha: Array, z: Array, here: Array, there: Array, u: Array, dt: float) -> Array:
    """Feed z (l + 1,) forward by ``rho_dot_rate``, integrated by Heun's method."""
    coefficients, _ = wall
    first = rho_dot_rate(coefficients, alpha, z, here[0], here[1], u)
    second = rho_dot_rate(coefficients, alpha, z + dt * first, there[0], there[1], u)
    return z + 0.5 * dt * (first + second)


@njit(cache=True, nogil=True)
def forward_manifold(wall: WallShape, alpha: Array, z: Array, here: Array, there: Array, u: Array, dt: float) -> Array:
    """Feed z (l + 1,) forward as Psi of the pose that Phi(z) moves to: exact, and in the image of Psi."""
    pose = output(wall, alpha, z, here[0])
    if math.isnan(pose[0]):
        return np.full(len(z), math.nan)
    pose = integrate(pose, u[0], u[1], dt)
    pose[0], pose[1] = kept_within(wall, pose[0], pose[1])
    return seen_from(wall, alpha, pose, z)
