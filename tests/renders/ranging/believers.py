"""Estimators for the pictures: they dead-reckon from the known start, and add what is asked.

With an exact start and faultless wheels the reckoning is the truth, so a test knows where everything has to be drawn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.ranging_fields import RangingNoise
from tests.localisation import Reckoning, run

SILENT = 0.1  # [s] at first
FIRST_ERROR = np.array([-1.2, 0.6, 1.0])  # [m, m, rad] at first
CALM = 0.3  # [s] in which that falls to a third
START = (1.8, -0.4, 60.0)  # [m, m, deg]
ELSEWHERE = np.array([[-2.4, 0.3, 1.0], [-1.3, 0.6, 0.0], [-0.5, -0.8, 0.0]])  # the other hypotheses
LOSS = np.array([6.0, 12.0, 24.0])  # [1/s] of their log-likelihoods
LOWEST = -20.0  # at which they are dropped


@dataclass(frozen=True)
class BelieverConfig:
    """Fields of the command line."""

    kind: Literal["bank", "observer", "bare", "silent"] = "bank"


class Believer:
    """Dead reckoning that is off at first, with hypotheses, with the observer's z, or with nothing."""

    Config = BelieverConfig

    def __init__(self, config: BelieverConfig, mission: RangingMission) -> None:
        self.period = mission.period
        self._config, self._mission, self._reckoning = config, mission, Reckoning(mission)

    @staticmethod
    def build(config: BelieverConfig, mission: RangingMission) -> Believer:
        return Believer(config, mission)

    @staticmethod
    def sensors(config: BelieverConfig, mission: RangingMission) -> tuple[Sensor, ...]:
        return mission.sensors_carried()

    @staticmethod
    def quality(config: BelieverConfig, mission: RangingMission) -> None:
        return None

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        estimate = self._reckoning.update(t, measurements, command)
        if self._config.kind == "silent":
            raise RuntimeError("it does not know")
        error = math.exp(-t / CALM)
        x = estimate.x + error * FIRST_ERROR
        status = Status.INITIALISING if t < SILENT - 1e-9 else Status.OK
        estimate = replace(estimate, x=x, covariance=None, status=status)
        if self._config.kind == "bank":
            return replace(estimate, extra=self._bank(t, x, error))
        if self._config.kind == "observer":
            _, s = self._mission.curve.ranges(x, self._mission.alpha)
            return replace(estimate, extra={"z": np.append(s, x[2]), "value": np.array([error, 0.5 * error])})
        return estimate

    def _bank(self, t: float, x: Array, error: float) -> dict[str, Array]:
        scores = np.append(0.0, -LOSS * t)
        scores[scores < LOWEST] = np.nan
        hypotheses = np.vstack([x, ELSEWHERE])
        hypotheses[np.isnan(scores)] = np.nan
        covariance = np.diag([0.3, 0.1, 0.2]) ** 2 * error + 1e-4 * np.eye(3)
        return {"hypotheses": hypotheses, "scores": scores, "nis": np.array([2.0, 2.0]), "covariance": covariance}


def believed(kind: str = "bank", duration: float = 4.0, **fields: object) -> RunData:
    """A run with faultless wheels from a start that is known exactly."""
    noise = RangingNoise(odometry_noise=(0.0, 0.0), odometry_bias=0.0, dropout=0.1)
    start = {"start": START, "start_known": True, "start_error": (0.0, 0.0, 0.0)}
    return run(
        estimator=PluginSpec.with_fields(Believer, kind=kind), duration=duration, **{"noise": noise, **start, **fields}
    )
