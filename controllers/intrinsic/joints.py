"""The plug-in ``joint_tracking``: a mechanism's joints oscillate, each at a different frequency."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from mathnavi.controllers.intrinsic.law import IntrinsicTracker, ReferencePlanner, TrackingGains
from mathnavi.interfaces.angles import Radians
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.mechanism.geometry import MechanismManifold
from mathnavi.models.mechanism.system import MechanismSystem

_FASTEST = 100.0  # [rad/s]
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

        PluginError for a mission of another kind, with ball joints, or with fewer motors than joints.
        """
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
