"""The quadrotor's tracker, compiled: reference filter, attitude of a thrust, attitude error, law of the rotors.

Frames and letters are those of ``mathnavi.models.quadrotor.dynamics``; see ``attitude`` and ``tracker`` for the use of
the functions. Every vector is (3,), a reference z is (4, 3): position, velocity, acceleration, jerk.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64

from mathnavi.controllers.flight.ahead import CERTIFYING, LINEARISING, PLAN, SEARCHING
from mathnavi.interfaces.compiled import Signature, njit
from mathnavi.interfaces.kernel_types import ONE, ONE_READ, TWO
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.kernels import arc_at, state_on
from mathnavi.models.quadrotor.allocation import allocated
from mathnavi.models.quaternion import rotation

_STEPS = 1000  # arcs that one call may pass: a bound for a plan of many tiny ones
_SMALL = 1e-9


@njit(cache=True, nogil=True)
def target_at(breaks: Array, x: Array, u: Array, arc: int, t: float) -> Array:
    """Position [m] and three derivatives (4, 3) of arc ``arc`` of a plan at t [s], also beyond its ends.

    Before the first arc it is that one extended back: a plan that has just taken over joins what was flown before it.
    After the last it is the state of rest in which the plan ends.
    """
    target = np.zeros((4, 3))
    k = min(max(arc, 0), len(u))
    s = t - breaks[k] if arc < len(u) else 0.0
    for i in range(3):
        a = u[k, i] if arc < len(u) else 0.0
        target[0, i] = x[k, i] + s * x[k, 3 + i] + 0.5 * s * s * a
        target[1, i] = x[k, 3 + i] + s * a
        target[2, i] = a
    return target


@njit(cache=True, nogil=True)
def advanced(
    z: Array, breaks: Array, x: Array, u: Array, t: float, t_end: float, preview: float, bandwidth: float
) -> Array:
    """Reference (4, 3) at ``t_end`` [s] that was ``z`` (4, 3) at t [s], exact: see
    ``mathnavi.controllers.quadrotor.tracker``."""
    w = bandwidth
    for _ in range(_STEPS):
        arc = arc_at(breaks, t + preview)
        until = t_end
        if arc + 1 < len(breaks):
            until = min(until, max(breaks[arc + 1] - preview, t + _SMALL))
        s = until - t
        # e' = A e with (A + w I)^4 = 0, so the exponential is a cubic times e^(-w s).
        e = z - target_at(breaks, x, u, arc, t)
        total, term = e.copy(), e
        for k in range(1, 4):
            following = np.empty((4, 3))
            for i in range(3):
                for row in range(3):
                    following[row, i] = w * term[row, i] + term[row + 1, i]
                following[3, i] = (
                    -(w**4) * term[0, i] - 4.0 * w**3 * term[1, i] - 6.0 * w**2 * term[2, i] - 3.0 * w * term[3, i]
                )
            term = following * (s / k)
            total = total + term
        z = target_at(breaks, x, u, arc, until) + math.exp(-w * s) * total
        t = until
        if t >= t_end - 1e-12:
            break
    return z


@njit(cache=True, nogil=True)
def attitude_of(f: Array, heading: float) -> Array:
    """R_d (3, 3): b_3 along f, b_1 in the half-plane of b_3 and the heading [rad]."""
    R = np.empty((3, 3))
    up = f / max(math.sqrt(f @ f), _SMALL)
    ahead = np.array([math.cos(heading), math.sin(heading), 0.0])
    left = np.cross(up, ahead)
    length = math.sqrt(left @ left)
    if length < 1e-6:  # the thrust points along the heading
        left, length = np.array([-ahead[1], ahead[0], 0.0]), 1.0
    left = left / length
    R[:, 0], R[:, 1], R[:, 2] = np.cross(left, up), left, up
    return R


@njit(cache=True, nogil=True)
def rates_of(R: Array, f: Array, f_dot: Array, heading: float, turn: float) -> Array:
    """Omega_d [rad/s] in the frame of R = attitude_of(f, heading) while f changes by f_dot and the heading by turn."""
    size = max(math.sqrt(f @ f), _SMALL)
    b_1, b_2, b_3 = R[:, 0].copy(), R[:, 1].copy(), R[:, 2].copy()
    moving = (f_dot - (b_3 @ f_dot) * b_3) / size
    ahead = np.array([math.cos(heading), math.sin(heading), 0.0])
    aside = np.array([-ahead[1], ahead[0], 0.0])
    omega = np.empty(3)
    omega[0], omega[1] = -(b_2 @ moving), b_1 @ moving
    # From b_2 . ahead = 0 at all times.
    omega[2] = (omega[0] * (b_3 @ ahead) + turn * (b_2 @ aside)) / max(b_1 @ ahead, 0.1)
    return omega


@njit(cache=True, nogil=True)
def attitude_error(R_d: Array, R: Array) -> Array:
    """Attitude error e_R = 2 sin(theta / 2) n (3,) of R (3, 3) against R_d (3, 3).

    theta and n are the angle and the axis, in the body frame, that lead from R_d to R. That is (Q - Q')^ / sqrt(1 + tr
    Q), Q = R_d' R. At theta = pi, where that is 0 / 0, an axis n is taken.
    """
    Q = R_d.T @ R
    e = np.array([Q[2, 1] - Q[1, 2], Q[0, 2] - Q[2, 0], Q[1, 0] - Q[0, 1]])  # 2 sin(theta) n
    one_and_trace = 1.0 + Q[0, 0] + Q[1, 1] + Q[2, 2]  # 4 cos^2(theta / 2)
    if one_and_trace > 1e-6:
        return e / math.sqrt(one_and_trace)
    # Q + I = 2 n n': its longest column is along n.
    best, longest = 0, 0.0
    for k in range(3):
        length = float(Q[k, k]) + 1.0
        if length > longest:
            best, longest = k, length
    n = Q[:, best].copy()
    n[best] += 1.0
    n *= 2.0 / math.sqrt(float(n @ n))  # at least 4 / 3
    return -n if n @ e < 0.0 else n


@njit(cache=True, nogil=True)
def limited(a: Array, longest: float) -> Array:
    """Shorten a vector a (n,) to ``longest`` if it is longer."""
    length = math.sqrt(a @ a)
    return a * (longest / length) if length > longest else a.copy()


@njit(cache=True, nogil=True)
def within_tilt(f: Array, least: float, tangent: float) -> Array:
    """Force f (3,) [N] with a vertical part of at least ``least`` and a horizontal one of at most ``tangent`` times the
    vertical.
    """
    held = f.copy()
    held[2] = max(f[2], least)
    across = math.hypot(f[0], f[1])
    if across > tangent * held[2]:
        held[:2] *= tangent * held[2] / across
    return held


@njit(cache=True, nogil=True)
def moments(
    R: Array, omega: Array, R_d: Array, omega_d: Array, omega_d_dot: Array, inertia: Array, stiffness: Array,
    damping: Array,
) -> Array:  # fmt: skip
    """Moments tau (3,) [N m] = J (-k_R e_R - k_Omega e_Omega + Q' omega_d' - omega x Q' omega_d) + omega x J omega.

    Q = R_d' R of R, R_d (3, 3); omega, omega_d (3,) [rad/s], omega_d_dot (3,) [rad/s^2], body frames; ``inertia`` (3,)
    [kg m^2], ``stiffness`` (3,) [1/s^2] and ``damping`` (3,) [1/s].
    """
    back = R.T @ R_d
    carried = back @ omega_d
    pushed = -stiffness * attitude_error(R_d, R) - damping * (omega - carried)
    pushed += back @ omega_d_dot - np.cross(omega, carried)
    tau: Array = inertia * pushed + np.cross(omega, inertia * omega)
    return tau


# Kernels that are compiled before a run (``sim.engine.compilation``), for arguments of these types.
STEP = (float64, float64, float64, float64)
OWN: tuple[Signature, ...] = (
    (moments, (TWO, ONE, TWO, ONE, ONE, ONE, ONE, ONE)),
    (rates_of, (TWO, ONE, ONE, float64, float64)),
    (attitude_of, (ONE, float64)),
    (rotation, (ONE,)),
    (allocated, (ONE, TWO, float64)),
    (within_tilt, (ONE, float64, float64)),
    (limited, (ONE, float64)),
    (advanced, (TWO, *PLAN, *STEP)),
    (advanced, (TWO, ONE, TWO, TWO, *STEP)),
    (target_at, (*PLAN, int64, float64)),
    (arc_at, (ONE_READ, float64)),
    (state_on, (ONE, TWO, TWO, float64)),
)
KERNELS = (*LINEARISING, *CERTIFYING, *OWN, *SEARCHING)
