"""hp refinement of a problem that is not smooth, with a node at every crossing of its switching surfaces.

A solution shows which surfaces are crossed and in which order. The problem is solved again in parts between them (see
``crossing_phases``), and once more where that solution crosses others.
"""

from __future__ import annotations

import dataclasses
import math

from mathnavi.controllers.ocp.budget import Budget
from mathnavi.controllers.ocp.call import at
from mathnavi.controllers.ocp.crossing_phases import parts_at
from mathnavi.controllers.ocp.crossings import crossings
from mathnavi.controllers.ocp.methods.hp import OPTIONS, hp
from mathnavi.controllers.ocp.replay import replayed
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.solver import Options
from mathnavi.controllers.ocp.verification.verified import verified
from mathnavi.interfaces.signals import Array

_ROUNDS = 3


def solved_at_crossings(
    first: Solution,
    *,
    parameters: Array | None = None,
    tolerance: float,
    options: Options = OPTIONS,
    bounded: bool = True,
) -> Solution:
    """The solution with a node at each crossing; where that fails the first one, CONVERGED, and the reason.

    Args:
        first: a solution that crosses jumps or kinks inside its intervals.
        parameters: (np,) values of the problem's parameters; None for the nominal ones.
        tolerance: of the replay.
        options: solver, its tolerance, and the seconds of all rounds.
        bounded: True to bound the error of J.
    """
    current, timing, budget = first, first.timing, Budget(options)
    for _ in range(_ROUNDS):
        if budget.spent:
            return _without(first, current, "stopped, for its seconds are spent")
        parts = parts_at(current)
        if isinstance(parts, str):
            return _without(first, current, parts)
        with at("nodes at the crossings"):
            found = hp(parts.stacked, tolerance=tolerance, parameters=parameters, options=budget.left(options))
        timing += found.timing
        if not found.solved:
            return _without(first, current, f"with a node at each crossing it is not solved: {found.message}")
        current = dataclasses.replace(parts.merged(found), method="hp", timing=timing)
        if parts.ends_on_surface(found):
            continue
        current = replayed(current, tolerance)
        if current.ok:
            return _judged(current, verified(found, None, options, budget, bounded=bounded), parts.ending, bounded)
        if not current.not_smooth:
            return _without(first, current, f"with a node at each crossing it is {current.message}")
    return _without(first, current, f"in {_ROUNDS} rounds the crossings change each time")


def _judged(current: Solution, parts: Solution, ending: str, bounded: bool) -> Solution:
    """A solution with a node at each crossing, with the word that its parts have earned: their nodes move with it."""
    crossed = ", ".join(str(each) for each in crossings(current))
    placed = ", ".join(filter(None, (crossed and f"a node where {crossed}", ending and f"its end on {ending}")))
    known = parts.status is not SolverOutcome.CONVERGED or math.isfinite(parts.cost_bound)
    error = f"J within {parts.cost_bound:.2g}" if known else "the error of J is unknown"
    error = error if bounded else "the error of J is not estimated"
    message = f"hp, {placed}; {current.message}; {error}"
    return dataclasses.replace(current, status=parts.status, cost_bound=parts.cost_bound, message=message)


def _without(first: Solution, current: Solution, why: str) -> Solution:
    return dataclasses.replace(first, timing=current.timing, message=f"{first.message}; {why}")
