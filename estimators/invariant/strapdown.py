"""Strapdown navigation by an IMU with the covariance of the left-invariant error on SE_2(3), see ``inertial``."""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.invariant.lie_groups import SE23, SO3
from mathnavi.interfaces.signals import Array
from mathnavi.models.tolerances import TIME_TOLERANCE

TURN, SPEED, PLACE = slice(0, 3), slice(3, 6), slice(6, 9)
"""components of xi: attitude [rad], velocity [m/s] and position [m]"""

_CHANGE = 0.5  # [s] in which a vehicle may change its acceleration and its rate of turn altogether
_TURN_RATE = 1.0  # [rad/s]
_PIECE, _MOST_PIECES = 0.1, 100  # [s] over which a reading is held at once, but not in an endless gap
_LEAST_GYRO, _LEAST_FORCE = 1e-4, 1e-3  # [rad/s, m/s^2] least that are assumed for any IMU


class Strapdown:
    """The element X = (R, v, p) (5, 5) of an IMU, its rate (3,) [rad/s], and P (9, 9) of xi, X = X^ Exp(xi)."""

    def __init__(self, X: Array, P: Array, rate: Array, gravity: Array, deviations: tuple[float, float]) -> None:
        """``gravity`` (3,) [m/s^2] is the acceleration of free fall, ``deviations`` [rad/s, m/s^2] are the IMU's."""
        self.X, self.P, self.rate = X, P, rate.copy()
        self.t: float | None = None  # [s] of X; None before the first call
        self._force: Array | None = None  # (3,) [m/s^2] of the last reading
        self._read = 0.0  # [s] of it
        self._gravity = gravity
        self._variances = np.repeat(np.square(trusted(deviations)), 3)

    def propagate(self, t: float, reading: Array) -> None:
        """Propagate to t [s] by a reading (6,) of the IMU there; the first one only sets the time and the rate."""
        gyro, force = reading[:3], reading[3:]
        dt, rate = 0.0 if self.t is None else t - self.t, 0.5 * (self.rate + gyro)
        self.t, self.rate, self._force, self._read = t, gyro.copy(), force.copy(), t
        if dt > TIME_TOLERANCE:
            self._move(rate, force, dt, self._variances)

    def hold(self, t: float, acceleration_max: float) -> bool:
        """Propagate to t [s] by the last reading; False if there was none.

        Meanwhile the specific force and the rate of turn change, by random walks that in ``_CHANGE`` reach
        ``acceleration_max`` [m/s^2] and ``_TURN_RATE``.
        """
        if self._force is None or self.t is None:
            return False
        begin, ahead = self.t, t - self.t
        pieces = min(math.ceil(ahead / _PIECE - TIME_TOLERANCE), _MOST_PIECES)  # which vary on their own
        for k in range(pieces):
            end = t if k + 1 == pieces else begin + (k + 1) * ahead / pieces
            dt, since, until = end - self.t, self.t - self._read, end - self._read
            # Of the velocity that a walk of intensity q gathers, in the mean over dt: q (until^3 - since^3) / (3 dt^2).
            walked = (until**3 - since**3) / (3.0 * dt * dt * _CHANGE)
            changed = walked * np.repeat((_TURN_RATE**2, acceleration_max**2), 3)
            self.t = end
            self._move(self.rate, self._force, dt, self._variances + changed)
        return True

    def _move(self, rate: Array, force: Array, dt: float, variances: Array) -> None:
        """Propagate over dt [s] by a rate and a specific force (3,), whose ``variances`` (6,) are of their means."""
        moved, A = propagation(self.X, rate, force, self._gravity, dt)
        G = np.zeros((9, 6))
        G[TURN, :3] = dt * SO3.right_jacobian(dt * rate)
        G[SPEED, 3:], G[PLACE, 3:] = dt * np.eye(3), 0.5 * dt * dt * np.eye(3)
        self.X, self.P = moved, A @ self.P @ A.T + G * variances @ G.T

    def correct(self, d: Array, P: Array) -> None:
        """Correct X by an error d (9,), after which the covariance is P (9, 9)."""
        self.X, self.P = self.X @ SE23.exp(d), P


def trusted(deviations: tuple[float, float]) -> tuple[float, float]:
    """Standard deviations [rad/s, m/s^2] that a filter assumes for an IMU's readings: the declared ones, but no less
    than a floor.
    """
    return max(deviations[0], _LEAST_GYRO), max(deviations[1], _LEAST_FORCE)


def propagation(X: Array, rate: Array, force: Array, gravity: Array, dt: float) -> tuple[Array, Array]:
    """Element (5, 5) after dt [s] from X (5, 5), and the matrix A (9, 9) with xi <- A xi of X = X^ Exp(xi), exactly.

    ``rate`` (3,) [rad/s] is the mean body rate over dt, ``force`` (3,) [m/s^2] the specific force in the axes of the
    body at its end, ``gravity`` (3,) [m/s^2] the acceleration of free fall.
    """
    turn = SO3.exp(dt * rate)
    read = SE23.from_parts(turn, dt * turn @ force, 0.5 * dt * dt * turn @ force)  # Upsilon
    carried = X.copy()
    carried[:3, 4] += dt * X[:3, 3]
    after = carried @ read
    after[:3, 3] += dt * gravity
    after[:3, 4] += 0.5 * dt * dt * gravity
    F = np.eye(9)
    F[PLACE, SPEED] = dt * np.eye(3)
    return after, SE23.adjoint(SE23.inverse(read)) @ F
