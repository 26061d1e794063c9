"""Covariance of the errors of an observer with given gains: the observer itself has no covariance.

Of every coordinate, the errors e = (e_x, e_v, e_a) of position, velocity and, where it is estimated, of the
acceleration that the model lacks go from reading to reading as

    e^- = F e,    e = (1 - K H) e^- - K n,    F = [1 h h^2/2; 0 1 h; 0 0 1],  K = (alpha, beta, gamma),  H = (1 0 0),

n being the errors of readings, of variance R. So P = cov(e) follows

    P^- = F P F',    P = (1 - K H) P^- (1 - K H)' + K R K',

which tends to the solution of Lyapunov's equation of these gains. It starts with the variance of a reading and that of
a velocity of the mission's greatest speed, or of what the second reading says of it: (L^2 + 2 R) / h^2, R with the
square of a step in it. Forces that depend on the state are left out: most of them, as dampers and servos do, make
errors smaller.

Where constraints act, as at an impact, their acceleration a_c changes at a time that is not known within the prediction
over h: a velocity has the variance (h (a_c - a_c^-))^2 / 12 more.

The errors of rounding to steps of size Delta are alike for as long as the motion takes to cross a step. Over N =
Delta / |v h| readings they count as one, and so as N times their variance Delta^2 / 12, up to the memory of the
observer, 2 / alpha readings.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array

_STANDING = 1e-12  # [rad, m] of a motion between two readings that is none


class Residual(NamedTuple):
    """Correction that an observer makes for a reading."""

    value: Array  # (n,) [rad, m] coordinates of the reading about the prediction
    variance: Array  # (n,) [rad^2, m^2] of the prediction
    gain: Array  # (n,) share of the residual by which the position is moved
    used: bool = True  # whether it was; a reading that is refused moves nothing, and is tested
    moved: Array | None = None  # (n,) by which the position is moved, where that is not the gain times the value


class GainCovariance:
    """Covariances of n coordinates; it knows the errors of their readings."""

    def __init__(self, n: int) -> None:
        self._P, self._second, self._ahead = np.zeros((n, 3, 3)), False, 0.0  # [s] that passed since P
        self._noise, self._steps = np.zeros(n), np.zeros(n)
        self._constraints: Array | None = None  # (n,) acceleration by which constraints acted in the last prediction
        self._deviation = np.zeros(2 * n)
        self.predicted = np.zeros(n)
        """variances (n,) [rad^2, m^2] of the positions before the last reading"""

    def start(self, variance: Array, steps: Array, speed: float) -> None:
        """Start at a reading whose coordinates have a ``variance`` (n,), of which rounding to ``steps`` (n,) is a part;
        the velocity is unknown, up to a ``speed`` [rad/s, m/s].
        """
        self.learn(variance, steps)
        self._P[:] = 0.0
        self._P[:, 0, 0], self._P[:, 1, 1] = variance, speed**2
        self.predicted, self._second, self._ahead, self._constraints = variance.copy(), True, 0.0, None
        self._deviation = np.append(np.sqrt(variance), np.full(len(variance), speed))

    def learn(self, variance: Array, steps: Array) -> None:
        """Assume these errors of a reading from now on."""
        self._steps = steps
        self._noise = np.maximum(variance - np.square(steps) / 12.0, 0.0)

    def predict(self, h: float, constraints: Array | None = None) -> None:
        """Let h [s] pass, at whose end constraints act by an acceleration (n,) [rad/s^2, m/s^2], if there are any."""
        if constraints is not None and constraints.shape == self.predicted.shape:  # one for each component
            if self._constraints is not None:
                self._P[:, 1, 1] += np.square(h * (constraints - self._constraints)) / 12.0
            self._constraints = constraints
        self._ahead += h

    def correct(self, L: Array, weights: tuple[Array, Array, Array], rate: Array, h: float) -> None:
        """Take a reading of the innovation L (n,) by its weights alpha, beta and gamma (n,), h [s] after the one
        before, at rates (n,) [rad/s, m/s].
        """
        alpha, beta, gamma = weights
        self.predicted, self._deviation = update(
            self._P, self._ahead, self._second, L, alpha, beta, gamma, self._noise, self._steps, rate, h
        )
        self._second, self._ahead = False, 0.0

    @property
    def deviation(self) -> Array:
        """Standard deviations (2 n,) of positions and velocities."""
        if not self._ahead:
            return self._deviation
        F = np.array([[1.0, self._ahead, 0.5 * self._ahead**2], [0.0, 1.0, self._ahead]])
        variances = np.einsum("ij,kjl,il->ik", F, self._P, F)
        deviation: Array = np.sqrt(variances.ravel())
        return deviation


@inner_njit()
def predict(P: Array, h: float) -> None:
    """Let h [s] pass: P (n, 3, 3) becomes F P F'."""
    for k in range(len(P)):
        p = P[k]
        for j in range(3):
            p[0, j] += h * p[1, j] + 0.5 * h * h * p[2, j]
            p[1, j] += h * p[2, j]
        for i in range(3):
            p[i, 0] += h * p[i, 1] + 0.5 * h * h * p[i, 2]
            p[i, 1] += h * p[i, 2]


@njit(cache=True, nogil=True)
def update(
    P: Array,
    ahead: float,
    second: bool,
    L: Array,
    alpha: Array,
    beta: Array,
    gamma: Array,
    noise: Array,
    steps: Array,
    rate: Array,
    h: float,
) -> tuple[Array, Array]:
    """Predict P (n, 3, 3) over ``ahead`` [s] and condition it on a reading, h [s] after the one before.

    Returns the variances (n,) of the predicted positions, and the deviations (2 n,) after the reading.
    """
    n = len(P)
    predicted, deviation, K = np.empty(n), np.empty(2 * n), np.empty(3)
    predict(P, ahead)
    for k in range(n):
        p = P[k]
        if second:
            most = L[k] * L[k] + 2.0 * (noise[k] + steps[k] * steps[k])
            p[0, 0], p[1, 1] = min(p[0, 0], most), min(p[1, 1], most / (h * h))
            p[0, 1] = p[1, 0] = 0.0
        predicted[k] = p[0, 0]
        K[0], K[1], K[2] = alpha[k], beta[k], gamma[k]
        crossing = steps[k] / max(abs(rate[k]) * h, _STANDING)
        crossing = max(1.0, min(crossing, 2.0 / max(alpha[k], 1e-6)))
        R = noise[k] + steps[k] * steps[k] / 12.0 * crossing
        before = p[0].copy()
        for i in range(3):
            for j in range(3):
                p[i, j] += K[i] * K[j] * (before[0] + R) - K[i] * before[j] - before[i] * K[j]
        deviation[k], deviation[n + k] = math.sqrt(max(p[0, 0], 0.0)), math.sqrt(max(p[1, 1], 0.0))
    return predicted, deviation
