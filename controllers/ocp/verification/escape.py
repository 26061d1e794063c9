"""Escape from a solution that is stationary and no minimum: a restart along a direction of negative curvature.

A negative curvature d'Hd alone proves little: of a singular arc the reduced Hessian is semidefinite only, and rounding
gives it either sign. A lower J proves all. So the problem is solved again on the same grid by the same scheme, without
arcs, from x ± αd, clipped to its limits, for a small and for a large α.
"""

from __future__ import annotations

import numpy as np

from mathnavi.controllers.ocp.solution import Solution, SolvedProgramme, SolverOutcome
from mathnavi.controllers.ocp.solver import FIXED, Options, transcription
from mathnavi.interfaces.signals import Array

_STEPS = (0.1, -0.1, 1.0, -1.0)  # α, in scaled units: d has length 1 in the metric


def escaped(solution: Solution, direction: Array, least_gain: float, options: Options) -> Solution | None:
    """Solve from both sides of a solution along a direction (n,) of its programme's unknowns; without a replay.

    Returns the first solution whose J is lower by more than ``least_gain``, or of which nothing bounds J: its status is
    UNBOUNDED. None where no start leads lower.
    """
    solved = solution.solved_programme
    assert solved is not None
    made = transcription(solution.problem, solution.scheme, solution.nodes, FIXED, options)
    for step in _STEPS:
        start = moved(solved, step * direction)
        found = made.solve(start, start.grid, solution.parameters)
        if found.status is SolverOutcome.UNBOUNDED or (found.solved and found.cost < solution.cost - least_gain):
            return found
    return None


def moved(solved: SolvedProgramme, step: Array) -> Solution:
    """The solution at the answer of a programme moved by ``step`` (n,), clipped to the programme's bounds."""
    return solved.read(np.clip(solved.x + step, *solved.bounds[:2]))
