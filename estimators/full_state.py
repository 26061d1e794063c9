"""The state as a sensor reads it: the estimator of a simulation that is not about estimating.

The newest reading of the sensor "full_state" is the estimate. Between readings the vehicle's exact motion under the
held input carries it on (thesis A.2); what the gusts do meanwhile stays unknown and widens the covariance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.aerial.dynamics import flow
from models.aerial.mission import EstimateQuality, FlightMission
from models.aerial.sensors import FullStateSensor
from sim.signals import Array, Estimate, Measurement, Status

_SIMULTANEOUS = 1e-9  # [s]


@dataclass(frozen=True)
class FullStateConfig:
    """Fields of the command line."""

    rate: float | None = None  # [Hz] of the readings; that of the estimates if not given
    timeout: float = 0.5  # [s] without a reading after which the estimate is lost

    def __post_init__(self) -> None:
        for field in ("rate", "timeout"):
            value = getattr(self, field)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{field} = {value!r}; allowed: a finite value > 0")


class FullState:
    """Hands the newest full-state reading on."""

    Config = FullStateConfig

    def __init__(self, config: FullStateConfig, mission: FlightMission) -> None:
        self.period = mission.control_period
        self._timeout = config.timeout
        self._position_variance = mission.position_noise**2  # [m^2]
        self._gust_rms = mission.gust.rms  # [m/s^2]
        self._fresh = self._covariance(0.0)  # of a reading that is not old
        self._x = np.array([*mission.start, 0.0, 0.0, 0.0])
        self._t = -math.inf  # [s] of _x
        self._t_read = -math.inf  # [s] of the last reading

    @staticmethod
    def build(config: FullStateConfig, mission: FlightMission) -> FullState:
        return FullState(config, mission)

    @staticmethod
    def sensors(config: FullStateConfig, mission: FlightMission) -> tuple[FullStateSensor, ...]:
        """What the vehicle has to carry for this estimator."""
        return (FullStateSensor(mission.position_noise, config.rate),)

    @staticmethod
    def quality(config: FullStateConfig, mission: FlightMission) -> EstimateQuality:
        """Positions are off by the mission's noise, independently of each other; only the gusts drive the loop."""
        return EstimateQuality(
            np.diag([mission.position_noise**2, 0.0, 0.0]), EstimateQuality.exact(mission.gust).driving
        )

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        for reading in measurements:
            if reading.name == "full_state" and reading.t > self._t_read:
                self._x, self._t, self._t_read = reading.value, reading.t, reading.t
        if self._t == -math.inf:
            self._t = t  # the start, as the mission states it, is all that is known
        if t > self._t:
            self._x, self._t = flow(self._x, command, t - self._t), t
        if self._t_read == -math.inf:
            return Estimate(t, self._x.copy(), status=Status.INITIALISING)
        age = t - self._t_read
        status = Status.OK if age <= self._timeout + _SIMULTANEOUS else Status.LOST
        return Estimate(t, self._x.copy(), self._covariance(age) if age > 0.0 else self._fresh, status)

    def _covariance(self, age: float) -> Array:
        """(6, 6) when the last reading is ``age`` [s] old; a gust that stays as it is bounds every other one."""
        effect = self._gust_rms * np.array([0.5 * age * age, age])  # on position [m] and velocity [m/s]
        axis = np.outer(effect, effect)
        axis[0, 0] += self._position_variance
        return _three_axes(axis)


def _three_axes(axis: Array) -> Array:
    """(6, 6) covariance of (p, v) from the (2, 2) covariance that each of the three axes has by itself."""
    covariance: Array = np.einsum("ij,kl->ikjl", axis, np.eye(3)).reshape(6, 6)
    return covariance
