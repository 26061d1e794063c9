"""When wheels slip: while they change their speed, for the robot follows them only as fast as they grip.

The robot's speed and turn rate follow those of the wheels, u, with a lag T, as those of a first-order system,

    T u_robot' = u - u_robot,        d = u - u_robot,

so that odometry is off by about d. How much wheels slip the bank learns (``bank_kernels``); d says when they do. The
process noise of slip has weights, of mean one, for the place by d_1 and for the heading by d_2 / c_phi,

    w_i = (2 |d_i|^2 + e^2) / (mean (d_1^2 + (d_2 / c_phi)^2) + e^2),

e being a speed by which wheels may always be off.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.ranging.bank_kernels import BY_HEADING
from mathnavi.sim.interfaces.signals import Array

_LAG = 0.15  # [s] T
_MEMORY = 3.0  # [s] of the mean
_ALWAYS = 0.05  # [m/s] e
_MOST = 10.0  # of w


class SlipWeight:
    """The weights of the process noise of slip."""

    def __init__(self) -> None:
        self._robot = np.zeros(2)  # [m/s, rad/s] u_robot
        self._mean = 0.0  # [m^2/s^2] of |d|^2

    def update(self, u: Array, dt: float) -> Array:
        """w (2,), of place and heading, over dt [s] in which the wheels turn as for u (2,) [m/s, rad/s]."""
        d = u - self._robot
        squares = np.square([d[0], d[1] / BY_HEADING])
        square = float(squares.sum())
        self._robot = self._robot + (1.0 - math.exp(-dt / _LAG)) * d
        weights = np.minimum(_MOST, (2.0 * squares + _ALWAYS**2) / (self._mean + _ALWAYS**2))
        self._mean += (1.0 - math.exp(-dt / _MEMORY)) * (square - self._mean)
        return weights
