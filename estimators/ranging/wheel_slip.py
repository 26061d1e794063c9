"""When wheels slip: until friction has brought the robot to the speed of its wheels.

A wheel that slips is pushed by a friction that does not grow with the slip (Coulomb). So the slip velocity d of the
robot, in its own frame and turning with it, has a magnitude that falls at a steady rate a, whatever it is,

    d = (u_1 - v_1, -v_2, (u_2 - omega) / c_phi),    v' = a d / |d| + momentum,

v being the robot's velocity ahead and to its left and omega its turn rate. What it had of speed before it turned it
keeps as a slide to the side. Odometry is off by about d. How much wheels slip the bank learns (``bank_kernels``); d
says when they do. The process noise of slip has weights, of mean one, for the place by (d_1, d_2) and for the heading
by d_3,

    w_i = (2 |d_i|^2 + e^2) / (mean |d|^2 + e^2),

e being a speed by which wheels may always be off.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.ranging.bank_kernels import BY_HEADING
from mathnavi.sim.interfaces.signals import Array

_GRIP = 1.0  # [m/s^2] a, of a floor that is slippery
_MEMORY = 3.0  # [s] of the mean
_ALWAYS = 0.05  # [m/s] e
_MOST = 10.0  # of w


class SlipWeight:
    """The weights of the process noise of slip."""

    def __init__(self) -> None:
        self._ahead, self._left, self._turn = 0.0, 0.0, 0.0  # [m/s, m/s, rad/s] v_1, v_2, omega
        self._mean = 0.0  # [m^2/s^2] of |d|^2

    def update(self, u: Array, dt: float) -> Array:
        """w (2,), of place and heading, over dt [s] in which the wheels turn as for u (2,) [m/s, rad/s]."""
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
