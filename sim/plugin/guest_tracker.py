"""A tracker that is not mathnavi's own, with what it stated when it was built.

Plans are certified for its tracking bound. A bound that its tracker changes later, or that answers in its own way
whether an error lies within, would change what was certified.
"""

from __future__ import annotations

import copy
import dataclasses
from typing import Any

from mathnavi.interfaces.boundary import guest
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.signals import Array, Estimate, Plan


class GuestTracker:
    """Tracker whose period, tracking bound and held input stay what they were."""

    def __init__(self, tracker: Any, bound: type | None) -> None:
        """``bound`` is the type of the tracker's bound, a dataclass, if it needs one.

        Raises PluginError for a ``held`` that is not mathnavi's own, ArgumentError for a bound out of range.
        """
        self.wrapped, self.period = tracker, float(tracker.period)
        if bound is not None:
            stated = {field.name: getattr(tracker.bound, field.name) for field in dataclasses.fields(bound)}
            self.bound = bound(**{name: None if value is None else float(value) for name, value in stated.items()})
        held = getattr(tracker, "held", None)
        if held is not None and guest(held):
            raise PluginError(f"the tracker {guest(tracker)} has held = {held!r:.60}; allowed: None, or a HeldInput")
        self.held = copy.copy(held)

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        """Return the tracker's command (nu,)."""
        command: Array = self.wrapped.command(t, estimate, plan)
        return command

    def __getattr__(self, name: str) -> Any:
        """Other attributes of the tracker: the events that it reports, for instance."""
        if name == "wrapped":  # of an object that is not made yet, as copies and pickles are
            raise AttributeError(name)
        return getattr(self.wrapped, name)
