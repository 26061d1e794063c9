"""The pitch plane and the yaw plane of a flight in space: how a motion falls apart into two, and how two make one.

Seen from the frame R_y(theta), which pitches with the missile but does not yaw, velocity and force are

    (U, V, w) = R_z(psi) (u, v, w),        (F_1, F_2, F_z) = R_z(psi) (F_x, F_y, F_z),

and with a = theta'', b = psi'' and q for theta' the equations of motion are

    pitch:  U' = F_1 / m - q w - g sin theta,   w' = F_z / m + q U + g cos theta,   q' = a,   theta' = q,
            x_e' = U cos theta + w sin theta,   z_e' = -U sin theta + w cos theta;
    yaw:    V' = F_2 / m,   r' = b,   psi' = r,   y_e' = V.

The first are those of the thesis' pitch plane (B.4) with (F_1, F_z, I_y a) for (F_x, F_z, M), the second are linear,
and neither holds a variable of the other: motions planned in each fly together exactly as planned. The planes meet in
the inputs alone, A and A_psi as in ``mathnavi.models.missile.dynamics``,

    F_x = F_1 cos psi + F_2 sin psi,   F_y = F_2 cos psi - F_1 sin psi,
    M = (A a + A_psi r q) / cos psi,   N = I_z b - A_psi q^2 / 2,

and so in the cost and in the limits.
"""

from __future__ import annotations

import numpy as np

from mathnavi.controllers.missile.shooting import Solved
from mathnavi.models.missile.coordinates import PLANAR, SPATIAL
from mathnavi.models.missile.dynamics import Body
from mathnavi.sim.interfaces.signals import Array

PITCH = PLANAR.states
YAW = ("V", "r", "psi", "y_e")


def split(x: Array) -> tuple[Array, Array]:
    """States (..., 6) in the pitch plane and (..., 4) in the yaw plane of spatial states (..., 10)."""
    u, v, w, q, r, theta, psi, x_e, y_e, z_e = np.moveaxis(x, -1, 0)
    c, s = np.cos(psi), np.sin(psi)
    pitch = np.stack([u * c - v * s, w, q / c, theta, x_e, z_e], axis=-1)
    return pitch, np.stack([u * s + v * c, r, psi, y_e], axis=-1)


def together(pitch: Array, yaw: Array) -> Array:
    """Spatial states (..., 10) of both planes' states, (..., 6) and (..., 4): the inverse of ``split``."""
    U, w, q, theta, x_e, z_e = np.moveaxis(pitch, -1, 0)
    V, r, psi, y_e = np.moveaxis(yaw, -1, 0)
    c, s = np.cos(psi), np.sin(psi)
    return np.stack([U * c + V * s, V * c - U * s, w, q * c, r, theta, psi, x_e, y_e, z_e], axis=-1)


def inputs_between(pitch: Solved, yaw: Solved, parts: int, body: Body) -> tuple[Array, Array]:
    """Breaks (K + 1,) [s] that divide each interval of a common grid into ``parts``, and spatial inputs (K, 5) to hold
    between them.

    ``pitch`` holds (F_1, F_z, I_y a) over each interval and ``yaw`` holds (F_2, I_z b). Along the body's axes these
    forces are not constant, for the body turns: each part holds what the inverse dynamics ask for in its middle.
    """
    m, inertia = body.mass, body.inertia
    width = np.repeat(np.diff(pitch.times), parts) / parts
    since = (np.tile(np.arange(parts), len(pitch.u)) + 0.5) * width
    F_1, F_z, turn = np.repeat(pitch.u, parts, axis=0).T
    F_2, swing = np.repeat(yaw.u, parts, axis=0).T
    q_0, theta_0 = np.repeat(pitch.x[:-1, 2:4], parts, axis=0).T
    r_0, psi_0 = np.repeat(yaw.x[:-1, 1:3], parts, axis=0).T
    a, b = turn / inertia, swing / inertia
    q, theta = q_0 + a * since, theta_0 + (q_0 + 0.5 * a * since) * since
    r, psi = r_0 + b * since, psi_0 + (r_0 + 0.5 * b * since) * since
    attitude = np.zeros((len(since), SPATIAL.state_size))  # the inverse dynamics ask for no more of a state
    attitude[:, 3:7] = np.column_stack([q * np.cos(psi), r, theta, psi])
    c, s = np.cos(theta), np.sin(theta)
    # Accelerations of MuJoCo's joints (x, y, z, theta, psi): x ahead, y to the left, z up.
    joints = np.column_stack([(F_1 * c + F_z * s) / m, -F_2 / m, (F_1 * s - F_z * c) / m - body.gravity, a, b])
    breaks = np.concatenate([[0.0], np.cumsum(width)])
    return breaks, SPATIAL.inverse_dynamics(attitude, joints, body)
