"""A scenario as a task for whoever commands its actuators in the place of planner and tracker.

Over a control step, from one sample of the loop to the next with the commands u held, a task states the *stage cost*
int L dt: what its mission is evaluated by, or optimised for. The scenario's module has the equation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from mathnavi.controllers.flight.command_filter import FilteredCommand
from mathnavi.sim.interfaces.signals import Array, Estimate


@dataclass(frozen=True, eq=False)
class Inputs:
    """Inputs of one vehicle, with their bounds."""

    names: tuple[str, ...]  # (nu,) name and unit of each, "thrust [N]" for one
    low: Array  # (nu,) -inf where there is no bound
    high: Array  # (nu,)

    @staticmethod
    def within(names: tuple[str, ...], limits: float | Array = np.inf) -> Inputs:
        """Inputs of at most these magnitudes, one for all or (nu,)."""
        high = np.broadcast_to(np.asarray(limits, dtype=np.float64), len(names)).copy()
        return Inputs(names, -high, high)


@dataclass(frozen=True)
class Sample:
    """The loop at one instant; states by vehicle."""

    t: float  # [s]
    truths: Mapping[str, Array]  # (nx,)
    estimates: Mapping[str, Estimate]


class SafetyFilter(Protocol):
    """Filter of the commands to one vehicle."""

    hold: float  # [s] for which a proposed command is held, a whole number of the tracker's periods

    def step(self, t: float, estimate: Estimate, proposed: Array) -> FilteredCommand:
        """The input (nu,) to hold for the tracker's period from t [s] on, in place of a proposed command."""
        ...


StageCost = Callable[[Sample, Sample, Mapping[str, Array]], float]
"""(a sample, the next, the commands (nu,) in between by vehicle) -> the integral of the stage cost"""


@dataclass(frozen=True)
class Task:
    """Inputs, observations and cost for whoever commands the actuators."""

    inputs: Mapping[str, Inputs]  # by vehicle
    cost: StageCost
    observed: tuple[str, ...] = ()  # of an estimate's ``extra``, what the vehicle cannot be commanded without
    mission: Mapping[str, Any] = field(default_factory=dict)  # fields that keep what was drawn of the mission
    filters: Callable[[], Mapping[str, SafetyFilter]] | None = None  # makes one for each vehicle
    proposals: Mapping[str, Inputs] = field(default_factory=dict)  # to these, by vehicle


def squared_error(vehicle: str, error: Callable[[Array, Array], Array]) -> StageCost:
    """L = |e|^2 with e = ``error(estimate, truth)`` of one vehicle, taken at the end of a step.

    So the root mean square of e over an episode of T [s] is the root of its whole cost over T.
    """

    def cost(begin: Sample, end: Sample, commands: Mapping[str, Array]) -> float:
        e = error(end.estimates[vehicle].x, end.truths[vehicle])
        return float(e @ e) * (end.t - begin.t)

    return cost
