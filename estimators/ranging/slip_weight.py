"""Weights of the process noise of slip, by a model of when wheels slip: until they have the speed of the robot again.

The friction on a slipping wheel does not grow with the slip (Coulomb). So the slip velocity d of the robot, in its own
rotating frame, has a magnitude that falls at a constant rate a,

    d = (u_1 - v_1, -v_2, (u_2 - omega) / c_phi),    v' = a d / |d| + momentum,

where v is the robot's velocity ahead and to its left and omega its turn rate. When it turns, its speed before the turn
becomes a slide to the side. The error of odometry is about d. The bank estimates how much wheels slip
(``bank_kernels``); d says when they do. The process noise of slip has weights, of mean one, for the position by (d_1,
d_2) and for the heading by d_3,

    w_i = (2 |d_i|^2 + e^2) / (mean |d|^2 + e^2),

where e is a slip speed that wheels may have at any time.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.ranging.bank_kernels import BY_HEADING
from mathnavi.interfaces.signals import Array

_GRIP = 1.0  # [m/s^2] a, of a floor that is slippery
_MEMORY = 3.0  # [s] of the mean
_ALWAYS = 0.05  # [m/s] e
_MOST = 10.0  # of w


class SlipWeight:
    """Weights of the process noise of slip."""

    def __init__(self) -> None:
        self._ahead, self._left, self._turn = 0.0, 0.0, 0.0  # [m/s, m/s, rad/s] v_1, v_2, omega
        self._mean = 0.0  # [m^2/s^2] of |d|^2

    def update(self, u: Array, dt: float) -> Array:
        """Weights w (2,) of position and heading over dt [s], while the wheels turn as u (2,) [m/s, rad/s] asks."""
        c, s = math.cos(self._turn * dt), math.sin(self._turn * dt)
        ahead, left = c * self._ahead + s * self._left, c * self._left - s * self._ahead
        d_1, d_2, d_3 = float(u[0]) - ahead, -left, (float(u[1]) - self._turn) / BY_HEADING
        squares = np.array([d_1 * d_1 + d_2 * d_2, d_3 * d_3])
        square = float(squares.sum())
        share = _GRIP * dt / max(math.sqrt(square), _GRIP * dt)
        self._ahead, self._left = ahead + share * d_1, left + share * d_2
        self._turn += share * d_3 * BY_HEADING
        weights: Array = np.minimum(_MOST, (2.0 * squares + _ALWAYS**2) / (self._mean + _ALWAYS**2))
        self._mean += (1.0 - math.exp(-dt / _MEMORY)) * (square - self._mean)
        return weights
