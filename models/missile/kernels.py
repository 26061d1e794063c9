"""The missile's motion, compiled: flow, joint coordinates and inverse dynamics of the spatial body (see ``dynamics``).

A state is x = (u, v, w, q, r, theta, psi, x_e, y_e, z_e), an input (F_x, F_y, F_z, M, N), and (m, I_y, I_x, g) the
numbers of a ``Body``. MuJoCo's joint coordinates are j = (x, y, z, theta, psi) and their rates, in its world frame with
z up: x = x_e, y = -y_e, z = -z_e. Arrays hold a state in each row. The pitch plane is the part of space in which v, r,
psi, y_e, F_y and N are zero, and is computed there.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.runge_kutta import compiled_halfway, compiled_sum
from mathnavi.models.tolerances import TIME_TOLERANCE

Numbers = tuple[float, float, float, float]


@njit(cache=True, nogil=True)
def rotation(theta: float, psi: float) -> Array:
    """R = R_y(theta) R_z(psi) (3, 3), from the body frame to the Earth frame."""
    s, c, sin, cos = math.sin(theta), math.cos(theta), math.sin(psi), math.cos(psi)
    return np.array(((c * cos, -c * sin, s), (sin, cos, 0.0), (-s * cos, s * sin, c)))


@njit(cache=True, nogil=True)
def _rate(x: Array, u: Array, numbers: Numbers, out: Array) -> None:
    """Fill ``out`` (10,) with x'."""
    m, I_y, I_x, g = numbers
    q, r, theta, psi = x[3], x[4], x[5], x[6]
    sin, cos = math.sin(psi), math.cos(psi)
    theta_dot = q / cos
    p = theta_dot * sin
    R = rotation(theta, psi)
    A = I_x * sin * sin + I_y * cos * cos
    A_psi = 2.0 * (I_x - I_y) * sin * cos
    out[0] = u[0] / m - q * x[2] + r * x[1] + g * R[2, 0]
    out[1] = u[1] / m - r * x[0] + p * x[2] + g * R[2, 1]
    out[2] = u[2] / m - p * x[1] + q * x[0] + g * R[2, 2]
    out[3] = cos * (u[3] * cos - A_psi * r * theta_dot) / A - r * theta_dot * sin
    out[4] = (u[4] + 0.5 * A_psi * theta_dot * theta_dot) / I_y
    out[5] = theta_dot
    out[6] = r
    for i in range(3):
        out[7 + i] = R[i, 0] * x[0] + R[i, 1] * x[1] + R[i, 2] * x[2]


@njit(cache=True, nogil=True)
def rates(x: Array, u: Array, numbers: Numbers) -> Array:
    """Rates x' (n, 10) at states x (n, 10) under inputs u (n, 5) [N, N m]."""
    out = np.empty_like(x)
    for k in range(len(x)):
        _rate(x[k], u[k], numbers, out[k])
    return out


@njit(cache=True, nogil=True)
def flow(x: Array, u: Array, dt: float, numbers: Numbers, step: float) -> Array:
    """State (10,) after the input u (5,) [N, N m] was held for dt [s] from x (10,): Runge-Kutta steps of at most
    ``step`` [s].
    """
    now = x.copy()
    count = max(1, math.ceil(abs(dt) / step - TIME_TOLERANCE))
    h = dt / count
    k_1, k_2, k_3, k_4 = np.empty(10), np.empty(10), np.empty(10), np.empty(10)
    middle = np.empty(10)
    for _ in range(count):
        _rate(now, u, numbers, k_1)
        for i in range(10):
            middle[i] = compiled_halfway(now[i], h, k_1[i])
        _rate(middle, u, numbers, k_2)
        for i in range(10):
            middle[i] = compiled_halfway(now[i], h, k_2[i])
        _rate(middle, u, numbers, k_3)
        _rate(now + h * k_3, u, numbers, k_4)
        for i in range(10):
            now[i] = compiled_sum(now[i], h, k_1[i], k_2[i], k_3[i], k_4[i])
    return now


@njit(cache=True, nogil=True)
def states_on(t: Array, x: Array, u: Array, times: Array, numbers: Numbers, step: float) -> Array:
    """States (m, 10) at ``times`` (m,) [s] of arcs from t (K + 1,) [s], x (K + 1, 10) with inputs u (K, 5) [N, N m].

    Before the first arc it is its first state; the last arc goes on after its end.
    """
    out = np.empty((len(times), 10))
    for k in range(len(times)):
        arc = min(np.searchsorted(t, times[k] + TIME_TOLERANCE, side="right") - 1, len(u) - 1)
        if arc < 0:
            out[k] = x[0]
        else:
            out[k] = flow(x[arc], u[arc], times[k] - t[arc], numbers, step)
    return out


@njit(cache=True, nogil=True)
def to_joints(x: Array) -> Array:
    """Joint coordinates and rates (n, 10) of states x (n, 10)."""
    out = np.empty_like(x)
    for k in range(len(x)):
        u, v, w, q, r, theta, psi = x[k, :7]
        R = rotation(theta, psi)
        out[k, :5] = (x[k, 7], -x[k, 8], -x[k, 9], theta, psi)
        for i, sign in ((0, 1.0), (1, -1.0), (2, -1.0)):
            out[k, 5 + i] = sign * (R[i, 0] * u + R[i, 1] * v + R[i, 2] * w)
        out[k, 8:] = (q / math.cos(psi), r)
    return out


@njit(cache=True, nogil=True)
def from_joints(j: Array) -> Array:
    """States (n, 10) of joint coordinates and rates j (n, 10)."""
    out = np.empty_like(j)
    for k in range(len(j)):
        theta, psi = j[k, 3], j[k, 4]
        R = rotation(theta, psi)
        for i in range(3):
            out[k, i] = R[0, i] * j[k, 5] - R[1, i] * j[k, 6] - R[2, i] * j[k, 7]
        out[k, 3:7] = (j[k, 8] * math.cos(psi), j[k, 9], theta, psi)
        out[k, 7:] = (j[k, 0], -j[k, 1], -j[k, 2])
    return out


@njit(cache=True, nogil=True)
def joint_accelerations(x: Array, u: Array, numbers: Numbers) -> Array:
    """Joint accelerations (x'', y'', z'', theta'', psi'') (n, 5) at states x (n, 10) under inputs u (n, 5) [N, N m]."""
    m, I_y, I_x, g = numbers
    out = np.empty((len(x), 5))
    for k in range(len(x)):
        r, theta, psi = x[k, 4], x[k, 5], x[k, 6]
        sin, cos = math.sin(psi), math.cos(psi)
        theta_dot = x[k, 3] / cos
        R = rotation(theta, psi)
        A = I_x * sin * sin + I_y * cos * cos
        A_psi = 2.0 * (I_x - I_y) * sin * cos
        for i, sign in ((0, 1.0), (1, -1.0), (2, -1.0)):
            out[k, i] = sign * (R[i, 0] * u[k, 0] + R[i, 1] * u[k, 1] + R[i, 2] * u[k, 2]) / m
        out[k, 2] -= g
        out[k, 3] = (u[k, 3] * cos - A_psi * r * theta_dot) / A
        out[k, 4] = (u[k, 4] + 0.5 * A_psi * theta_dot * theta_dot) / I_y
    return out


@njit(cache=True, nogil=True)
def inverse_dynamics(x: Array, a: Array, numbers: Numbers) -> Array:
    """Inputs (n, 5) [N, N m] that give the joint accelerations a (n, 5) at states x (n, 10)."""
    m, I_y, I_x, g = numbers
    out = np.empty((len(x), 5))
    for k in range(len(x)):
        r, theta, psi = x[k, 4], x[k, 5], x[k, 6]
        sin, cos = math.sin(psi), math.cos(psi)
        theta_dot = x[k, 3] / cos
        R = rotation(theta, psi)
        A = I_x * sin * sin + I_y * cos * cos
        A_psi = 2.0 * (I_x - I_y) * sin * cos
        for i in range(3):
            out[k, i] = m * (R[0, i] * a[k, 0] - R[1, i] * a[k, 1] - R[2, i] * (a[k, 2] + g))
        out[k, 3] = (A * a[k, 3] + A_psi * r * theta_dot) / cos
        out[k, 4] = I_y * a[k, 4] - 0.5 * A_psi * theta_dot * theta_dot
    return out
