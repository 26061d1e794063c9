"""The unicycle, compiled: its exact motion under inputs that are held, and its derivatives.

    x_1' = u_1 cos phi,   x_2' = u_1 sin phi,   phi' = u_2                                              (Example C.1)

With a = u_2 dt / 2 the chord over dt has the length u_1 dt sin a / a and the direction phi + a.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array


@njit(cache=True, nogil=True)
def sinc(a: float) -> float:
    """sin a / a of an angle a [rad]."""
    return 1.0 - a * a / 6.0 + a**4 / 120.0 if abs(a) < 1e-3 else math.sin(a) / a


@njit(cache=True, nogil=True)
def sinc_derivative(a: float) -> float:
    """Derivative of sin a / a by a [rad]."""
    return -a / 3.0 + a**3 / 30.0 if abs(a) < 1e-3 else (math.cos(a) - math.sin(a) / a) / a


def rays_at(angles: Sequence[float] | Array, places: Sequence[tuple[float, float]] = ()) -> Array:
    """Rays (l, 3) [rad, m, m] at ``angles`` (l,) [rad] off the heading: with the place where each begins, ahead of the
    middle of the axle and to its left. There is one for all or one for each; () is the middle of the axle.
    """
    rays = np.zeros((len(angles), 3))  # in the order of C, as kernels are compiled for
    rays[:, 0], rays[:, 1:] = angles, places or (0.0, 0.0)
    return rays


@inner_njit(nogil=True)
def mounted(ray: Array, heading: float) -> tuple[float, float]:
    """R_phi m (2,) [m] from the robot's place to where a ``ray`` (3,) [rad, m, m] of angle and place m begins."""
    if ray[1] == 0.0 and ray[2] == 0.0:
        return 0.0, 0.0
    c, s = math.cos(heading), math.sin(heading)
    return c * ray[1] - s * ray[2], s * ray[1] + c * ray[2]


@njit(cache=True, nogil=True)
def integrate(pose: Array, u_1: float, u_2: float, dt: float) -> Array:
    """Pose (3,) [m, m, rad] after the inputs u_1 [m/s], u_2 [rad/s] were held for dt [s] from ``pose`` (3,)."""
    a = 0.5 * u_2 * dt
    chord, direction = u_1 * dt * sinc(a), pose[2] + a
    return np.array([pose[0] + chord * math.cos(direction), pose[1] + chord * math.sin(direction), pose[2] + u_2 * dt])


@njit(cache=True, nogil=True)
def motion(heading: float, u_1: float, u_2: float, dt: float) -> tuple[float, float, float, float, float, float]:
    """Motion (2,) [m] from a ``heading`` [rad] under inputs held for dt [s], and its derivatives by u_1 and by u_2.

    Its derivatives by the heading are (-y, x) of the motion (x, y); the heading grows by u_2 dt.
    """
    a = 0.5 * u_2 * dt
    chord, direction = u_1 * dt * sinc(a), heading + a
    c, s = math.cos(direction), math.sin(direction)
    per_speed, per_turn = dt * sinc(a), 0.5 * u_1 * dt * dt * sinc_derivative(a)
    by_turn_x, by_turn_y = per_turn * c - 0.5 * dt * chord * s, per_turn * s + 0.5 * dt * chord * c
    return chord * c, chord * s, per_speed * c, per_speed * s, by_turn_x, by_turn_y


@njit(cache=True, nogil=True)
def integrate_jacobians(pose: Array, u_1: float, u_2: float, dt: float) -> tuple[Array, Array]:
    """Derivatives of ``integrate`` by the pose (3,) [m, m, rad], F (3, 3), and by the inputs [m/s, rad/s], G (3, 2)."""
    F, G = np.eye(3), np.zeros((3, 2))
    x, y, G[0, 0], G[1, 0], G[0, 1], G[1, 1] = motion(pose[2], u_1, u_2, dt)
    F[0, 2], F[1, 2], G[2, 1] = -y, x, dt
    return F, G


@njit(cache=True, nogil=True)
def wrapped(angle: float) -> float:
    """Wrap an angle [rad] into [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
