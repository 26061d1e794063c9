"""Exploration policies: inputs under which the estimator learns, by pattern or by choice (``--planner.mode``).

A pattern is an input u(t) that depends on time alone and repeats after a cycle; ``PatternPolicy`` drives it without
regard to observations. ``candidate_search`` holds the policy that chooses.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mathnavi.controllers.active_sensing.belief import Belief
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.unicycle import patterns
from mathnavi.models.unicycle.kernels import integrate
from mathnavi.models.unicycle.mission import DrivePhase, RangingMission

_ROUNDING = 1e-9


@dataclass(frozen=True)
class InputSequence:
    """Inputs that are held one after the other; after the last the robot rests."""

    duration: Array  # (K,) [s] > 0
    u: Array  # (K, 2) [m/s, rad/s]
    phase: DrivePhase = DrivePhase.OPTIMISED
    cost: float = math.nan  # of the choice, in the policy's own terms
    note: str = ""  # the kind of an event to record whenever it begins
    message: str = ""  # of that event

    def plan(self, t: float, pose: Array, solve_ms: float) -> Plan:
        """Return the plan from a pose (3,) at t [s] on, to rest."""
        times = t + np.concatenate([[0.0], np.cumsum(self.duration)])
        x = np.empty((len(self.u) + 1, 3))
        x[0] = pose
        for k, u in enumerate(self.u):
            x[k + 1] = integrate(x[k], u[0], u[1], float(self.duration[k]))
        phase = np.full(len(self.u), int(self.phase), np.int64)
        return Plan(times, x, self.u, phase, cost=self.cost, solve_ms=solve_ms)


class ExplorationPolicy(Protocol):
    """Chooses inputs under which the estimator learns."""

    def choose(self, t: float, belief: Belief) -> InputSequence:
        """Return the inputs from t [s] on, given the belief of the pose then."""
        ...


class Pattern(Protocol):
    """A periodic input whose speed and turn rate are the largest at t = 0."""

    @property
    def cycle(self) -> float:
        """Period of the inputs [s]."""
        ...

    def input_at(self, t: float) -> tuple[float, float]:
        """Input u [m/s, rad/s] at t [s]."""
        ...


@dataclass(frozen=True)
class FigureEight:
    """A figure of eight, 0.375 speed x cycle long and 0.139 wide: the heading swings, so ranges rise and fall."""

    speed: float  # [m/s]
    cycle: float  # [s] once through

    def input_at(self, t: float) -> tuple[float, float]:
        return patterns.figure_eight(t, self.speed, self.cycle)


@dataclass(frozen=True)
class Circle:
    """A circle to the left of radius speed x cycle / (2 pi), at constant speed and turn rate."""

    speed: float  # [m/s]
    cycle: float  # [s] once around

    def input_at(self, t: float) -> tuple[float, float]:
        return patterns.circle(t, self.speed, 2.0 * math.pi / self.cycle)


@dataclass(frozen=True)
class Straight:
    """A line, speed x cycle / 2 long, forth and back without turning."""

    speed: float  # [m/s]
    cycle: float  # [s] forth and back

    def input_at(self, t: float) -> tuple[float, float]:
        return patterns.straight(t, self.speed, self.cycle)


@dataclass(frozen=True)
class Still:
    """No motion, u = 0, under which two sensors or fewer do not determine the pose."""

    cycle: float = 1.0  # [s]

    def input_at(self, t: float) -> tuple[float, float]:
        return 0.0, 0.0


class PatternPolicy:
    """A pattern over the next ``horizon`` [s], its inputs held over the mission's periods at their middle values.

    Raises FieldError where the robot cannot drive the pattern.
    """

    def __init__(self, pattern: Pattern, mission: RangingMission, horizon: float) -> None:
        check_drivable(pattern, mission)
        self._pattern, self._period = pattern, mission.period
        self._arcs = max(1, round(horizon / mission.period))

    def choose(self, t: float, belief: Belief) -> InputSequence:
        inputs = sampled(self._pattern, t, self._period, self._arcs)
        return InputSequence(np.full(self._arcs, self._period), inputs)


def check_drivable(pattern: Pattern, mission: RangingMission) -> None:
    """Raise FieldError where a pattern needs more speed or turn rate than the robot has."""
    speed, turn_rate = (abs(value) for value in pattern.input_at(0.0))
    if speed > mission.speed_max * (1.0 + _ROUNDING):
        raise FieldError(f"speed = {speed!r}; allowed: at most the robot's {mission.speed_max:g} m/s")
    if turn_rate > mission.turn_rate_max * (1.0 + _ROUNDING):
        least = pattern.cycle * turn_rate / mission.turn_rate_max
        raise FieldError(
            f"cycle = {pattern.cycle!r} needs {turn_rate:.4g} rad/s; allowed: at least {least:.4g} s, in which the "
            f"robot's {mission.turn_rate_max:g} rad/s are enough"
        )


def sampled(pattern: Pattern, t: float, period: float, arcs: int) -> Array:
    """Inputs (arcs, 2) of a pattern from t [s] on, each held over ``period`` [s] at its value in the middle."""
    return np.array([pattern.input_at(t + (k + 0.5) * period) for k in range(arcs)])


def path(pattern: Pattern, start: Array, period: float) -> Array:
    """Poses (n + 1, 3) of a cycle from a pose (3,) at t = 0, one every ``period`` [s]."""
    arcs = max(1, round(pattern.cycle / period))
    poses = np.empty((arcs + 1, 3))
    poses[0] = start
    for k, u in enumerate(sampled(pattern, 0.0, period, arcs)):
        poses[k + 1] = integrate(poses[k], u[0], u[1], period)
    return poses
