"""Escape from a solution that is stationary and no minimum: a restart along a direction of negative curvature.

A negative curvature d'Hd alone proves little: of a singular arc the reduced Hessian is semidefinite only, and rounding
gives it either sign. A lower J proves all. So the problem is solved again on the same grid by the same scheme, without
arcs, from x ± αd, clipped to its limits, for a small and for a large α.

That grid may be too coarse for what is found there: a control that rings between its points has a low J which it cannot
be flown with. So J counts as lower where its replay is lower too, by more than ten times what the replay is off.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.controllers.ocp.replay import replayed
from mathnavi.controllers.ocp.solution import Solution, SolvedProgramme, SolverOutcome
from mathnavi.controllers.ocp.solver import FIXED, Options, transcription
from mathnavi.interfaces.signals import Array

_BEYOND = 10.0  # times the largest figure of the replay: least gain over the size of J
_STEPS = (0.1, -0.1, 1.0, -1.0)  # α, in scaled units: d has length 1 in the metric


def escaped(solution: Solution, direction: Array, size: float, options: Options) -> Solution | None:
    """Solve from both sides of a solution along a direction (n,) of its programme's unknowns; ``size`` is that of J.

    Returns the first solution whose J is lower by more than the tolerance, with its replay, or of which nothing bounds
    J: its status is UNBOUNDED. None where no start leads lower.
    """
    solved = solution.solved_programme
    assert solved is not None
    made = transcription(solution.problem, solution.scheme, solution.nodes, FIXED, options)
    for step in _STEPS:
        start = moved(solved, step * direction)
        found = made.solve(start, start.grid, solution.parameters)
        if found.status is SolverOutcome.UNBOUNDED:
            return found
        if found.solved and found.cost < solution.cost - solution.tolerance * size:
            found = replayed(found, solution.tolerance)
            if _gain(solution, found) > size * max(solution.tolerance, _BEYOND * _error(found)):
                return found
    return None


def _gain(solution: Solution, found: Solution) -> float:
    """J of a solution less that of another, the larger one of its own and of its replay's."""
    flown = found.cost if found.replay is None else found.replay.cost
    return solution.cost - max(found.cost, flown)


def _error(found: Solution) -> float:
    return math.inf if found.replay is None else found.replay.error


def moved(solved: SolvedProgramme, step: Array) -> Solution:
    """The solution at the answer of a programme moved by ``step`` (n,), clipped to the programme's bounds."""
    return solved.read(np.clip(solved.x + step, *solved.bounds[:2]))
