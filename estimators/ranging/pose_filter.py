"""Common part of the extended Kalman filters of a pose: one Gaussian, conditioned on the rays of a reading.

State, motion and errors are those of ``kalman_kernels``. If the start is unknown a filter begins at the centre with the
covariance of a pose that may be anywhere.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Self

import numpy as np

from mathnavi.estimators.ranging.model import FROM_WHERE, Gate, RangeModel
from mathnavi.estimators.timeout_monitor import TimeoutMonitor
from mathnavi.interfaces.bounds import Positive, Probability, configuration
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import RangeQuality


@configuration
class PoseFilterConfig:
    """Fields of the command line."""

    gate: Probability = 1e-4
    """probability that a good range is refused"""
    timeout: Positive = 0.5
    """time without a range after which the estimate is lost [s]"""


class PoseFilter(ABC):
    """An estimator of the pose from ranges and odometry, whose errors are linearised about the estimate."""

    Config = PoseFilterConfig

    def __init__(self, config: PoseFilterConfig, mission: RangingMission) -> None:
        self.period = mission.period
        self._model, self._timeout_monitor = RangeModel(mission), TimeoutMonitor(config.timeout)
        self._gate = Gate(config.gate, mission.sensors)
        self._t: float | None = None  # [s] of the filter's state; None before the first call

    @classmethod
    def build(cls, config: PoseFilterConfig, mission: RangingMission) -> Self:
        """Build the estimator of one run."""
        return cls(config, mission)

    @staticmethod
    def sensors(config: PoseFilterConfig, mission: RangingMission) -> tuple[Sensor, ...]:
        """Sensors that the robot has to carry for this estimator."""
        return mission.sensors_carried()

    @staticmethod
    def quality(config: PoseFilterConfig, mission: RangingMission) -> RangeQuality:
        """Declared quality of the ranges."""
        return mission.ranging

    @staticmethod
    def properties(config: PoseFilterConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return ObserverProperties(
            domain_of_attraction=Domain.LOCAL,
            rate=Rate.ASYMPTOTIC,
            input_dependence=InputDependence.NON_UNIFORM,
            observer_domain=Domain.GLOBAL,
            system_domain=Domain.GLOBAL,
            note=FROM_WHERE,
        )

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (3,) [m, m, rad] at t [s]; ``command`` (2,) replaces missing odometry.

        ``extra["nis"]`` (2,) is NIS and the number of rays in it, NaN where there was no update.
        """
        rho = self._model.ranges(measurements)
        self._timeout_monitor.note(t, not np.isnan(rho).all())
        if self._t is not None and t > self._t:
            self._predict(self._model.input(measurements, command), t - self._t)
        self._t = t
        nis = self._condition(rho)
        pose, P = self._pose()
        return Estimate(t, pose, 0.5 * (P + P.T), self._timeout_monitor.status(t), {"nis": nis})

    @abstractmethod
    def _pose(self) -> tuple[Array, Array]:
        """Pose (3,) and the covariance (3, 3) of its error."""

    @abstractmethod
    def _predict(self, u: Array, dt: float) -> None:
        """Predict over dt [s] by the odometry u (2,)."""

    @abstractmethod
    def _condition(self, rho: Array) -> Array:
        """Condition on the ranges rho (l,) that were read and are within the gate; return NIS and their number (2,)."""
