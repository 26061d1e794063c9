"""Estimator that takes a quadrotor's state from a sensor, in the form that planner and tracker need.

``mathnavi.estimators.full_state`` propagates the readings (13,); the estimate is x = (p, v) (6,) in the map frame, with
extra["attitude"], the unit quaternion (4,) of the body, and extra["rate"], its angular velocity (3,) [rad/s] in its own
frame. So a planner and a certificate of the point mass use it unchanged.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mathnavi.estimators.full_state import FullState, FullStateConfig
from mathnavi.interfaces.observer_properties import ObserverProperties
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.aerial.mission import EstimateQuality
from mathnavi.models.quadrotor.dynamics import ATTITUDE, POSITION, RATE, STATE_SIZE, VELOCITY
from mathnavi.models.quadrotor.mission import QuadrotorMission, QuadrotorStateSensor

_INDICES = np.arange(STATE_SIZE)
_POINT = np.concatenate([_INDICES[POSITION], _INDICES[VELOCITY]])


class QuadrotorState:
    """Estimator that passes on the newest full-state reading, split into point mass and body."""

    Config = FullStateConfig

    def __init__(self, config: FullStateConfig, mission: QuadrotorMission) -> None:
        self.period = mission.control_period
        self._whole = FullState(config, mission)

    @staticmethod
    def build(config: FullStateConfig, mission: QuadrotorMission) -> QuadrotorState:
        """Build the estimator of one run."""
        return QuadrotorState(config, mission)

    @staticmethod
    def sensors(config: FullStateConfig, mission: QuadrotorMission) -> tuple[QuadrotorStateSensor, ...]:
        """Sensors that the vehicle has to carry for this estimator."""
        return (mission.full_state_sensor(config.rate),)

    @staticmethod
    def quality(config: FullStateConfig, mission: QuadrotorMission) -> EstimateQuality:
        """Quality of the readings, as the mission states it."""
        return mission.full_state_quality(config.rate, config.timeout)

    @staticmethod
    def properties(config: FullStateConfig) -> ObserverProperties:
        """Properties of the readings, Table 2.1."""
        return FullState.properties(config)

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate of the point mass (6,) [m, m/s] at t [s]; ``command`` (4,) [N] was held since the last call.

        ``extra`` has the ``attitude`` (4,) and the ``rate`` (3,) [rad/s] of the body, and counts the readings that were
        not used.
        """
        whole = self._whole.update(t, measurements, command)
        covariance = None if whole.covariance is None else whole.covariance[np.ix_(_POINT, _POINT)]
        extra = {"attitude": whole.x[ATTITUDE].copy(), "rate": whole.x[RATE].copy(), **whole.extra}
        return Estimate(t, whole.x[_POINT], covariance, whole.status, extra, whole.message)
