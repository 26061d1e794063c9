"""The plug-in ``attitude_iekf``: the invariant extended Kalman filter on SO(3) of a body without a gyro.

    R' = R omega^,   omega' = F(R, omega, u) + w,   y = R Exp(n),   n of variance sigma^2 about each axis.

The attitude's error is left-invariant, R = R^ Exp(xi), and the rate's is that of its components in the body's own axes.
A reading is then linear, nu = Log(R^' y) = xi + n to first order whatever R^ is, and over h, in which the estimate
turns by Log(R^' R^+) = theta,

    xi <- Exp(-theta) xi + h J_r(theta) domega,    domega <- the derivative of the flow's rate by xi and omega,

the latter by differences: the attitude itself appears there through the forces alone, of a body with the same inertia
about every axis not at all, so that the propagation does not depend on it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.invariant.conditioning import condition
from mathnavi.estimators.invariant.lie_groups import SO3
from mathnavi.estimators.velocity.error_state import filter_properties
from mathnavi.estimators.velocity.position_observer import PositionObserver
from mathnavi.estimators.velocity.readings import OutlierCounter, innovation, reading_variance
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.sim.interfaces.bounds import Positive, Probability, configuration
from mathnavi.sim.interfaces.errors import FieldError
from mathnavi.sim.interfaces.observer_properties import ObserverProperties
from mathnavi.sim.interfaces.protocols import Sensor
from mathnavi.sim.interfaces.signals import Array

_N = 3
_STEP = 1e-6  # [rad, rad/s] of a difference


@configuration
class AttitudeIekfConfig:
    """Fields of ``--estimator``."""

    acceleration: Positive = 0.1
    """square root of the density of the angular acceleration that the model lacks, about each axis [rad/s^1.5]"""
    noise_floor: Positive = 1e-4
    """least standard deviation that a reading is trusted with [rad]"""
    gate: Probability = 1e-4
    """probability with which a good reading is refused"""
    timeout: Positive = 0.5
    """without a reading after which the estimate is lost [s]"""


class AttitudeIekf:
    """The invariant extended Kalman filter of a body's attitude and rate."""

    Config = AttitudeIekfConfig

    @staticmethod
    def build(config: AttitudeIekfConfig, mission: LagrangianMission) -> PositionObserver:
        """Build the estimator of one run.

        Raises FieldError for a system that is not one body that turns.
        """
        return PositionObserver(_AttitudeFilter(config, mission), mission, config.timeout)

    @staticmethod
    def sensors(config: AttitudeIekfConfig, mission: LagrangianMission) -> tuple[Sensor, ...]:
        """Sensors that the system has to carry for this estimator."""
        return (mission.sensor,)

    @staticmethod
    def quality(config: AttitudeIekfConfig, mission: LagrangianMission) -> None:
        """Nothing is certified from it."""

    @staticmethod
    def properties(config: AttitudeIekfConfig) -> ObserverProperties:
        """Table 2.1."""
        return filter_properties("as far as the linearisation holds, that of the forces and of a reading")


class _AttitudeFilter:
    """A ``VelocityLaw``; ``deviation`` (6,) are standard deviations of (xi, omega), ``nis`` (2,) nu' S^-1 nu and 3."""

    def __init__(self, config: AttitudeIekfConfig, mission: LagrangianMission) -> None:
        manifold = mission.system.manifold
        if (manifold.size, manifold.vector_size, manifold.dimension) != (4, _N, _N):
            raise FieldError(f"system = one on {manifold.name}; allowed: a body that turns, its attitude a quaternion")
        self._config, self._mission, self._system, self._manifold = config, mission, mission.system, manifold
        self._limit = float(chdtri(_N, config.gate))
        self._P = np.full((2 * _N, 2 * _N), np.nan)
        self._nis = math.nan

    @property
    def state(self) -> Array:
        """State (7,), quaternion and body rate."""
        return self._state

    @property
    def extra(self) -> Mapping[str, Array]:
        """Standard ``deviation`` (6,) [rad, rad/s] of the error and ``nis`` (2,)."""
        return {
            "deviation": np.sqrt(np.diag(self._P)),
            "nis": np.array([self._nis, math.nan if math.isnan(self._nis) else float(_N)]),
        }

    def start(self, y: Array) -> None:
        """Start at a first reading y (4,), with its P and that of a rate as great as the mission's maximum."""
        manifold = self._manifold
        self._state = np.concatenate([y, np.zeros(_N)])
        self._R = np.diag(np.maximum(reading_variance(self._mission, y), self._config.noise_floor**2))
        lengths = np.array([manifold.norm(y, axis) for axis in np.eye(_N)])
        self._P = np.diag(np.concatenate([np.diag(self._R), np.square(self._mission.speed_max / lengths)]))
        self._outlier_counter, self._nis = OutlierCounter(), math.nan

    def predict(self, h: float, u: Array, y: Array | None) -> None:
        """Predict over h [s] with the input u (nu,) held.

        Raises CutLocusError where the body turns by half a turn or more.
        """
        before = self._state
        self._state = self._system.flow(before, u, h)
        theta = self._manifold.coordinates(before[:4], self._state[:4])
        A = np.vstack([np.hstack([SO3.exp(-theta), h * SO3.right_jacobian(theta)]), self._rate_slope(before, u, h)])
        self._P = _symmetric(A @ self._P @ A.T + self._process(h))
        self._nis = math.nan

    def correct(self, y: Array, h: float) -> bool:
        """Condition on a reading y (4,), h [s] after the last that was used; True if it was used."""
        nu = innovation(self._manifold, self._state[:4], y)
        if nu is None:
            if not self._outlier_counter.admits(False):
                return False
            self.start(y)
            return True
        d, P, self._nis = condition(self._P, np.eye(_N, 2 * _N), nu, self._R)
        if not self._outlier_counter.admits(self._nis <= self._limit):
            return False
        self._P = P
        self._state = np.concatenate([self._manifold.point(self._state[:4], d[:_N]), self._state[4:] + d[_N:]])
        return True

    def _rate_slope(self, before: Array, u: Array, h: float) -> Array:
        """Derivative (3, 6) of the rate after h [s] by the error (xi, omega) before, by one-sided differences."""
        x, v = before[:4], before[4:]
        steps = _STEP * np.eye(_N)
        moved = [np.concatenate([self._manifold.point(x, e), v]) for e in steps]
        moved += [np.concatenate([x, v + e]) for e in steps]
        slope: Array = np.column_stack([self._system.flow(each, u, h)[4:] - self._state[4:] for each in moved]) / _STEP
        return slope

    def _process(self, h: float) -> Array:
        """Q (6, 6) of h [s]."""
        block = np.array([[h**3 / 3.0, h**2 / 2.0], [h**2 / 2.0, h]])
        return self._config.acceleration**2 * np.kron(block, np.eye(_N))


def _symmetric(P: Array) -> Array:
    half: Array = 0.5 * (P + P.T)
    return half
