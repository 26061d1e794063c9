"""Tuning of an observer's bandwidths by its innovations, one for each component of a tangent vector.

The weights of three poles at rho = e^(-omega h), see ``sampled``, are right if the innovations L are white: if omega is
too low they last as long as the model's error, if it is too high the observer follows the noise and they alternate.
Whiteness is measured over the observer's time constant 1 / omega,

    z = rho z + (1 - rho) L,    s = mean of L^2 over 50 ms,    r = z^2 / (s (1 - rho) / (1 + rho) N),

where the mean of r is 1 for white innovations of any variance, and omega follows

    d log omega = g (1 - rho) (r - 1),                                 g = 0.15, r at most 31.

So neither the noise nor the disturbance has to be known. The error of readings that are rounded to steps of size Delta
is not white if it takes N = Delta / |eta h| > 1 readings to cross a step; z^2 may be N times larger, and s is at least
Delta^2 / 12 plus the variance of the noise, as the mission declares both.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.velocity.poles import triple_pole_weights
from mathnavi.interfaces.signals import Array

_RATE = 0.15  # g
_LARGEST = 31.0  # r
_MEMORY = 0.05  # [s] of the mean of L^2
_OUTLYING = 9.0  # times that mean, beyond which L^2 counts no more
_START, _MOST = 0.1, 1.0  # omega h
_LEAST = 1.0  # [1/s] omega


class BandwidthTuning:
    """Bandwidths omega (n,) for readings with variances (n,) [rad^2, m^2], rounded to ``steps`` (n,) [rad, m]."""

    def __init__(self, period: float, variance: Array, steps: Array) -> None:
        """``period`` is the time [s] between readings."""
        self._least, self._most, self._steps = np.maximum(variance, 1e-24), _MOST / period, steps
        self.omega = np.full(len(variance), max(_START / period, _LEAST))
        self._z, self._s = np.zeros(len(variance)), self._least.copy()

    def weights(self, L: Array, rate: Array, h: float) -> tuple[Array, Array, Array]:
        """Update omega by an innovation L (n,), h [s] after the one before, at the estimated rate (n,); return the
        weights.
        """
        rho = np.exp(-self.omega * h)
        self._z = rho * self._z + (1.0 - rho) * L
        kept = math.exp(-h / _MEMORY)
        self._s = np.maximum(kept * self._s + (1.0 - kept) * np.minimum(L * L, _OUTLYING * self._s), self._least)
        crossing = np.maximum(1.0, self._steps / np.maximum(np.abs(rate) * h, 1e-12))
        white = self._s * np.minimum(1.0, (1.0 - rho) / (1.0 + rho) * crossing)
        r = np.minimum(self._z**2 / white, _LARGEST)
        self.omega = np.clip(self.omega * np.exp(_RATE * (1.0 - rho) * (r - 1.0)), _LEAST, self._most)
        return triple_pole_weights(self.omega, h)
