"""A scenario as a task for whoever commands its actuators in the place of planner and tracker.

Of a step of the loop from one look to the next, with the commands u held, a task tells the *stage cost* int L dt: what
its mission is judged by, or optimised for, of which the scenario's module tells the equation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mathnavi.sim.interfaces.signals import Array, Estimate


@dataclass(frozen=True, eq=False)
class Inputs:
    """What is commanded of one vehicle."""

    names: tuple[str, ...]  # (nu,) name and unit of each, "thrust [N]" for one
    low: Array  # (nu,) -inf where there is no bound
    high: Array  # (nu,)

    @staticmethod
    def within(names: tuple[str, ...], limits: float | Array = np.inf) -> Inputs:
        """Inputs of at most these magnitudes, one for all or (nu,)."""
        high = np.broadcast_to(np.asarray(limits, dtype=np.float64), len(names)).copy()
        return Inputs(names, -high, high)


@dataclass(frozen=True)
class Look:
    """What is the case when the loop looks; by vehicle."""

    t: float  # [s]
    truths: Mapping[str, Array]  # (nx,)
    estimates: Mapping[str, Estimate]


StageCost = Callable[[Look, Look, Mapping[str, Array]], float]
"""(a look, the next, the commands (nu,) in between by vehicle) -> the integral of the stage cost"""


@dataclass(frozen=True)
class Task:
    """What whoever commands the actuators is told and judged by."""

    inputs: Mapping[str, Inputs]  # by vehicle
    cost: StageCost
    told: tuple[str, ...] = ()  # of an estimate's ``extra``, what the vehicle cannot be commanded without
    mission: Mapping[str, Any] = field(default_factory=dict)  # fields that keep what was drawn of the mission


def squared_error(vehicle: str, error: Callable[[Array, Array], Array]) -> StageCost:
    """L = |e|^2 with e = ``error(estimate, truth)`` of one vehicle, taken at the end of a step.

    So the root mean square of e over an episode of T [s] is the root of its whole cost over T.
    """

    def cost(begin: Look, end: Look, commands: Mapping[str, Array]) -> float:
        off = error(end.estimates[vehicle].x, end.truths[vehicle])
        return float(off @ off) * (end.t - begin.t)

    return cost
