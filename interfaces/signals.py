"""Signals of the loop, from sensors to actuators.

    sensors --Measurement--> estimator --Estimate--> planner --Plan--> tracker --command u--> plant

Every signal is immutable and carries the time at which it is valid. This module imports only numpy, so that a model, a
planner and an observer can share these types without importing each other.
"""

from __future__ import annotations

import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

NOTHING: Mapping[str, Any] = MappingProxyType({})


class Status(Enum):
    """Outcome of an estimate or of a plan request; the value is the message for the user.

    OK is as good as declared. DEGRADED is not, after a gap in the readings that was longer than declared for example,
    but its covariance, where it has one, says how good it is.
    """

    OK = "ok"
    INITIALISING = "the estimator has not seen enough measurements yet"
    DEGRADED = "the estimate is worse than declared"
    LOST = "the estimator has lost its sensors"
    SOLVER_FAILED = "the solver did not converge"
    INFEASIBLE = "the optimisation problem has no feasible point"
    RAISED = "the planner raised an exception"
    NOT_FINITE = "the plan contains NaN or infinity"
    MALFORMED = "the plan's arrays do not fit together, or its arcs do not join"
    LATE = "the plan was not at hand when it should have started"
    NOT_ADMITTED = "the plan was not acknowledged by every other vehicle when it should have started"

    @property
    def usable(self) -> bool:
        """True if an estimate may be used together with its covariance: OK or DEGRADED. Only OK counts as good."""
        return self in (Status.OK, Status.DEGRADED)


OPTIMISED = 0
"""Phase of an arc that was optimised; a mission numbers its other phases, from 1 on."""


def where_raised(error: BaseException) -> str:
    """Return the line that raised, as " (FILE:LINE)"; "" if that is not known."""
    last = traceback.extract_tb(error.__traceback__)[-1:]
    return "".join(f" ({frame.filename}:{frame.lineno})" for frame in last)


@dataclass(frozen=True)
class Measurement:
    """Reading of a sensor."""

    name: str
    t: float  # [s]
    value: Array  # (m,) in the sensor's unit and frame


@dataclass(frozen=True)
class Estimate:
    """Estimate of the state at time ``t``."""

    t: float  # [s]
    x: Array  # (nx,) state
    covariance: Array | None = None  # (nx, nx)
    status: Status = Status.OK
    extra: Mapping[str, Array] = field(default_factory=lambda: NOTHING)
    """further arrays by name, each of one shape for a whole run, NaN for what there is not; some names have a meaning:
    ``interfaces.innovations``, ``interfaces.reading_counts``"""
    message: str = ""  # why the status is not OK: of one that is INITIALISING, what it waits for


def status_text(estimate: Estimate) -> str:
    """Return the message of an estimate's status, with the details behind it."""
    return estimate.status.value + (f"; it {estimate.message}" if estimate.message else "")


@dataclass(frozen=True)
class Plan:
    """Plan of the whole future, to rest or onto the target, as arcs with constant input stamped in absolute time.

    Arc k holds the input ``u[k]`` over [t[k], t[k+1]] and starts at the state ``x[k]``; ``x[-1]`` is the state of
    rest in which the vehicle stays, or that in which it meets its target. A plan whose ``status`` is not ``OK`` is a
    failure that is recorded and is never flown; its arrays may be empty.
    """

    t: Array  # (K + 1,) [s] absolute, increasing
    x: Array  # (K + 1, nx) state at t
    u: Array  # (K, nu) input over [t[k], t[k + 1]]
    phase: Integers  # (K,) OPTIMISED, or a phase that the mission defines
    status: Enum = Status.OK  # a Status, or a reason of the mission for refusing a plan
    message: str = ""  # details behind the status
    ready: float = -np.inf  # [s] simulated time at which the plan is available
    cost: float = np.nan  # the planner's objective
    solve_ms: float = np.nan  # thread CPU time of the optimisation; wall-clock figures stay out of the log
    notes: tuple[str, ...] = ()  # kinds of other events to record when the plan is adopted, for example "rebased"

    @property
    def ok(self) -> bool:
        """True for a plan, false for a failure."""
        return self.status is Status.OK

    @property
    def by_fallback(self) -> bool:
        """True for a plan that is flown because the planner had no plan, or no certified one."""
        return "fallback-plan" in self.notes or "uncertified-plan" in self.notes

    @property
    def t_start(self) -> float:
        """Time [s] of its first breakpoint."""
        return float(self.t[0])

    @property
    def t_end(self) -> float:
        """Time [s] of its last breakpoint."""
        return float(self.t[-1])

    @staticmethod
    def failure(
        status: Enum,
        message: str = "",
        *,
        ready: float = -np.inf,
        solve_ms: float = np.nan,
        notes: tuple[str, ...] = (),
    ) -> Plan:
        """Return a failed plan, with the reason."""
        nothing, none = np.empty((0, 0)), np.empty(0, np.int64)
        return Plan(np.empty(0), nothing, nothing, none, status, message, ready, solve_ms=solve_ms, notes=notes)

    @staticmethod
    def raised(error: BaseException) -> Plan:
        """Return a failed plan in place of the answer of a planner that raised."""
        return Plan.failure(Status.RAISED, f"{type(error).__name__}: {error}{where_raised(error)}")


@dataclass(frozen=True)
class Message:
    """Information communicated in flight: a radar switched on, a target that moved."""

    t: float  # [s] when it is delivered
    sender: str
    topic: str
    payload: Any


@dataclass(frozen=True)
class Outbox:
    """Messages of a coordinator at one time: to others, to its own planner, and events.

    If the message and the tuple of several receivers are the same objects as before, the message is a repetition for
    those that may have lost it: a network that loses none delivers it once, also to a receiver that could not take it
    then. Information that all must have in the end is sent as a new message from time to time.
    """

    messages: tuple[tuple[str | tuple[str, ...], Message], ...] = ()  # (receivers, message), for the network
    planner_messages: tuple[Message, ...] = ()  # for the vehicle's own planner: an arrival time that was agreed on
    events: tuple[tuple[str, str], ...] = ()  # (kind, message), for the log


@dataclass(frozen=True)
class PlanRequest:
    """Request to a planner: a plan that starts at ``t_start`` on the plan being flown."""

    t: float  # [s] now
    t_start: float  # [s] when the answer takes over: one planning period ahead, or now if there is no plan yet
    estimate: Estimate
    current: Plan | None  # the plan being flown; None before the first
    messages: tuple[Message, ...] = ()  # delivered since the last request


DIVERGED = "diverged"
"""Kind of the event by which a plant says that its simulation is lost: it ends the run."""


@dataclass(frozen=True)
class Event:
    """Event that is recorded as a line in events.jsonl."""

    t: float  # [s]
    agent: str
    kind: str
    message: str = ""
