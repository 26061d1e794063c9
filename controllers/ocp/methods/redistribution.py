"""r-refinement: solve, move the same number of nodes to where the monitor function is large, solve again.

The distribution is not part of the programme here, so each solve is as easy as the first, and the second starts from
the first.
"""

from __future__ import annotations

import dataclasses

from mathnavi.controllers.ocp.grid import Grid, equidistributed, uniform
from mathnavi.controllers.ocp.methods.direct import HERMITE_SIMPSON
from mathnavi.controllers.ocp.methods.gate import gated
from mathnavi.controllers.ocp.monitors import CURVATURE, Monitor
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.replay import GIVEN_NODES, replayed
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.solver import DEFAULT, FIXED, Options, transcription
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array


def redistribute(
    problem: ProblemFunctions,
    nodes: int,
    monitor: Monitor = CURVATURE,
    *,
    rounds: int = 1,
    scheme: Scheme = HERMITE_SIMPSON,
    guess: Solution | None = None,
    parameters: Array | None = None,
    options: Options = DEFAULT,
    tolerance: float = GIVEN_NODES,
) -> Solution:
    """Solve on uniform nodes, then ``rounds`` times on the grid that equidistributes a monitor function; gated.

    Args:
        problem: the problem as compiled functions.
        nodes: N, the same in every round.
        monitor: w, whose ``density`` is equidistributed; it needs no measure.
        rounds: number of redistributions, at least one.
        scheme: transcription of an interval.
        guess: a solution to start from, on any grid; None for the problem's own guess.
        parameters: (np,) values of the problem's parameters; None for the nominal ones.
        options: solver and its own tolerance.
        tolerance: largest miss, path violation and cost error of the replay of a solution that is called OPTIMAL, and
            which the gate lets pass however good those of the uniform solution are.

    Returns:
        The solution with its replay, or the uniform one with the status REFUSED where that replays better.

    Raises:
        ProblemError: for fewer than two nodes or no round, and a monitor function that is not positive.
    """
    if rounds < 1:
        raise ProblemError(f"rounds = {rounds!r}; allowed: a whole number >= 1")
    made = transcription(problem, scheme, nodes, FIXED, options)
    first = replayed(made.solve(guess, uniform(nodes), parameters), tolerance)
    if not (first.solved or first.status is SolverOutcome.LIMIT):
        return first
    current = first  # even one that did not converge shows where the next grid has to be dense
    for _ in range(rounds):
        following = made.solve(current, redistributed(current, nodes, monitor), parameters)
        spent = dataclasses.replace(following.timing, build_ms=0.0)  # it is the same programme
        current = dataclasses.replace(following, timing=spent + current.timing)
        if not (current.solved or current.status is SolverOutcome.LIMIT):
            break
    return gated(replayed(current, tolerance), first, f"redistribution, {monitor.name}", tolerance)


def redistributed(solution: Solution, nodes: int, monitor: Monitor) -> Grid:
    """The grid of ``nodes`` nodes between which the integral of a solution's monitor function is the same."""
    return equidistributed(nodes, lambda tau: monitor.density(solution, tau, monitor.epsilon), solution.grid.nodes)
