"""Any controller's planner and tracker, flown behind the safety filter: its commands are filtered, its plans are not
certified.

    planner -> plan -> tracker -> proposed command -> filter -> command

The filter may lead the vehicle off the plan. A planner that starts its plans on the plan being flown would not notice,
so a plan from the estimate is requested where the vehicle is beyond the tracking bound of that plan.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from mathnavi.controllers.flight.certificate import TrackingBound
from mathnavi.controllers.flight.command_filter import CommandFilter
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest, where_raised
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.tolerances import TIME_TOLERANCE

_NO_COMMAND = np.full(3, np.nan)


class FilteredTracker:
    """Tracker whose commands are filtered; one that raises proposes nothing."""

    def __init__(self, tracker: Tracker, command_filter: CommandFilter) -> None:
        self.period, self.bound = command_filter.period, command_filter.bound
        self._tracker, self._filter = tracker, command_filter
        self._proposed, self._next = _NO_COMMAND, -np.inf  # the command held, and when the next is due [s]
        self._steps = self._interventions = 0
        self._least = np.inf  # [m] margin so far
        self._lost, self._breach = "", False
        self._events: list[tuple[str, str]] = []

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        """The filtered command (3,) [m/s^2] to hold from t [s] on."""
        if t >= self._next - TIME_TOLERANCE:
            self._proposed, self._next = self._asked(t, estimate, plan), t + self._tracker.period
        answer = self._filter.step(t, estimate, self._proposed)
        self._steps += 1
        self._interventions += answer.intervened
        self._least = min(self._least, answer.margin)
        if answer.breach and not self._breach:
            self._events.append(("tracking-breach", "of the plan behind the filtered commands"))
        if bool(answer.lost) != bool(self._lost):
            self._events.append(("guarantee-lost" if answer.lost else "guarantee-regained", answer.lost))
        self._lost, self._breach = answer.lost, answer.breach
        return answer.u

    def events(self) -> Sequence[tuple[str, str]]:
        """Kind and message of the events since the last call."""
        events, self._events = self._events, []
        return events

    def figures(self) -> dict[str, Any]:
        """Figures of a run: the share of commands that were changed, and the least margin [m]."""
        share = self._interventions / self._steps if self._steps else 0.0
        return {"filtered_share": share, "filter_margin_min_m": self._least if self._steps else None}

    def _asked(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        try:
            command = np.asarray(self._tracker.command(t, estimate, plan), dtype=np.float64)
        except (Exception, SystemExit) as error:  # whatever a third-party tracker does, the vehicle flies on
            self._events.append(("command-unusable", f"{type(error).__name__}: {error}{where_raised(error)}"))
            return _NO_COMMAND
        if command.shape != (3,):
            self._events.append(("command-unusable", f"a command of shape {command.shape}; allowed: (3,)"))
            return _NO_COMMAND
        return command


class FilteredPlanner:
    """Planner that plans from the estimate where the filter has led the vehicle off its plan."""

    def __init__(self, planner: Planner, bound: TrackingBound, command_filter: CommandFilter) -> None:
        """``bound`` is that of the planner's own tracker."""
        self.period = planner.period
        self._planner, self._bound, self._filter = planner, bound, command_filter

    def plan(self, request: PlanRequest) -> Plan:
        """Return the planner's plan."""
        self._filter.updated_with(request.messages)
        current = request.current
        if current is None or not self._bound.broken_by(request.estimate.x - state_at(current, request.t)):
            return self._planner.plan(request)
        return self._planner.plan(dataclasses.replace(request, t_start=request.t, current=None))

    def monitor(self, request: PlanRequest) -> Plan | None:
        """Pass messages that arrive between two planning instants on to the planner."""
        self._filter.updated_with(request.messages)
        monitor = getattr(self._planner, "monitor", None)
        answer: Plan | None = None if monitor is None else monitor(request)
        return answer


def filtered(planner: Planner, tracker: Any, command_filter: CommandFilter) -> tuple[FilteredPlanner, FilteredTracker]:
    """Wrap planner and tracker of a controller with the filter; ``tracker`` states its ``bound``."""
    return FilteredPlanner(planner, tracker.bound, command_filter), FilteredTracker(tracker, command_filter)
