"""Node distribution inside the programme, (B.1) augmented to the problem: the method of Paper B.

The programme with free nodes is hard from a cold start. It starts from the uniform solution, interpolated on the grid
that equidistributes that solution's own monitor function.
"""

from __future__ import annotations

import dataclasses

from mathnavi.controllers.ocp.distribution import Equidistributed, NodeDistribution
from mathnavi.controllers.ocp.methods.direct import HERMITE_SIMPSON, solve
from mathnavi.controllers.ocp.methods.gate import gated
from mathnavi.controllers.ocp.methods.redistribution import redistributed
from mathnavi.controllers.ocp.monitors import Monitor
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.replay import GIVEN_NODES, replayed
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.solver import DEFAULT, Options, transcription
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array

EQUIDISTRIBUTED = Equidistributed()


def distribute(
    problem: ProblemFunctions,
    nodes: int,
    distribution: NodeDistribution = EQUIDISTRIBUTED,
    *,
    scheme: Scheme = HERMITE_SIMPSON,
    guess: Solution | None = None,
    parameters: Array | None = None,
    options: Options = DEFAULT,
    tolerance: float = GIVEN_NODES,
) -> Solution:
    """Solve a problem whose nodes are unknowns of the programme, (B.1), from its uniform solution; gated.

    Args:
        problem: the problem as compiled functions.
        nodes: N.
        distribution: functional I and constraints m of the nodes.
        scheme: transcription of an interval.
        guess: a solution to start from, on any grid; None for the problem's own guess.
        parameters: (np,) values of the problem's parameters; None for the nominal ones.
        options: solver and its own tolerance.
        tolerance: largest miss, path violation and cost error of the replay of a solution that is called OPTIMAL, and
            which the gate lets pass however good those of the uniform solution are.

    Returns:
        The solution with its replay, or the uniform one with the status REFUSED where that replays better.

    Raises:
        ProblemError: for fewer than two nodes, or a distribution whose nodes are not unknowns.
    """
    if not distribution.moving:
        raise ProblemError(f"distribution = {distribution!r} fixes the nodes; allowed: one that moves them")
    first = solve(
        problem, nodes, scheme=scheme, guess=guess, parameters=parameters, options=options, tolerance=tolerance
    )
    if not first.solved:
        return first
    made = transcription(problem, scheme, nodes, distribution, options)
    monitor = getattr(distribution, "monitor", None)
    grid = redistributed(first, nodes, monitor) if isinstance(monitor, Monitor) else first.grid
    second = replayed(made.solve(first, grid, parameters), tolerance)
    second = dataclasses.replace(second, timing=second.timing + first.timing)
    return gated(second, first, f"in the programme: {described(distribution)}", tolerance)


def described(distribution: NodeDistribution) -> str:
    """Name of a distribution's class, with that of its monitor function if it has one."""
    monitor = getattr(distribution, "monitor", None)
    return type(distribution).__name__ + (f", {monitor.name}" if isinstance(monitor, Monitor) else "")
