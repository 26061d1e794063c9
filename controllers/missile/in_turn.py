"""An optimiser that asks another one where the first finds no flight."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cached_property

from mathnavi.controllers.missile.optimiser import MissileTrajectory, Optimiser
from mathnavi.controllers.missile.problem import TerminalCondition
from mathnavi.controllers.missile.shooting import Failed
from mathnavi.sim.interfaces.signals import Array


class InTurn:
    """An ``Optimiser``: ``first`` and, where it fails, the one that ``make_second`` builds when it is first needed.

    A flight by the second one carries the reason as its remark.
    """

    def __init__(self, first: Optimiser, make_second: Callable[[], Optimiser]) -> None:
        self._first, self._make_second = first, make_second

    def optimise(self, t: float, start: Array, terminal: TerminalCondition) -> MissileTrajectory | Failed:
        found = self._first.optimise(t, start, terminal)
        if not isinstance(found, Failed) or found.infeasible:
            return found
        other = self._second.optimise(t, start, terminal)
        if isinstance(other, Failed):
            return Failed(f"{found.message}; as one problem: {other.message}", other.infeasible)
        return dataclasses.replace(other, remark=f"planned as one problem: {found.message}")

    @cached_property
    def _second(self) -> Optimiser:
        return self._make_second()
