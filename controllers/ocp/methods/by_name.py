"""The methods of Paper B and their monitor functions by name, for a problem that is solved in one call."""

from __future__ import annotations

from typing import Literal, get_args

from mathnavi.controllers.ocp.distribution import Equidistributed
from mathnavi.controllers.ocp.grid import check_nodes
from mathnavi.controllers.ocp.methods.direct import solve
from mathnavi.controllers.ocp.methods.distribution import distribute
from mathnavi.controllers.ocp.methods.redistribution import redistribute
from mathnavi.controllers.ocp.methods.refinement import REFINED, refine
from mathnavi.controllers.ocp.monitors import ARCLENGTH, CURVATURE, LOCAL_ERROR, UNIFORM, Monitor
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions, check_problem
from mathnavi.controllers.ocp.replay import GIVEN_NODES
from mathnavi.controllers.ocp.residual import RESIDUAL
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.solver import DEFAULT, Options
from mathnavi.sim.interfaces.checks import allowed_for
from mathnavi.sim.interfaces.errors import ProblemError
from mathnavi.sim.interfaces.signals import Array

Method = Literal["direct", "redistribute", "distribute", "refine"]
"""``direct``: uniform nodes; ``redistribute``: nodes moved between two solves; ``distribute``: nodes that are unknowns
of the programme, (B.1); ``refine``: nodes added where the local error is"""

MONITORS = {monitor.name: monitor for monitor in (ARCLENGTH, CURVATURE, LOCAL_ERROR, RESIDUAL, UNIFORM)}
"""monitor functions by name"""

_DEFAULT_MONITORS = {"redistribute": CURVATURE, "distribute": ARCLENGTH}  # of the methods that take one
_FIRST_NODES = 6  # of a refinement


def solve_by(
    problem: ProblemFunctions,
    nodes: int,
    method: Method,
    monitor: Monitor | str | None,
    *,
    guess: Solution | None,
    parameters: Array,
    options: Options = DEFAULT,
    tolerance: float | None = None,
) -> Solution:
    """Solve a problem by one of the methods, with Hermite-Simpson collocation.

    Args:
        problem: the problem as compiled functions.
        nodes: N, for ``refine`` the most that it may use.
        method: see ``Method``.
        monitor: the monitor function that ``redistribute`` and ``distribute`` equidistribute, or its name in
            ``MONITORS``; None for the method's own, curvature and arclength.
        guess: a solution to start from, on any grid; None for the problem's own guess.
        parameters: (np,) values of the problem's parameters.
        options: solver and tolerance.
        tolerance: largest figures of the replay of a solution that is called OPTIMAL; None for the method's own.

    Returns:
        The solution with its replay. Failure is in its status, and so is an adaptive grid that the gate refused.

    Raises:
        ProblemError: for fewer than two nodes, an unknown method or monitor, a monitor for a method that takes none,
            and for a monitor without a measure where the nodes are unknowns.
    """
    check_problem(problem)
    check_nodes(nodes)
    if method not in get_args(Method):
        raise ProblemError(f"method = {method!r}; {allowed_for(str(method), get_args(Method))}")
    within = tolerance if tolerance is not None else REFINED if method == "refine" else GIVEN_NODES
    if method in _DEFAULT_MONITORS:
        chosen = _DEFAULT_MONITORS[method] if monitor is None else _monitor(monitor)
        if method == "redistribute":
            return redistribute(
                problem, nodes, chosen, guess=guess, parameters=parameters, options=options, tolerance=within
            )
        distribution = Equidistributed(chosen, chosen.epsilon)
        return distribute(
            problem, nodes, distribution, guess=guess, parameters=parameters, options=options, tolerance=within
        )
    if monitor is not None:
        takers = ", ".join(_DEFAULT_MONITORS)
        raise ProblemError(f"monitor: method = {method!r} takes none; allowed: a monitor with method {takers}")
    if method == "refine":
        return refine(
            problem,
            min(_FIRST_NODES, nodes),
            most_nodes=nodes,
            guess=guess,
            parameters=parameters,
            options=options,
            tolerance=within,
        )
    return solve(problem, nodes, guess=guess, parameters=parameters, options=options, tolerance=within)


def _monitor(monitor: Monitor | str) -> Monitor:
    """The monitor function itself, or the one of a name."""
    if isinstance(monitor, Monitor):
        return monitor
    if monitor not in MONITORS:
        raise ProblemError(f"monitor = {monitor!r}; {allowed_for(str(monitor), list(MONITORS), 'a Monitor')}")
    return MONITORS[monitor]
