"""Gains A, B and C of the observer (D.6), as functions of S = dist(x, xi)^2 / 2.

    constant    A = 2 zeta omega, B = omega^2: with zeta = 1 a double pole at -omega
    printed     A = 3 (1 + S) / sqrt(S + 1e-7), B = 3 (D.5)

and of the curvature term

    minus-one   C = -1, as in the example (D.5)
    matched     C = -2 Upsilon(S) / kappa = -tan(theta / 2) / (theta / 2), tanh where kappa < 0 (Theorem D.2, which
                calls for it with S in Upsilon; at S = 0 it is -1)
    none        C = 0
    plus-one    C = 1, what (D.20) calls so but for the sign of its C terms

with theta = sqrt(2 S), the distance.

Tuning of an observer's bandwidths by its innovations, one for each component of a tangent vector.

The weights of three poles at rho = e^(-omega h), see ``sampled``, are right if the innovations L are white: if omega is
too low they last as long as the model's error, if it is too high the observer follows the noise and they alternate.
Whiteness is measured over the observer's time constant 1 / omega,

    z = rho z + (1 - rho) L,    s = mean of L^2 over 50 ms,    r = z^2 / (s (1 - rho) / (1 + rho) N),

where the mean of r is 1 for white innovations of any variance, and omega follows

    d log omega = g (1 - rho) (r - 1),                                 g = 0.15, r at most 31.

So neither the noise nor the disturbance has to be known. The error of readings that are rounded to steps of size Delta
is not white if it takes N = Delta / |eta h| > 1 readings to cross a step; z^2 may be N times larger, and s is at least
Delta^2 / 12 plus the variance of the noise, as the mission declares both, or as the readings show them. Before either
is known, and of a joint that has not moved, the variance is zero, and omega stays where it starts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mathnavi.estimators.velocity.poles import pole_weights, triple_pole_weights
from mathnavi.interfaces.signals import Array

_RATE = 0.15  # g
_LARGEST = 31.0  # r
_MEMORY = 0.05  # [s] of the mean of L^2
_OUTLYING = 9.0  # times that mean, beyond which L^2 counts no more
_START, _MOST = 0.1, 1.0  # omega h
_NONE = 1e-24  # [rad^2, m^2] variance of readings without errors
_LEAST = 1.0  # [1/s] omega


class BandwidthTuning:
    """Bandwidths omega (n,) for readings with variances (n,) [rad^2, m^2], rounded to ``steps`` (n,) [rad, m]."""

    def __init__(self, period: float, variance: Array, steps: Array, *, slow: bool = False) -> None:
        """``period`` is the time [s] between readings; bandwidths that begin ``slow`` begin at the least."""
        self._variance, self._most, self._steps = variance, _MOST / period, steps
        self.omega = np.full(len(variance), _LEAST if slow else max(_START / period, _LEAST))
        self._z, self._s = np.zeros(len(variance)), variance.copy()

    def learn(self, variance: Array, steps: Array) -> None:
        """Assume a variance (n,) and steps (n,) of readings from now on."""
        self._variance, self._steps = variance, steps
        self._s = np.maximum(self._s, variance)

    def weights(self, L: Array, rate: Array, h: float) -> tuple[Array, Array, Array]:
        """Update omega by an innovation L (n,), h [s] after the one before, at the estimated rate (n,); return the
        weights.
        """
        rho = np.exp(-np.minimum(self.omega, _MOST / h) * h)  # the mission's period may not be that of the readings
        self._z = rho * self._z + (1.0 - rho) * L
        kept = math.exp(-h / _MEMORY)
        mean = kept * self._s + (1.0 - kept) * np.minimum(L * L, _OUTLYING * self._s)
        self._s = np.maximum(mean, np.maximum(self._variance, _NONE))
        crossing = np.maximum(1.0, self._steps / np.maximum(np.abs(rate) * h, 1e-12))
        white = self._s * np.minimum(1.0, (1.0 - rho) / (1.0 + rho) * crossing)
        r = np.minimum(self._z**2 / white, _LARGEST)
        tuned = np.clip(self.omega * np.exp(_RATE * (1.0 - rho) * (r - 1.0)), _LEAST, self._most)
        self.omega = np.where(self._variance > 0.0, tuned, self.omega)
        return triple_pole_weights(np.minimum(self.omega, _MOST / h), h)

    def common_weights(self, n: int, h: float) -> tuple[Array, Array, Array]:
        """Weights of n components that share the greatest bandwidth."""
        return triple_pole_weights(np.full(n, min(float(self.omega.max()), _MOST / h)), h)


GainName = Literal["constant", "printed"]
CurvatureName = Literal["minus-one", "matched", "none", "plus-one"]

DEFAULT_BANDWIDTH = 10.0
"""omega [1/s] if it is neither given nor tuned"""

_CONSTANT_C = {"minus-one": -1.0, "none": 0.0, "plus-one": 1.0}
_SMALL = 1e-4  # [rad] below which tan(a) / a is 1 to 3e-9
_PRINTED_A, _PRINTED_B, _PRINTED_FLOOR = 3.0, 3.0, 1e-7


@dataclass(frozen=True)
class IntrinsicGains:
    """Gains A [1/s], B [1/s^2] and C by the distance theta between x and xi, on a space of curvature ``kappa``."""

    bandwidth: float = DEFAULT_BANDWIDTH  # omega [1/s]
    damping: float = 1.0  # zeta
    law: GainName = "constant"
    curvature: CurvatureName = "minus-one"
    kappa: float = 1.0

    def position(self, theta: float) -> float:
        """Gain A [1/s] at the distance ``theta``."""
        if self.law == "constant":
            return 2.0 * self.damping * self.bandwidth
        S = 0.5 * theta * theta
        return _PRINTED_A * (1.0 + S) / math.sqrt(S + _PRINTED_FLOOR)

    def position_slope(self, theta: float) -> float:
        """Derivative dA / dS [1/s] at the distance ``theta``."""
        if self.law == "constant":
            return 0.0
        S = 0.5 * theta * theta + _PRINTED_FLOOR
        slope: float = _PRINTED_A * (S - 0.5 * (1.0 + S - _PRINTED_FLOOR)) / S**1.5
        return slope

    def velocity(self) -> float:
        """Gain B [1/s^2]."""
        return self.bandwidth**2 if self.law == "constant" else _PRINTED_B

    def curved(self, theta: float) -> float:
        """Gain C of the curvature term at the distance ``theta``."""
        if self.curvature != "matched":
            return _CONSTANT_C[self.curvature]
        half = 0.5 * theta
        if half < _SMALL or self.kappa == 0.0:
            return -1.0
        return -(math.tan(half) if self.kappa > 0.0 else math.tanh(half)) / half

    def curved_slope(self, theta: float) -> float:
        """Derivative dC / dS at the distance ``theta``."""
        half = 0.5 * theta
        if self.curvature != "matched" or self.kappa == 0.0:
            return 0.0
        if half < _SMALL:
            return -self.kappa / 6.0
        if self.kappa > 0.0:
            return -(half / math.cos(half) ** 2 - math.tan(half)) / (4.0 * half**3)
        return -(half / math.cosh(half) ** 2 - math.tanh(half)) / (4.0 * half**3)

    def weights(self, theta: float, h: float) -> tuple[float, float]:
        """Weights alpha and beta [1/s] of a reading h [s] after the one before: see ``sampled``."""
        if self.law == "printed":
            return -math.expm1(-self.position(theta) * h), self.velocity() * h
        return pole_weights(self.bandwidth, self.damping, h)
