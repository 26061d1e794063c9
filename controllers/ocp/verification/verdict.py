"""Status that a solution has earned: the evidence that was gathered, and the table from evidence to status.

The first row of ``TABLE`` whose condition holds gives the word and what the message adds:

    runs away                                       UNBOUNDED
    H falls without limit in a control              STATIONARY
    a lower J was found, but not to the tolerance   STATIONARY
    the same of a lower J elsewhere                 CONVERGED
    the replay exceeds the tolerance                CONVERGED
    E exceeds the tolerance, or is unknown          CONVERGED
    E was not asked for                             OPTIMAL, and that it was not
    negative curvature, and no lower J              OPTIMAL, and that the second-order condition is not shown
    otherwise                                       OPTIMAL, J within E

A negative curvature is a note only where a control bends H: where all enter linearly, the reduced Hessian of a singular
arc is semidefinite and has any sign in rounding; Kelley's condition judges there (see ``pontryagin``).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from mathnavi.controllers.ocp.solution import SolverOutcome


@dataclass(frozen=True)
class Evidence:
    """Evidence about a solved problem; costs are in units of J."""

    cost: float  # J
    size: float  # J_s
    tolerance: float  # allowed error of J over J_s
    accurate: bool = True  # the replay is within the tolerance
    runs_away: str = ""  # what runs away, from an escape or a finer mesh
    control_without_minimum: str = ""  # a control in which H falls without limit
    lower_cost: float | None = None  # a lower J that an escape found and that was not solved to the tolerance
    lower_elsewhere: float | None = None  # the same from another start
    bound: float | None = None  # E, infinite where no finer mesh was solved; None where it was not asked for
    decided: bool = True  # False where the inertia of the KKT matrix could not be had
    negative_curvature: bool = False  # along a direction from which no lower J was found
    bent: bool = True  # a control bends H

    @property
    def allowed(self) -> float:
        """Allowed error of J, in units of J."""
        return self.tolerance * self.size

    @property
    def lower_than_bound(self) -> bool:
        """True if a lower J was found near the solution that no error of J explains."""
        return self._lower(self.lower_cost)

    @property
    def lower_far_away(self) -> bool:
        """The same of a lower J from another start."""
        return self._lower(self.lower_elsewhere)

    def _lower(self, cost: float | None) -> bool:
        return cost is not None and cost < self.cost - max(self.allowed, self.bound or 0.0)


@dataclass(frozen=True)
class Row:
    """Row of the table: a condition, the status where it holds, and what the message adds."""

    holds: Callable[[Evidence], bool]
    status: SolverOutcome
    adds: Callable[[Evidence], str]


def _too_large(evidence: Evidence) -> bool:
    return evidence.bound is not None and not evidence.bound <= evidence.allowed


def _excess(evidence: Evidence) -> str:
    if evidence.bound is None or math.isinf(evidence.bound):
        return "the error of J is unknown: no finer mesh was solved"
    return f"J may be {evidence.bound:.2g} too large, which is {evidence.bound / evidence.size:.2g} of its size"


def _second_order_missing(evidence: Evidence) -> bool:
    return evidence.bent and (evidence.negative_curvature or not evidence.decided)


def _second_order(evidence: Evidence) -> str:
    if not _second_order_missing(evidence):
        return ""
    reason = "a direction of negative curvature led to no lower J" if evidence.decided else "its matrix is singular"
    return f"; the second-order condition is not shown: {reason}"


def _error(evidence: Evidence) -> str:
    return "the error of J is not estimated" if evidence.bound is None else f"J within {evidence.bound:.2g}"


TABLE = (
    Row(
        lambda e: bool(e.runs_away),
        SolverOutcome.UNBOUNDED,
        lambda e: f"{e.runs_away} (from a stationary point with J = {e.cost:.7g})",
    ),
    Row(
        lambda e: bool(e.control_without_minimum),
        SolverOutcome.STATIONARY,
        lambda e: (
            f"the Hamiltonian falls without limit in {e.control_without_minimum}, so that no control is a "
            "minimum; state a limit, or a cost that bounds it"
        ),
    ),
    Row(
        lambda e: e.lower_than_bound,
        SolverOutcome.STATIONARY,
        lambda e: (
            f"no minimum: a start beside this solution leads to J = {e.lower_cost:.7g} in place of "
            f"{e.cost:.7g}, which was not solved to the tolerance"
        ),
    ),
    Row(
        lambda e: e.lower_far_away,
        SolverOutcome.CONVERGED,
        lambda e: (
            f"another start leads to J = {e.lower_elsewhere:.7g} in place of {e.cost:.7g}, which was not solved to the "
            "tolerance"
        ),
    ),
    Row(lambda e: not e.accurate, SolverOutcome.CONVERGED, lambda e: ""),
    Row(_too_large, SolverOutcome.CONVERGED, _excess),
    Row(_second_order_missing, SolverOutcome.OPTIMAL, lambda e: _error(e) + _second_order(e)),
    Row(lambda e: True, SolverOutcome.OPTIMAL, _error),
)
"""rows from evidence to word; the first that holds decides"""


def judge(evidence: Evidence) -> tuple[SolverOutcome, str]:
    """The status that the evidence carries, and what it adds to the message."""
    row = next(row for row in TABLE if row.holds(evidence))
    return row.status, row.adds(evidence)
