"""Shared by the tests of range-localisation: a simple controller and estimator, and short ways."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Plan, PlanRequest, Status
from mathnavi.models.unicycle.mission import DrivePhase, RangingMission
from mathnavi.models.unicycle.patterns import figure_eight
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.range_localisation import RangeLocalisation
from mathnavi.sim.scenarios.ranging_fields import RangeLocalisationConfig


@dataclass(frozen=True)
class PatternConfig:
    """Fields of the command line."""

    speed: float = 0.5  # [m/s]
    cycle: float = 8.0  # [s]; 0: straight on


class Pattern:
    """A figure of eight, or straight on, whatever the estimate says."""

    Config = PatternConfig

    @staticmethod
    def build(config: PatternConfig, mission: RangingMission) -> tuple[PatternPlanner, PatternTracker]:
        return PatternPlanner(), PatternTracker(config, mission)


class PatternPlanner:
    """One plan that says nothing: the tracker knows the pattern."""

    period = 1.0

    def plan(self, request: PlanRequest) -> Plan:
        t = np.array([request.t_start, request.t_start + 1.0])
        return Plan(t, np.zeros((2, 3)), np.zeros((1, 2)), np.array([int(DrivePhase.OPTIMISED)]))


class PatternTracker:
    """The input in the middle of its period."""

    def __init__(self, config: PatternConfig, mission: RangingMission) -> None:
        self.period = mission.period
        self._config = config

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        config = self._config
        if config.cycle == 0.0:
            return np.array([config.speed, 0.0])
        return np.array(figure_eight(t + 0.5 * self.period, config.speed, config.cycle))


@dataclass(frozen=True)
class DeadReckonerConfig:
    """It has no fields."""


class DeadReckoner:
    """Odometry from the start that is known, the centre where none is."""

    Config = DeadReckonerConfig

    @staticmethod
    def build(config: DeadReckonerConfig, mission: RangingMission) -> Reckoning:
        return Reckoning(mission)

    @staticmethod
    def sensors(config: DeadReckonerConfig, mission: RangingMission) -> tuple[Sensor, ...]:
        return mission.sensors_carried()

    @staticmethod
    def quality(config: DeadReckonerConfig, mission: RangingMission) -> None:
        return None


class Reckoning:
    """x after each reading of the odometry."""

    def __init__(self, mission: RangingMission) -> None:
        self.period = mission.period
        self._mission, self._x = mission, mission.start_pose

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        for measurement in measurements:
            if measurement.name == "odometry":
                self._x = self._mission.flow(self._x, measurement.value, self.period)
        status = Status.OK if measurements else Status.INITIALISING
        return Estimate(t, self._x.copy(), 0.01 * np.eye(3), status)


def run(
    seed: int = 0, controller: PluginSpec | None = None, estimator: PluginSpec | None = None, **fields: Any
) -> RunData:
    """A run of ``Pattern`` and ``DeadReckoner`` unless others are given."""
    config = RangeLocalisationConfig(**fields)
    return RangeLocalisation.build(
        config, seed, controller or PluginSpec.with_fields(Pattern), estimator or PluginSpec.with_fields(DeadReckoner)
    ).run()
