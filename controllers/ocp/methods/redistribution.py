"""r-refinement: solve, move the same number of nodes to where the monitor function is large, solve again.

The distribution is not part of the programme here, so each solve is as easy as the first, and the second starts from
the first.
"""

from __future__ import annotations

import dataclasses

from controllers.ocp.grid import Grid, equidistributed
from controllers.ocp.methods.direct import HERMITE_SIMPSON, solve
from controllers.ocp.methods.gate import gated
from controllers.ocp.monitors import CURVATURE, Monitor
from controllers.ocp.solution import Solution
from controllers.ocp.solver import DEFAULT, Options
from controllers.ocp.statement import OptimalControlProblem
from controllers.ocp.transcriptions.scheme import Scheme
from sim.signals import Array


def redistribute(
    problem: OptimalControlProblem,
    nodes: int,
    monitor: Monitor = CURVATURE,
    *,
    rounds: int = 1,
    scheme: Scheme = HERMITE_SIMPSON,
    guess: Solution | None = None,
    parameters: Array | None = None,
    options: Options = DEFAULT,
) -> Solution:
    """The solution after ``rounds`` redistributions of a uniform solution; gated.

    Raises ValueError for fewer than two nodes or no round.
    """
    if rounds < 1:
        raise ValueError(f"rounds = {rounds!r}; allowed: a whole number >= 1")
    first = solve(problem, nodes, scheme=scheme, guess=guess, parameters=parameters, options=options)
    if not first.ok:
        return first
    current = first
    for _ in range(rounds):
        grid = redistributed(current, nodes, monitor)
        following = solve(problem, grid, scheme=scheme, guess=current, parameters=parameters, options=options)
        current = dataclasses.replace(following, timing=following.timing + current.timing)
        if not current.ok:
            break
    return gated(current, first, f"redistribution, {monitor.name}")


def redistributed(solution: Solution, nodes: int, monitor: Monitor) -> Grid:
    """The grid on which a solution's monitor function is equidistributed."""
    return equidistributed(nodes, lambda tau: monitor.density(solution, tau, monitor.epsilon), solution.grid.nodes)
