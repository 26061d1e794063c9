"""A vehicle that stands still before it moves: what its IMU reads then are its biases.

It has stood still since the first reading as long as no reading, and no mean of the last quarter of a second, is off
the mean of all by more than the noise explains, each component within five standard deviations, and the accelerometer
reads gravity to a tenth, which it does not in a fall. Meanwhile

    0 = omega = gyro - b_g - n_g,      0 = R' v = R^' v^ + xi_v + (R^' v^) x xi_R

are readings too, of the gyro's bias and of the velocity; the latter shows tilt and accelerometer biases together, which
only a turn of the vehicle tells apart.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from mathnavi.estimators.invariant.lie_groups import SO3
from mathnavi.estimators.invariant.strapdown import BIAS, SPEED, TURN, Strapdown, trusted
from mathnavi.estimators.kalman_steps import condition
from mathnavi.interfaces.signals import Array

_RECENT = 0.25  # [s]
_DEVIATIONS = 5.0
_FALLS = 0.1  # of gravity
_CREEP, _CREEPS_FOR = 0.01, 0.5  # [m/s] standard deviation of the velocity at rest, and for how long it is the same [s]


class Rest:
    """The rest of a vehicle from its first IMU reading on, until it moves."""

    def __init__(self, deviations: tuple[float, float], gravity: float) -> None:
        """``deviations`` [rad/s, m/s^2] are those of the IMU's readings, ``gravity`` [m/s^2] what it reads at rest."""
        self._sigma, self._gravity = np.repeat(trusted(deviations), 3), gravity
        self._sum, self._count = np.zeros(6), 0
        self._recent: deque[tuple[float, Array]] = deque()
        self._lasts, self._first = True, 0.0  # [s] of the first reading
        self.seen = False
        """True while the vehicle has stood still, for a quarter of a second at least"""

    def take(self, t: float, reading: Array) -> None:
        """Take a reading (6,) of t [s], and see whether the rest lasts."""
        if not self._lasts:
            return
        recent = self._recent
        self._first = t if not recent else self._first
        recent.append((t, reading))
        while t - recent[0][0] > _RECENT:
            recent.popleft()
        self._sum, self._count = self._sum + reading, self._count + 1
        mean, n, k = self._sum / self._count, self._count, len(recent)
        if abs(float(np.linalg.norm(mean[3:])) - self._gravity) > _FALLS * self._gravity:
            self._lasts = self.seen = False
        if n < 3 or not self._lasts:
            return
        # A reading, or the mean of k, is part of the mean of all n.
        own = np.abs(reading - mean) / (self._sigma * np.sqrt(1.0 - 1.0 / n))
        lately = np.abs(np.mean([each for _, each in recent], axis=0) - mean)
        spread = self._sigma * np.sqrt(max(1.0 / k - 1.0 / n, 1e-12))
        self._lasts = bool(own.max() <= _DEVIATIONS and (k == n or (lately / spread).max() <= _DEVIATIONS))
        self.seen = self._lasts and t - self._first >= _RECENT

    def hold(self, strapdown: Strapdown, reading: Array, h: float) -> None:
        """Condition a filter with biases on a reading (6,) at rest, h [s] after the one before."""
        v = strapdown.X[:3, :3].T @ strapdown.X[:3, 3]
        H = np.zeros((6, 15))
        H[:3, BIAS] = np.eye(3, 6)
        H[3:, SPEED], H[3:, TURN] = np.eye(3), SO3.bracket(v)
        nu = np.concatenate([reading[:3] - strapdown.bias[:3], -v])
        variances = np.square(np.concatenate([self._sigma[:3], np.full(3, _CREEP)]))
        variances[3:] *= max(1.0, _CREEPS_FOR / h)
        d, P, _ = condition(strapdown.P, H, nu, np.diag(variances))
        strapdown.correct(d, P)
