"""The plain method: one grid, one solve, one replay."""

from __future__ import annotations

from mathnavi.controllers.ocp.grid import Grid, uniform
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.replay import GIVEN_NODES, replayed
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.solver import DEFAULT, FIXED, Options, transcription
from mathnavi.controllers.ocp.transcriptions.hermite_simpson import HermiteSimpson
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.interfaces.signals import Array

HERMITE_SIMPSON = HermiteSimpson()


def solve(
    problem: ProblemFunctions,
    nodes: int | Grid,
    *,
    scheme: Scheme = HERMITE_SIMPSON,
    guess: Solution | None = None,
    parameters: Array | None = None,
    options: Options = DEFAULT,
    tolerance: float = GIVEN_NODES,
) -> Solution:
    """Solve a problem on one grid and replay the solution.

    Args:
        problem: the problem as compiled functions.
        nodes: number N of uniform nodes, or a grid.
        scheme: transcription of an interval.
        guess: a solution to start from, on any grid; None for the problem's own guess.
        parameters: (np,) values of the problem's parameters; None for the nominal ones.
        options: solver and its own tolerance.
        tolerance: largest miss, path violation and cost error of the replay of a solution that is called OPTIMAL.

    Returns:
        The solution with its replay; failure is in its status, CONVERGED where N nodes are too few for the tolerance.

    Raises:
        ProblemError: for fewer than two nodes, and parameters or a guess that do not fit the problem.
    """
    grid = nodes if isinstance(nodes, Grid) else uniform(nodes)
    made = transcription(problem, scheme, len(grid), FIXED, options)
    return replayed(made.solve(guess, grid, parameters), tolerance)
