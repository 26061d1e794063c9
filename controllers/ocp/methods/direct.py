"""The plain method: one grid, one solve, one replay."""

from __future__ import annotations

from mathnavi.controllers.ocp.grid import Grid, uniform
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.replay import replayed
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.solver import DEFAULT, FIXED, Options, transcription
from mathnavi.controllers.ocp.transcriptions.hermite_simpson import HermiteSimpson
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.sim.interfaces.signals import Array

HERMITE_SIMPSON = HermiteSimpson()


def solve(
    problem: ProblemFunctions,
    nodes: int | Grid,
    *,
    scheme: Scheme = HERMITE_SIMPSON,
    guess: Solution | None = None,
    parameters: Array | None = None,
    options: Options = DEFAULT,
) -> Solution:
    """The problem on ``nodes`` uniform nodes, or on a grid of its own, with its replay.

    Whether there is a solution is in its status. Raises ProblemError for a number of nodes below two.
    """
    grid = nodes if isinstance(nodes, Grid) else uniform(nodes)
    made = transcription(problem, scheme, len(grid), FIXED, options)
    return replayed(made.solve(guess, grid, parameters))
