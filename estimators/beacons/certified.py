"""The plug-in ``beacon_certified``: ``beacon_bank``, which is OK only while its pose is certified (``certificate``).

    INITIALISING   until the pose was certified once, if the start is not known
    DEGRADED       while the last ranges do not certify the pose: another pose explains them too, or none does

besides what ``beacon_bank`` says of its readings. Two beacons do not tell a straight drive from its mirror image about
the line through them, nor one beacon a drive from one about it: such poses are listed.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import field
from typing import ClassVar

import numpy as np

from mathnavi.estimators.beacons.certificate import BeaconCertificate, BeaconCertificateConfig, BeaconCertification
from mathnavi.estimators.beacons.filter import BeaconBankConfig, BeaconFilter
from mathnavi.estimators.integrity.guard import Guarded
from mathnavi.estimators.ranging.pose_certificate import MOST_OTHERS
from mathnavi.estimators.timeout_monitor import worst
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.observer_properties import ObserverProperties
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.unicycle.beacons import BeaconFieldMission, BeaconMission, BeaconQuality, beacons_of

_BANK = BeaconBankConfig()


@configuration
class BeaconCertifiedConfig:
    """Fields of the command line."""

    kernels: ClassVar[str] = "mathnavi.estimators.beacons.ahead"  # compiled before the first run

    every: Positive = 1.0
    """time between two certificates [s]"""
    timeout: Positive = 5.0
    """time without a beacon after which the estimate is lost, and without odometry after which it is degraded [s]"""
    certificate: BeaconCertificateConfig = field(default_factory=BeaconCertificateConfig)


class BeaconCertified:
    """Estimator of the pose from beacons that is OK only if no other pose explains the last ranges."""

    Config = BeaconCertifiedConfig

    def __init__(self, config: BeaconCertifiedConfig, mission: BeaconMission) -> None:
        self._bank = BeaconFilter.build(BeaconBankConfig(timeout=config.timeout), mission)
        self._every = config.every
        self.period, self.figures = self._bank.period, self._bank.figures
        self._certificate = BeaconCertificate(config.certificate, mission)
        self._found: BeaconCertification | None = None
        self._located = mission.start is not None
        self._due = -math.inf  # [s] of the next certificate

    @staticmethod
    def build(config: BeaconCertifiedConfig, mission: BeaconMission | BeaconFieldMission) -> BeaconCertified:
        """Build the estimator of one run. Raises MissionError without ranges, and for beacons at unknown places."""
        known = beacons_of(mission)
        if known.unknown:
            raise MissionError(f"beacons = {known.beacons!r} with beacon_certified; allowed: places that are known")
        if known.ranges is None:
            raise MissionError("beacon_certified without ranges to beacons; allowed: a mission with `ranges`")
        return BeaconCertified(config, known)

    @staticmethod
    def sensors(config: BeaconCertifiedConfig, mission: BeaconMission | BeaconFieldMission) -> tuple[Sensor, ...]:
        """Sensors that the robot has to carry for this estimator."""
        return BeaconFilter.sensors(_BANK, mission)

    @staticmethod
    def quality(config: BeaconCertifiedConfig, mission: BeaconMission | BeaconFieldMission) -> BeaconQuality:
        """Declared quality of the first kind of readings."""
        return BeaconFilter.quality(_BANK, mission)

    @staticmethod
    def properties(config: BeaconCertifiedConfig) -> ObserverProperties:
        """Properties (Table 2.1): those of ``beacon_bank``, which has settled by the time it is certified."""
        return dataclasses.replace(BeaconFilter.properties(_BANK), stays_on_truth=True)

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (3,) [m, m, rad] of ``beacon_bank`` at t [s]; ``command`` (2,) replaces odometry that there never
        was.

        In addition to its arrays ``extra`` has those of the last certificate: ``certified`` (1,), 1 or 0, NaN while
        there is none; ``others`` (8, 3), other poses that explained the ranges, as they were then; ``bounds`` (2,) [m,
        rad] within which of the estimate every pose was that explained them, NaN if it was not certified.
        """
        estimate = self._bank.update(t, measurements, command)
        if isinstance(self._bank, Guarded):
            measurements = self._bank.without(measurements, self._bank.left_out)
        self._certificate.note(t, measurements, command)
        if not estimate.status.usable:
            self._found, self._due = None, -math.inf
            if estimate.status is Status.LOST:
                self._located = False
                self._certificate.forget()
        elif t >= self._due and self._certificate.has_enough:
            self._found = self._certificate.check(estimate.x, float(estimate.extra["scales"][2]))
            self._located, self._due = self._located or self._found.certified, t + self._every
        found, others = self._found, np.full((MOST_OTHERS, 3), np.nan)
        certified, bounds = math.nan, np.full(2, np.nan)
        if found is not None:
            certified, bounds = float(found.certified), found.bounds.copy()
            others[: len(found.others)] = found.others
        extra = {"certified": np.array([certified]), "others": others, "bounds": bounds}
        status, message = self._status(estimate)
        return dataclasses.replace(estimate, status=status, message=message, extra={**estimate.extra, **extra})

    def _status(self, estimate: Estimate) -> tuple[Status, str]:
        found = self._found
        if not estimate.status.usable or (found is not None and found.certified):
            return estimate.status, estimate.message
        said = "waits for ranges that certify its pose"
        if found is not None and len(found.others):
            said = f"{len(found.others)} other poses or more explain the last ranges too"
        elif found is not None and not found.complete:
            said = "the last ranges do not settle the pose"
        elif found is not None:
            said = "no pose explains the last ranges within their declared errors"
        return (worst(estimate.status, Status.DEGRADED) if self._located else Status.INITIALISING), said
