"""A scenario as a task for whoever commands its actuators in the place of planner and tracker.

Over a control step, from one sample of the loop to the next with the commands u held, a task states the *stage cost*
int L dt: what its mission is evaluated by, or optimised for. The scenario's module has the equation.

``LearningTerms`` are what a learner needs beside it: how an episode ends, a potential, and what is seen of the way
ahead (``mathnavi.sim.environments.learning``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from mathnavi.sim.interfaces.signals import Array, Estimate

if TYPE_CHECKING:  # it imports numba, and help and descriptions of fields do not need it
    from mathnavi.controllers.flight.command_filter import FilteredCommand


@dataclass(frozen=True, eq=False)
class Inputs:
    """Inputs of one vehicle, with their bounds."""

    names: tuple[str, ...]  # (nu,) name and unit of each, "thrust [N]" for one
    low: Array  # (nu,) -inf where there is no bound
    high: Array  # (nu,)
    usual: float = 1.0  # magnitude that a learner stays within where there is no bound

    @staticmethod
    def within(names: tuple[str, ...], limits: float | Array = np.inf) -> Inputs:
        """Inputs of at most these magnitudes, one for all or (nu,)."""
        high = np.broadcast_to(np.asarray(limits, dtype=np.float64), len(names)).copy()
        return Inputs(names, -high, high)

    @property
    def bounded(self) -> Inputs:
        """The same inputs with finite bounds."""
        low = np.where(np.isfinite(self.low), self.low, -self.usual)
        high = np.where(np.isfinite(self.high), self.high, self.usual)
        return Inputs(self.names, low, high, self.usual)


@dataclass(frozen=True)
class Sample:
    """The loop at one instant; states by vehicle."""

    t: float  # [s]
    truths: Mapping[str, Array]  # (nx,)
    estimates: Mapping[str, Estimate]


class ProposalFilter(Protocol):
    """Filter of the commands to one vehicle."""

    hold: float  # [s] for which a proposed command is held, a whole number of the tracker's periods

    def step(self, t: float, estimate: Estimate, proposed: Array) -> FilteredCommand:
        """The input (nu,) to hold for the tracker's period from t [s] on, in place of a proposed command."""
        ...


class Outcome(StrEnum):
    """End of an episode."""

    ARRIVED = "arrived"
    COMPLETED = "completed"  # of a mission without a target: the time is up
    LATE = "late"
    MISSED = "missed"  # past the target
    CRASHED = "crashed"
    OFF_MAP = "off the map"
    DIVERGED = "diverged"  # the physics has lost the state


class LearningTerms(Protocol):
    """Terms by which an episode of a mission is learnt from."""

    @property
    def cost_max(self) -> float:
        """L_max > 0: the stage cost of a second counts as this at most."""
        ...

    @property
    def deadline(self) -> float:
        """T [s], at which an episode ends at the latest."""
        ...

    @property
    def at_deadline(self) -> Outcome:
        """The outcome of an episode that lasts until the deadline."""
        ...

    @property
    def hold(self) -> float | None:
        """Time [s] for which an action is held where nothing else is asked for; None: the tracker's period."""
        ...

    def outcome(self, t: float, truths: Mapping[str, Array]) -> Outcome | None:
        """The end of the mission at t [s]; None while it goes on. ``truths`` are the states (nx,) by vehicle."""
        ...

    def potential(self, t: float, truths: Mapping[str, Array]) -> float:
        """Share of the mission's way that is left, 1 at its start and 0 at its target; 0 always without a target."""
        ...

    def violated(self, t: float, truths: Mapping[str, Array]) -> bool:
        """True where a bound of the mission is not kept: a second in this state counts as L_max."""
        ...

    def clearance(self, t: float, truths: Mapping[str, Array]) -> float | None:
        """Distance [m] of the nearest vehicle to what it may touch; None where there is nothing."""
        ...

    def view(self, t: float, name: str, estimate: Estimate) -> dict[str, Array]:
        """Observations of one vehicle by name, made from its estimate and from what is known of the mission."""
        ...


@dataclass(frozen=True)
class Endurance:
    """Terms of a mission without a target: the whole state is observed, and the time being up completes it."""

    cost_max: float
    deadline: float  # [s]
    ends: Callable[[float, Mapping[str, Array]], Outcome | None]
    margin: Callable[[Mapping[str, Array]], float] | None = None  # distance [m] to what may be touched
    at_deadline: Outcome = Outcome.COMPLETED
    hold: float | None = None  # [s]

    def outcome(self, t: float, truths: Mapping[str, Array]) -> Outcome | None:
        """End of the mission."""
        return self.ends(t, truths)

    def potential(self, t: float, truths: Mapping[str, Array]) -> float:
        """0: there is no target."""
        return 0.0

    def violated(self, t: float, truths: Mapping[str, Array]) -> bool:
        """False: there are no bounds on the state."""
        return False

    def clearance(self, t: float, truths: Mapping[str, Array]) -> float | None:
        """Distance [m] to what may be touched."""
        return None if self.margin is None else self.margin(truths)

    def view(self, t: float, name: str, estimate: Estimate) -> dict[str, Array]:
        """The estimated state."""
        return {"x": np.array(estimate.x)}


StageCost = Callable[[Sample, Sample, Mapping[str, Array]], float]
"""(a sample, the next, the commands (nu,) in between by vehicle) -> the integral of the stage cost"""


@dataclass(frozen=True)
class Task:
    """Inputs, observations and cost for whoever commands the actuators."""

    inputs: Mapping[str, Inputs]  # by vehicle
    cost: StageCost
    observed: tuple[str, ...] = ()  # of an estimate's ``extra``, what the vehicle cannot be commanded without
    mission: Mapping[str, Any] = field(default_factory=dict)  # fields that keep what was drawn of the mission
    filters: Callable[[], Mapping[str, ProposalFilter]] | None = None  # makes one for each vehicle
    proposals: Mapping[str, Inputs] = field(default_factory=dict)  # to these, by vehicle
    learning: LearningTerms | None = None  # None: no learner's terms are stated


def squared_error(vehicle: str, error: Callable[[Array, Array], Array]) -> StageCost:
    """L = |e|^2 with e = ``error(estimate, truth)`` of one vehicle, taken at the end of a step.

    So the root mean square of e over an episode of T [s] is the root of its whole cost over T.
    """

    def cost(begin: Sample, end: Sample, commands: Mapping[str, Array]) -> float:
        e = error(end.estimates[vehicle].x, end.truths[vehicle])
        return float(e @ e) * (end.t - begin.t)

    return cost
