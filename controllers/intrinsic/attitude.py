"""The plug-in ``attitude_tracking``: a rigid body follows a reference attitude, intrinsically on S^3."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import numpy as np

from mathnavi.controllers.intrinsic.law import IntrinsicTracker, ReferencePlanner, TrackingGains
from mathnavi.interfaces.angles import Radians
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.attitude import Attitude
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.mechanism.geometry import MechanismManifold

_FASTEST = 100.0  # [rad/s]
_RATIOS = np.array([1.0, 0.8, 0.6])  # of the frequencies about the axes of the body
_PHASES = np.array([0.0, 2.0, 4.0])  # [rad]


@configuration
class AttitudeTrackingConfig:
    """Fields of ``--planner``."""

    k_p: Positive = 9.0
    """gain of the attitude error [1/s^2]"""
    k_d: Positive = 6.0
    """gain of the rate error [1/s]"""
    rate: Annotated[float, Radians(0.0, _FASTEST, unit="rad/s")] = 1.0
    """largest rate of the reference about each axis [rad/s]; 0: it stays at the attitude (1, 0, 0, 0)"""
    frequency: Annotated[float, Radians(0.0, _FASTEST, open_low=True, unit="rad/s")] = 1.5
    """frequency at which the rate about the first axis oscillates [rad/s]"""


class AttitudeTracking:
    """A rigid body follows a reference attitude, intrinsically on S^3."""

    Config = AttitudeTrackingConfig

    @staticmethod
    def build(config: AttitudeTrackingConfig, mission: LagrangianMission) -> tuple[Planner, Tracker]:
        """Return planner and tracker; PluginError for a mission whose configurations are not attitudes.

        The body may have any inertia.
        """
        manifold = mission.system.manifold
        one_ball = isinstance(manifold, MechanismManifold) and (manifold.size, manifold.dimension) == (4, 3)
        if not (isinstance(manifold, Attitude) or one_ball):
            raise PluginError(
                f"controller = attitude_tracking on {manifold.name}; allowed: on {Attitude.name} or one ball joint"
            )
        christoffel = manifold.christoffel if isinstance(manifold, MechanismManifold) else None
        reference = AttitudeReference(config.rate, config.frequency, mission.period, christoffel)
        gains = TrackingGains(config.k_p, config.k_d)
        return ReferencePlanner(reference, mission), IntrinsicTracker(gains, mission)


class AttitudeReference:
    """omega_r = rate sin(ratio_i frequency t + phase_i), i = 1, 2, 3, from the attitude (1, 0, 0, 0) on.

    Over a period the attitude turns by the rate in the middle of it.
    """

    def __init__(
        self,
        rate: float,
        frequency: float,
        period: float,
        christoffel: Callable[[Array, Array, Array], Array] | None = None,
    ) -> None:
        """``christoffel`` Gamma(u, w) (3,) at an attitude, of a body whose inertia is not the same about every axis."""
        self._christoffel = christoffel
        self._rate, self._frequencies, self._period = rate, frequency * _RATIOS, period
        self._manifold = Attitude()
        self._attitudes = [self._manifold.origin]

    def state(self, k: int) -> Array:
        """State (7,), quaternion and body rate [rad/s], at the k-th period of the mission."""
        while len(self._attitudes) <= k:
            middle = self._omega((len(self._attitudes) - 0.5) * self._period)
            self._attitudes.append(self._manifold.exp(self._attitudes[-1], self._period * middle))
        return np.concatenate([self._attitudes[k], self._omega(k * self._period)])

    def acceleration(self, k: int) -> Array:
        """Covariant acceleration omega_r' + Gamma(omega_r, omega_r) (3,) [rad/s^2] at the k-th period.

        Gamma(omega, omega) is zero where the inertia is the same about every axis.
        """
        turned: Array = np.cos(self._frequencies * (k * self._period) + _PHASES)
        rate: Array = self._rate * self._frequencies * turned
        if self._christoffel is None:
            return rate
        state = self.state(k)
        return rate + self._christoffel(state[:4], state[4:], state[4:])

    def _omega(self, t: float) -> Array:
        omega: Array = self._rate * np.sin(self._frequencies * t + _PHASES)
        return omega
