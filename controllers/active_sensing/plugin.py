"""The plug-in ``active_sensing``: drives a robot with range sensors so that its estimator learns where it is."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Interval, Le

from mathnavi.controllers.active_sensing.belief import BeliefFromEstimates
from mathnavi.controllers.active_sensing.candidate_search import (
    CandidateSearch,
    Containment,
    ExpectedCovariance,
    InputCriterion,
    RandomChoice,
    SmallestSingularValue,
)
from mathnavi.controllers.active_sensing.planner import ExplorationPlanner, PathTracker
from mathnavi.controllers.active_sensing.policies import (
    Circle,
    ExplorationPolicy,
    FigureEight,
    Pattern,
    PatternPolicy,
    Still,
    Straight,
    path,
)
from mathnavi.controllers.active_sensing.then_track import ReferencePath, ThenTrack
from mathnavi.interfaces.angles import Radians
from mathnavi.interfaces.bounds import NonNegative, Positive, Seed, Within, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.mission import RangingMission

ModeName = Literal["active", "singular-value", "random", "figure-eight", "circle", "straight", "still"]
ReferenceName = Literal["none", "figure-eight", "circle"]

_LONGEST = 600.0  # [s]
_MOST_NODES = 1000
Duration = Annotated[Positive, Within(Le(_LONGEST), allowed=f"at most {_LONGEST:g} s")]  # of a cycle or a horizon
_FASTEST = 0.2  # bandwidth times control period


@configuration
class ActiveSensingConfig:
    """Fields of ``--planner``."""

    kernels: ClassVar[str] = "mathnavi.controllers.active_sensing.kernels"  # compiled before the first run

    mode: ModeName = "active"
    """exploration policy: inputs chosen by a criterion, or a pattern"""
    then: ReferenceName = "none"
    """path about the field's centre that is followed once the estimate is certain"""
    speed: Positive = 0.5
    """speed along a pattern or path [m/s]"""
    cycle: Duration = 8.0
    """duration of one cycle of a pattern or path [s]"""
    period: Positive = 0.2
    """time between two decisions [s]"""
    horizon: Duration = 1.0
    """prediction horizon of a decision [s]"""
    nodes: Annotated[int, Within(Interval(ge=1, le=_MOST_NODES), allowed=f"1 to {_MOST_NODES}")] = 10
    """number of nodes of the horizon, at which ranges are predicted and the distance to the wall is checked"""
    deviations: NonNegative = 3.0
    """number of standard deviations of the estimate that are kept from the wall in addition to the margin"""
    deviation: Positive = 0.1
    """standard deviation in every direction of an estimate without a covariance [m, rad]"""
    sure_position: Positive = 0.05
    """largest standard deviation of the position at which an estimate is certain [m]"""
    sure_heading: Annotated[float, Radians(0.0, math.pi, open_low=True)] = 0.05
    """largest standard deviation of the heading at which an estimate is certain [rad]"""
    bandwidth: Positive = 2.0
    """bandwidth of the tracker on a path [rad/s]"""
    seed: Seed = 1
    """seed of the random inputs"""

    def __post_init__(self) -> None:
        if self.period > self.horizon:
            raise FieldError(f"period = {self.period!r}; allowed: at most the horizon, {self.horizon:g} s")
        if self.then != "none" and self.mode not in CRITERIA:
            raise FieldError(
                f"then = {self.then!r} with mode = {self.mode!r}, which predicts nothing; allowed with a mode that "
                f"keeps inside: {', '.join(CRITERIA)}"
            )


PATTERNS: Mapping[str, Callable[[ActiveSensingConfig], Pattern]] = {
    "figure-eight": lambda config: FigureEight(config.speed, config.cycle),
    "circle": lambda config: Circle(config.speed, config.cycle),
    "straight": lambda config: Straight(config.speed, config.cycle),
    "still": lambda config: Still(),
}
"""Modes that drive a pattern, independent of the observations."""

CRITERIA: Mapping[str, Callable[[ActiveSensingConfig, RangingMission], InputCriterion]] = {
    "active": lambda config, mission: ExpectedCovariance(mission, config.horizon, config.nodes),
    "singular-value": lambda config, mission: SmallestSingularValue(mission),
    "random": lambda config, mission: RandomChoice(np.random.default_rng(config.seed)),
}
"""Modes that choose among inputs that keep within the wall."""


class ActiveSensing:
    """Explores until the estimate of a robot with range sensors is certain and then, if configured, follows a path."""

    Config = ActiveSensingConfig

    @staticmethod
    def build(config: ActiveSensingConfig, mission: RangingMission) -> tuple[Planner, Tracker]:
        fastest = _FASTEST / mission.period
        if config.bandwidth > fastest:
            raise FieldError(f"bandwidth = {config.bandwidth!r}; allowed: at most {fastest:g} rad/s")
        tracker = PathTracker(mission, config.bandwidth, config.speed)
        beliefs = BeliefFromEstimates(config.deviation, config.horizon)
        planner = ExplorationPlanner(exploration_policy(config, mission), _period(config, mission), beliefs)
        if config.then == "none":
            return planner, tracker
        reference = ReferencePath(PATTERNS[config.then](config), mission)
        return ThenTrack(planner, reference, config.sure_position, config.sure_heading, config.horizon), tracker

    @staticmethod
    def nominal_path(config: ActiveSensingConfig, mission: RangingMission, start: Array) -> Array:
        """Poses (n, 3) [m, m, rad] from a start (3,) without observations: a cycle of a pattern, or the start alone."""
        if config.mode in CRITERIA:
            return start[None, :]
        return path(PATTERNS[config.mode](config), start, mission.period)


def _period(config: ActiveSensingConfig, mission: RangingMission) -> float:
    """Period of the planner [s]; FieldError if it is not a whole number of the mission's periods."""
    count = round(config.period / mission.period)
    if abs(count * mission.period - config.period) > 1e-9:
        raise FieldError(
            f"period = {config.period!r}; allowed: a whole number of the robot's periods of {mission.period:g} s"
        )
    return count * mission.period


def exploration_policy(config: ActiveSensingConfig, mission: RangingMission) -> ExplorationPolicy:
    """Build the policy of a mode."""
    if config.mode in PATTERNS:
        return PatternPolicy(PATTERNS[config.mode](config), mission, config.horizon)
    containment = Containment(mission, config.horizon, config.nodes, config.deviations)
    return CandidateSearch(CRITERIA[config.mode](config, mission), containment, mission, config.horizon / config.nodes)
