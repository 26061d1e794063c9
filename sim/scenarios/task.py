"""A scenario as a task: its actuators are commanded from outside, in place of planner and tracker.

Over a control step, from one sample of the loop to the next with the commands u held, a task states the *stage cost*
int L dt, by which its mission is evaluated or optimised. The scenario's module has the equation.

``LearningTerms`` are what a learner needs in addition: the end of an episode, a potential, and observations of the way
ahead (``mathnavi.sim.environments.learning``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from mathnavi.interfaces.signals import Array, Estimate

if TYPE_CHECKING:  # it imports numba, and help and descriptions of fields do not need it
    from mathnavi.controllers.flight.command_filter import FilteredCommand


@dataclass(frozen=True, eq=False)
class Inputs:
    """Inputs of one vehicle, with their bounds."""

    names: tuple[str, ...]  # (nu,) name and unit of each, for example "thrust [N]"
    low: Array  # (nu,) -inf without a bound
    high: Array  # (nu,)
    usual: float = 1.0  # largest magnitude that a learner uses without a bound

    @staticmethod
    def within(names: tuple[str, ...], limits: float | Array = np.inf) -> Inputs:
        """Inputs with these largest magnitudes, one for all or (nu,)."""
        high = np.broadcast_to(np.asarray(limits, dtype=np.float64), len(names)).copy()
        return Inputs(names, -high, high)

    @property
    def bounded(self) -> Inputs:
        """Same inputs with finite bounds."""
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
    """Terms with which a learner uses an episode of a mission."""

    @property
    def cost_max(self) -> float:
        """Largest stage cost L_max > 0: the cost of a second is clipped to it."""
        ...

    @property
    def deadline(self) -> float:
        """Latest end T [s] of an episode."""
        ...

    @property
    def at_deadline(self) -> Outcome:
        """Outcome of an episode that lasts until the deadline."""
        ...

    @property
    def hold(self) -> float | None:
        """Time [s] for which an action is held by default; None for the tracker's period."""
        ...

    def outcome(self, t: float, truths: Mapping[str, Array]) -> Outcome | None:
        """Outcome of the mission at t [s]; None while it goes on. ``truths`` are the states (nx,) by vehicle."""
        ...

    def potential(self, t: float, truths: Mapping[str, Array]) -> float:
        """Share of the mission's way that is left, 1 at its start and 0 at its target; always 0 without a target."""
        ...

    def violated(self, t: float, truths: Mapping[str, Array]) -> bool:
        """True if a bound of the mission is violated: a second in this state costs L_max."""
        ...

    def clearance(self, t: float, truths: Mapping[str, Array]) -> float | None:
        """Distance [m] of the nearest vehicle to any obstacle; None without obstacles."""
        ...

    def view(self, t: float, name: str, estimate: Estimate) -> dict[str, Array]:
        """Observations of one vehicle by name, from its estimate and the known mission."""
        ...


@dataclass(frozen=True)
class Endurance:
    """Learning terms of a mission without a target, which is completed when its time is up; the state is observed."""

    cost_max: float
    deadline: float  # [s]
    ends: Callable[[float, Mapping[str, Array]], Outcome | None]
    margin: Callable[[Mapping[str, Array]], float] | None = None  # distance [m] to the nearest obstacle
    at_deadline: Outcome = Outcome.COMPLETED
    hold: float | None = None  # [s]

    def outcome(self, t: float, truths: Mapping[str, Array]) -> Outcome | None:
        """Outcome of the mission at t [s]; None while it goes on."""
        return self.ends(t, truths)

    def potential(self, t: float, truths: Mapping[str, Array]) -> float:
        """Potential, which is 0: there is no target."""
        return 0.0

    def violated(self, t: float, truths: Mapping[str, Array]) -> bool:
        """False: there are no bounds on the state."""
        return False

    def clearance(self, t: float, truths: Mapping[str, Array]) -> float | None:
        """Distance [m] to the nearest obstacle; None without obstacles."""
        return None if self.margin is None else self.margin(truths)

    def view(self, t: float, name: str, estimate: Estimate) -> dict[str, Array]:
        """Observation ``x``, the estimated state."""
        return {"x": np.array(estimate.x)}


StageCost = Callable[[Sample, Sample, Mapping[str, Array]], float]
"""function (sample, next sample, commands (nu,) in between by vehicle) -> integral of the stage cost"""


@dataclass(frozen=True)
class Task:
    """Task of commanding the actuators: inputs, observations and cost."""

    inputs: Mapping[str, Inputs]  # by vehicle
    cost: StageCost
    observed: tuple[str, ...] = ()  # arrays of an estimate's ``extra`` that commanding the vehicle requires
    mission: Mapping[str, Any] = field(default_factory=dict)  # fields with the drawn values of the mission
    filters: Callable[[], Mapping[str, ProposalFilter]] | None = None  # makes a filter for each vehicle
    proposals: Mapping[str, Inputs] = field(default_factory=dict)  # inputs of these filters, by vehicle
    learning: Callable[[], LearningTerms] | None = None  # makes the terms of an episode; None: none are stated


def squared_error(vehicle: str, error: Callable[[Array, Array], Array]) -> StageCost:
    """Stage cost L = |e|^2 with e = ``error(estimate, truth)`` of one vehicle, taken at the end of a step.

    So the root mean square of e over an episode of T [s] is the root of its whole cost over T.
    """

    def cost(begin: Sample, end: Sample, commands: Mapping[str, Array]) -> float:
        e = error(end.estimates[vehicle].x, end.truths[vehicle])
        return float(e @ e) * (end.t - begin.t)

    return cost
