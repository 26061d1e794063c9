"""Patterns: inputs that depend on time alone, u(t), flown whatever is seen. They come back after a cycle."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from mathnavi.controllers.active_sensing.belief import Belief
from mathnavi.controllers.active_sensing.input_sequence import InputSequence
from mathnavi.models.unicycle.kernels import integrate
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.interfaces.signals import Array

_ROUNDING = 1e-9


class Pattern(Protocol):
    """A periodic input whose speed and turn rate are the largest at t = 0."""

    @property
    def cycle(self) -> float:
        """[s] after which the inputs come again."""
        ...

    def input_at(self, t: float) -> tuple[float, float]:
        """u [m/s, rad/s] at t [s]."""
        ...


class OpenLoop:
    """A pattern over the next ``horizon`` [s], its inputs held over the mission's periods at their middle values.

    Raises ValueError where the robot cannot drive the pattern.
    """

    def __init__(self, pattern: Pattern, mission: RangingMission, horizon: float) -> None:
        check_drivable(pattern, mission)
        self._pattern, self._period = pattern, mission.period
        self._arcs = max(1, round(horizon / mission.period))

    def drive(self, t: float, belief: Belief) -> InputSequence:
        return InputSequence(np.full(self._arcs, self._period), held(self._pattern, t, self._period, self._arcs))


def check_drivable(pattern: Pattern, mission: RangingMission) -> None:
    """ValueError where a pattern asks for more speed or turn rate than the robot has."""
    speed, turn_rate = (abs(value) for value in pattern.input_at(0.0))
    if speed > mission.speed_max * (1.0 + _ROUNDING):
        raise ValueError(f"speed = {speed!r}; allowed: at most the robot's {mission.speed_max:g} m/s")
    if turn_rate > mission.turn_rate_max * (1.0 + _ROUNDING):
        least = pattern.cycle * turn_rate / mission.turn_rate_max
        raise ValueError(
            f"cycle = {pattern.cycle!r} asks for {turn_rate:.4g} rad/s; allowed: at least {least:.4g} s, in which the "
            f"robot's {mission.turn_rate_max:g} rad/s are enough"
        )


def held(pattern: Pattern, t: float, period: float, arcs: int) -> Array:
    """(arcs, 2) inputs of a pattern from t [s] on, each held over ``period`` [s] at its value in the middle."""
    return np.array([pattern.input_at(t + (k + 0.5) * period) for k in range(arcs)])


def path(pattern: Pattern, start: Array, period: float) -> Array:
    """(n + 1, 3) poses of a cycle from a pose (3,) at t = 0, one every ``period`` [s]."""
    arcs = max(1, round(pattern.cycle / period))
    poses = np.empty((arcs + 1, 3))
    poses[0] = start
    for k, u in enumerate(held(pattern, 0.0, period, arcs)):
        poses[k + 1] = integrate(poses[k], u[0], u[1], period)
    return poses
