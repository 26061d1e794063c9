"""Strapdown navigation by an IMU with the covariance of the left-invariant error on SE_2(3), see ``inertial``.

An IMU reads omega + b_g + n_g and f + b_a + n_a. Its biases b are states too where they are declared: the filter
propagates by its readings less b^, and of X = X^ Exp(xi), b = b^ + beta, over dt,

    xi <- A xi - G beta,      beta <- beta + w,      w of variance sigma_b^2 dt / (1 h),

G the effect of a constant error of a reading (the imperfect invariant filter; A. Barrau, thesis, Mines ParisTech 2015,
5.3). Without declared biases beta is no state.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.invariant.lie_groups import SE23, SO3
from mathnavi.interfaces.signals import Array
from mathnavi.models.tolerances import TIME_TOLERANCE

TURN, SPEED, PLACE = slice(0, 3), slice(3, 6), slice(6, 9)
"""components of xi: attitude [rad], velocity [m/s] and position [m]"""
BIAS = slice(9, 15)
"""components of xi where biases are declared: of the gyro [rad/s] and of the accelerometer [m/s^2]"""

WALK = 3600.0
"""time [s] in which a bias changes by its declared standard deviation"""

_FARTHEST, _WIDEST = 1.0, 100.0  # [rad] deviation of an attitude of which little is known; largest factor of a variance
_SHAKEN, _CALM = 10.0, 30.0  # [s] in which biases change that have changed, and in which they calm down

_CHANGE = 0.5  # [s] in which a vehicle may change its acceleration and its rate of turn altogether
_TURN_RATE = 1.0  # [rad/s]
_PIECE, _MOST_PIECES = 0.1, 100  # [s] over which a reading is held at once, but not in an endless gap
_LEAST_GYRO, _LEAST_FORCE = 1e-4, 1e-3  # [rad/s, m/s^2] least that are assumed for any IMU


class Strapdown:
    """The element X = (R, v, p) (5, 5) of an IMU, its rate (3,) [rad/s], its biases, and P of xi, X = X^ Exp(xi).

    P is (9, 9), or (15, 15) with biases.
    """

    def __init__(
        self,
        X: Array,
        P: Array,
        rate: Array,
        gravity: Array,
        deviations: tuple[float, float],
        biases: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Start from X with P (9, 9).

        ``gravity`` (3,) [m/s^2] is the acceleration of free fall, ``deviations`` [rad/s, m/s^2] are those of the IMU's
        readings and ``biases`` those of their biases about or along each axis.
        """
        self.bias = np.zeros(6)  # [rad/s, m/s^2]
        self._walk = np.repeat(np.square(biases), 3) / WALK if any(biases) else np.empty(0)
        self._shaken = np.zeros_like(self._walk)  # what biases that have changed go on changing by, as ``_walk``
        self.X, self.P, self.rate = X, P, rate.copy()
        if any(biases):
            self.P = np.zeros((15, 15))
            self.P[:9, :9], self.P[BIAS, BIAS] = P, np.diag(np.repeat(np.square(biases), 3))
        self.t: float | None = None  # [s] of X; None before the first call
        self._force: Array | None = None  # (3,) [m/s^2] of the last reading
        self.read = 0.0  # [s] of it
        self._gravity = gravity
        self.variances = np.repeat(np.square(trusted(deviations)), 3)
        """variances (6,) [rad^2/s^2, m^2/s^4] that a reading is used with"""

    def propagate(self, t: float, reading: Array) -> None:
        """Propagate to t [s] by a reading (6,) of the IMU there; the first one only sets the time and the rate."""
        gyro, force = reading[:3] - self.bias[:3], reading[3:] - self.bias[3:]
        dt, rate = 0.0 if self.t is None else t - self.t, 0.5 * (self.rate + gyro)
        self.t, self.rate, self._force, self.read = t, gyro.copy(), force.copy(), t
        if dt > TIME_TOLERANCE:
            self._move(rate, force, dt, self.variances)

    def read_with(self, variances: Array, harm: Array | None) -> None:
        """Use readings with ``variances`` (6,) from now on; ``harm`` (6,) [rad^2, m^2/s^2] are those of the turn and of
        the velocity that earlier ones may have caused beyond what is counted.
        """
        self.variances = variances
        if harm is not None:
            self.P[TURN, TURN] += np.diag(harm[:3])
            self.P[SPEED, SPEED] += np.diag(harm[3:])

    def propagate_by(self, t: float, gyro: Array, force: Array, variance: float) -> None:
        """Propagate to t [s] > ``t`` by the gyro (3,) alone and a specific force (3,) that no accelerometer reads.

        ``variance`` [m^2/s^4] is that of a component of its mean.
        """
        assert self.t is not None
        dt, own = t - self.t, gyro - self.bias[:3]
        rate = 0.5 * (self.rate + own)
        self.t, self.rate, self._force, self.read = t, own, force.copy(), t
        self._move(rate, force, dt, np.concatenate([self.variances[:3], np.full(3, variance)]), read=slice(0, 3))

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
            dt, since, until = end - self.t, self.t - self.read, end - self.read
            # Of the velocity that a walk of intensity q gathers, in the mean over dt: q (until^3 - since^3) / (3 dt^2).
            walked = (until**3 - since**3) / (3.0 * dt * dt * _CHANGE)
            changed = walked * np.repeat((_TURN_RATE**2, acceleration_max**2), 3)
            self.t = end
            self._move(self.rate, self._force, dt, self.variances + changed)
        return True

    def _move(self, rate: Array, force: Array, dt: float, variances: Array, read: slice = slice(0, 6)) -> None:
        """Propagate over dt [s] by a rate and a specific force (3,), whose ``variances`` (6,) are of their means.

        Those of the six that are ``read`` have the biases of the IMU.
        """
        moved, A = propagation(self.X, rate, force, self._gravity, dt)
        G = np.zeros((9, 6))
        G[TURN, :3] = dt * SO3.right_jacobian(dt * rate)
        G[SPEED, 3:], G[PLACE, 3:] = dt * np.eye(3), 0.5 * dt * dt * np.eye(3)
        noise, biased = G * variances @ G.T, np.zeros_like(G)
        biased[:, read] = G[:, read]
        self.carry(moved, A, noise, dt, biased)

    def carry(self, moved: Array, A: Array, noise: Array, dt: float, G: Array | None = None) -> None:
        """Go on to X = ``moved`` (5, 5) dt [s] later, with xi <- A xi and a noise of a covariance (9, 9).

        ``G`` (9, 6) is the effect of a constant error of the IMU's readings; None where none were used.
        """
        if self._walk.size:
            effect = np.zeros((9, 6)) if G is None else G
            A, own = np.block([[A, -effect], [np.zeros((6, 9)), np.eye(6)]]), noise
            noise = np.diag(np.concatenate([np.zeros(9), dt * (self._walk + self._shaken)]))
            self._shaken *= math.exp(-dt / _CALM)
            noise[:9, :9] = own
        self.X, self.P = moved, A @ self.P @ A.T + noise

    def correct(self, d: Array, P: Array) -> None:
        """Correct X and the biases by an error d (9,) or (15,), after which the covariance is P."""
        self.X, self.P = self.X @ SE23.exp(d[:9]), P
        if self._walk.size:
            self.bias = self.bias + d[BIAS]
            self.rate = self.rate - d[BIAS][:3]

    def widen(self, factor: float, *, place: bool = True) -> None:
        """Multiply the covariance by a ``factor`` >= 1 that readings show: the IMU may have come to read otherwise.

        Its biases are as unknown as that many times their declared variance, and go on changing by as much in
        ``_SHAKEN``, less and less. The attitude is no more unknown than ``_FARTHEST``. Without ``place`` the position
        stays as known as it was.
        """
        factor = min(factor, _WIDEST)
        variances = self.P.diagonal()
        scale = np.full(len(variances), math.sqrt(factor))
        scale[TURN] = max(1.0, min(scale[0], _FARTHEST / math.sqrt(variances[TURN].max())))
        if not place:
            scale[PLACE] = 1.0
        declared = WALK * self._walk
        if self._walk.size:
            known = np.maximum(variances[BIAS], 1e-30)  # one of the two may be declared to be exact
            scale[BIAS] = np.clip(np.sqrt(_WIDEST * declared / known), 1.0, scale[0])
        self.P = scale[:, None] * self.P * scale
        if self._walk.size:
            at = np.arange(BIAS.start, BIAS.stop)
            self.P[at, at] = np.maximum(self.P[at, at], factor * declared)
            self._shaken = np.maximum(self._shaken, factor * declared / _SHAKEN)

    @property
    def has_biases(self) -> bool:
        """True if the biases are states."""
        return bool(self._walk.size)

    @property
    def bias_deviation(self) -> Array:
        """Standard deviations (6,) [rad/s, m/s^2] of the biases; 0 where none is declared."""
        deviation: Array = np.sqrt(np.diag(self.P)[BIAS]) if self._walk.size else np.zeros(6)
        return deviation


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
