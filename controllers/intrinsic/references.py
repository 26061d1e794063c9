"""Reference motions that are tracked intrinsically: the plug-ins ``attitude_tracking`` and ``joint_tracking``.

A rigid body follows a reference attitude on S^3; a mechanism's joints oscillate, each at a different frequency.
"""

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
from mathnavi.models.manifold.system import require_modelled
from mathnavi.models.mechanism.geometry import MechanismManifold
from mathnavi.models.mechanism.system import MechanismSystem

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

        The body may have any inertia. Raises FieldError for a system with parts that are not modelled.
        """
        require_modelled(mission.system, "controller = attitude_tracking", "input_signal")
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


_LARGEST = 10.0  # [rad, m]
_SHARE = 0.45  # of a joint's range
_SPREAD = 0.37  # of the frequency, by which the last joint's is above the first one's


@configuration
class JointTrackingConfig:
    """Fields of ``--planner``."""

    k_p: Positive = 100.0
    """gain of the position error [1/s^2]"""
    k_d: Positive = 20.0
    """gain of the velocity error [1/s]"""
    amplitude: Annotated[float, Radians(0.0, _LARGEST, unit="rad or m")] = 0.8
    """amplitude of every joint [rad, m]"""
    frequency: Annotated[float, Radians(0.0, _FASTEST, open_low=True, unit="rad/s")] = 2.5
    """frequency of the first joint [rad/s]; the next ones are faster"""


class JointTracking:
    """A mechanism's joints oscillate, each at a different frequency."""

    Config = JointTrackingConfig

    @staticmethod
    def build(config: JointTrackingConfig, mission: LagrangianMission) -> tuple[Planner, Tracker]:
        """Return planner and tracker.

        PluginError for a mission of another kind, with ball joints, or with fewer motors than joints; FieldError for a
        system with parts that are not modelled.
        """
        require_modelled(mission.system, "controller = joint_tracking", "input_signal")
        manifold = mission.system.manifold
        if not isinstance(manifold, MechanismManifold) or manifold.size != manifold.dimension:
            raise PluginError(
                f"controller = joint_tracking on {manifold.name}; allowed: on slides and hinges; "
                "input_signal drives any system"
            )
        system = mission.system
        ranges = system.joint_ranges if isinstance(system, MechanismSystem) else None
        reference = JointReference(config, manifold, mission.period, ranges)
        gains = TrackingGains(config.k_p, config.k_d)
        return ReferencePlanner(reference, mission), IntrinsicTracker(gains, mission)


class JointReference:
    """q_r = q_0 + amplitude sin(w_i t), from where the model has its joints at rest, as far as their limits allow.

    A joint with limits moves by at most 0.45 of its range, about the nearest place to q_0 where it has that much room.
    """

    def __init__(
        self, config: JointTrackingConfig, manifold: MechanismManifold, period: float, ranges: Array | None = None
    ) -> None:
        """``ranges`` (2, n) of the joints' positions; no limits if not given."""
        n = manifold.dimension
        self._manifold, self._period = manifold, period
        least, most = (-np.inf, np.inf) if ranges is None else ranges
        self._amplitude = np.minimum(config.amplitude, _SHARE * (most - least)) * np.ones(n)
        self._middle = np.clip(manifold.origin, least + self._amplitude, most - self._amplitude)
        self._w = config.frequency * (1.0 + _SPREAD * np.arange(n) / max(1, n - 1))

    def state(self, k: int) -> Array:
        """State (q_r, q_r') (2 n,) at the k-th period of the mission."""
        turned = self._w * (k * self._period)
        q = self._middle + self._amplitude * np.sin(turned)
        return np.concatenate([q, self._amplitude * self._w * np.cos(turned)])

    def acceleration(self, k: int) -> Array:
        """Covariant acceleration q'' + Gamma(q', q') (n,) at the k-th period."""
        n, state = self._manifold.size, self.state(k)
        connection = self._manifold.christoffel(state[:n], state[n:], state[n:])
        a: Array = connection - self._amplitude * self._w**2 * np.sin(self._w * (k * self._period))
        return a
