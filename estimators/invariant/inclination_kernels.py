"""One step of the filter of ``inclination``, compiled.

The state is X = (q, v, p, b): the attitude q, the horizontal velocity v and place p in a world with z up, and the bias
b of the gyro. Its error is right-invariant in the attitude, q = Exp(theta) q^, v = Exp(theta) v^ + xi_v and likewise p,
with the components (theta (3), xi_v (2), xi_p (2), beta (3)). Over h, the rate of turn held, and the
specific force in the axes at its end, it is linear whatever the state is, with g the acceleration of free fall,

    theta <- theta - h R beta,    xi_p <- xi_p + h xi_v + h^2 g (theta_2, -theta_1) / 2,
                                  xi_v <- xi_v + h g (theta_2, -theta_1),

in this order, but for terms of v^ beta, of second order. Readings are scalars z = H xi + n, and one
after the other is used,

    s = H P H' + r,    xi <- xi + P H' (z - H xi) / s,    P <- P - P H' H P / s.

None of them has a component of theta_3: a turn of the world about the vertical changes none.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.quaternion import rotation

STATES = 10
HEADING = 2
"""component of the error that no reading shows"""
GYRO, SCALE, WALK, PLACE, SPEED, ACCELERATION, REST, READING, GRAVITY = range(9)
"""entries of ``parameters`` (9,): densities of the gyro's noise [rad^2/s], of that per squared rate [s] and of its
bias [rad^2/s^3]; of the noises of place, velocity and acceleration as they are read while the device moves, and of
velocity at rest [m^2 s, m^2/s, m^2/s^3, m^2/s]; the variance of a reading of the gyro [rad^2/s^2]; g [m/s^2]"""
_SMALL = 1e-8  # [rad]


@njit(cache=True, nogil=True)
def turned(q: Array, theta: Array) -> Array:
    """Quaternion (4,) of q Exp(theta): q (4,) turned by theta (3,) [rad] about its own axes."""
    e = _exponential(theta)
    return _product(q, e)


@inner_njit(nogil=True)
def _exponential(theta: Array) -> Array:
    angle = math.sqrt(theta[0] * theta[0] + theta[1] * theta[1] + theta[2] * theta[2])
    c = 0.5 if angle < _SMALL else math.sin(0.5 * angle) / angle
    return np.array([math.cos(0.5 * angle), c * theta[0], c * theta[1], c * theta[2]])


@inner_njit(nogil=True)
def _product(p: Array, q: Array) -> Array:
    r = np.array(
        [
            p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
            p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
            p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
            p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
        ]
    )
    r /= math.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3])
    return r


@njit(cache=True, nogil=True)
def step(
    q: Array,
    motion: Array,
    bias: Array,
    P: Array,
    reading: Array,
    h: float,
    at_rest: bool,
    still: Array,
    parameters: Array,
) -> Array:
    """Move over h [s] by a reading (6,) [rad/s, m/s^2], the mean over that time, and condition, in place.

    ``q`` (4,), ``motion`` (4,) (v, p) [m/s, m] and ``bias`` (3,) [rad/s] are the state, P (10, 10) its covariance. At
    rest ``still`` (6,) is a reading that shows the gyro's bias.
    Returns the specific force (3,) in the axes of the world.
    """
    w = reading[:3] - bias
    middle = rotation(turned(q, 0.5 * h * w))
    q[:] = turned(q, h * w)
    force = rotation(q) @ reading[3:]
    for i in range(2):
        motion[2 + i] += h * motion[i] + 0.5 * h * h * force[i]
        motion[i] += h * force[i]
    _propagate(P, middle, h, parameters[GRAVITY])
    noise = h * (parameters[GYRO] + parameters[SCALE] * (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]))
    for i in range(3):
        P[i, i] += noise
        P[7 + i, 7 + i] += h * parameters[WALK]
    xi = np.zeros(STATES)
    speed = parameters[REST] if at_rest else parameters[SPEED]
    for i in range(2):
        _condition(xi, P, 5 + i, 1.0, -motion[2 + i], parameters[PLACE] / h)
        _condition(xi, P, 3 + i, 1.0, -motion[i], speed / h)
        gravity = parameters[GRAVITY] if i == 0 else -parameters[GRAVITY]
        _condition(xi, P, 1 - i, gravity, -force[i], parameters[ACCELERATION] / h)
        if at_rest:
            _condition(xi, P, 7 + i, 1.0, still[i] - bias[i], parameters[READING])
    if at_rest:
        _condition(xi, P, 9, 1.0, still[2] - bias[2], parameters[READING])
    e = _exponential(xi[:3])
    E = rotation(e)
    q[:] = _product(e, q)
    for k in (0, 2):
        x, y = motion[k], motion[k + 1]
        motion[k] = E[0, 0] * x + E[0, 1] * y + xi[3 + k]
        motion[k + 1] = E[1, 0] * x + E[1, 1] * y + xi[4 + k]
    bias += xi[7:]
    return force


@inner_njit(nogil=True)
def _propagate(P: Array, R: Array, h: float, g: float) -> None:
    """Replace P by A P A', A the map of the module's head, in its order."""
    half = 0.5 * h * h * g
    for columns in range(2):
        M = P if columns == 0 else P.T
        for j in range(STATES):
            for i in range(3):
                M[i, j] -= h * (R[i, 0] * M[7, j] + R[i, 1] * M[8, j] + R[i, 2] * M[9, j])
            M[5, j] += h * M[3, j] + half * M[1, j]
            M[6, j] += h * M[4, j] - half * M[0, j]
            M[3, j] += h * g * M[1, j]
            M[4, j] -= h * g * M[0, j]


@inner_njit(nogil=True)
def _condition(xi: Array, P: Array, k: int, slope: float, z: float, r: float) -> None:
    """Condition xi (10,) and P on z = slope xi_k + n, n of variance r; P stays symmetric to the bit."""
    b = np.empty(STATES)
    for i in range(STATES):
        b[i] = slope * P[i, k]
    s = slope * b[k] + r
    nu = z - slope * xi[k]
    for i in range(STATES):
        xi[i] += b[i] * nu / s
        for j in range(i + 1):
            P[i, j] -= b[i] * b[j] / s
            P[j, i] = P[i, j]


@njit(cache=True, nogil=True)
def quaternion_covariance(q: Array, P: Array) -> Array:
    """Covariance (4, 4) of the components of a quaternion q (4,) whose error theta has P (3, 3) in the world's axes."""
    half = 0.5 * np.array([[-q[1], -q[2], -q[3]], [q[0], q[3], -q[2]], [-q[3], q[0], q[1]], [q[2], -q[1], q[0]]])
    C = half @ P @ half.T
    return 0.5 * (C + C.T)
