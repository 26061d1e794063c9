"""The plug-in ``range_certified``: another range estimator, with a certificate of its pose (``pose_certificate``)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any, Literal

import numpy as np

from mathnavi.estimators.ranging.feasible_set_bank import FeasibleSetBank
from mathnavi.estimators.ranging.pose_certificate import MOST_OTHERS, PoseCertificate, PoseCertificateConfig
from mathnavi.estimators.ranging.pose_filter import RangeEkf, RangeIekf
from mathnavi.estimators.ranging.reader import RangeReader
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.observer_properties import ObserverProperties
from mathnavi.interfaces.protocols import Estimator, Sensor
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import RangeQuality

_KINDS: Mapping[str, Any] = {"feasible_set_bank": FeasibleSetBank, "range_ekf": RangeEkf, "range_iekf": RangeIekf}


@configuration
class RangeCertifiedConfig:
    """Fields of the command line."""

    method: Literal["feasible_set_bank", "range_ekf", "range_iekf"] = "feasible_set_bank"
    """estimator whose pose is certified, with its default configuration"""
    every: Positive = 1.0
    """time between two certificates [s]"""
    certificate: PoseCertificateConfig = field(default_factory=PoseCertificateConfig)


class RangeCertified:
    """Estimator of the pose that says whether another pose explains the last readings too."""

    Config = RangeCertifiedConfig

    def __init__(self, config: RangeCertifiedConfig, mission: RangingMission) -> None:
        kind = _KINDS[config.method]
        estimated: Any = kind.Config()
        self._estimator: Estimator = kind.build(estimated, mission)
        self.period = self._estimator.period
        self._reader, self._every = RangeReader(mission, estimated.timeout), config.every
        self._certificate = PoseCertificate(config.certificate, mission)
        self._certified, self._others = math.nan, np.full((MOST_OTHERS, 3), np.nan)
        self._due = -math.inf  # [s] of the next certificate

    @staticmethod
    def build(config: RangeCertifiedConfig, mission: RangingMission) -> RangeCertified:
        """Build the estimator of one run. Raises MissionError for a map that may be off."""
        mission.check_exact("range_certified")
        return RangeCertified(config, mission)

    @staticmethod
    def sensors(config: RangeCertifiedConfig, mission: RangingMission) -> tuple[Sensor, ...]:
        """Sensors that the robot has to carry for this estimator."""
        return mission.sensors_carried()

    @staticmethod
    def quality(config: RangeCertifiedConfig, mission: RangingMission) -> RangeQuality:
        """Declared quality of the ranges."""
        return mission.ranging

    @staticmethod
    def properties(config: RangeCertifiedConfig) -> ObserverProperties:
        """Properties (Table 2.1) of the estimator whose pose is certified."""
        kind = _KINDS[config.method]
        declared: ObserverProperties = kind.properties(kind.Config())
        return declared

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (3,) [m, m, rad] of the certified estimator at t [s]; ``command`` (2,) replaces missing odometry.

        In addition to the estimator's own arrays ``extra`` has those of the last certificate: ``certified`` (1,), 1 or
        0, and ``others`` (8, 3), the other poses that explained the readings. Both are NaN until there are enough
        readings, and while the estimate is not OK. The status is the estimator's own: OK does not say that the pose is
        certified.
        """
        rho, u = self._reader.read(t, measurements, command)
        estimate = self._estimator.update(t, measurements, command)
        self._certificate.note(t, rho, u)
        if estimate.status is not Status.OK:
            self._certified, self._due = math.nan, -math.inf
            self._others[:] = np.nan
        elif t >= self._due and self._certificate.is_full:
            found = self._certificate.check(estimate.x)
            self._certified, self._due = float(found.certified), t + self._every
            self._others[:] = np.nan
            self._others[: len(found.others)] = found.others
        extra = {"certified": np.array([self._certified]), "others": self._others.copy()}
        return dataclasses.replace(estimate, extra={**estimate.extra, **extra})
