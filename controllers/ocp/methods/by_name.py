"""The methods of Paper B and their monitor functions by name, for a problem that is solved in one call."""

from __future__ import annotations

from typing import Any, Literal, get_args

from mathnavi.controllers.ocp.distribution import Equidistributed
from mathnavi.controllers.ocp.grid import check_nodes
from mathnavi.controllers.ocp.methods.adaptation import REFINED, distribute, redistribute, refine, solve
from mathnavi.controllers.ocp.methods.automatic import automatic
from mathnavi.controllers.ocp.methods.hp import MOST_NODES, TOLERANCE, hp
from mathnavi.controllers.ocp.monitors import ARCLENGTH, CURVATURE, LOCAL_ERROR, UNIFORM, Monitor
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions, check_problem
from mathnavi.controllers.ocp.replay import GIVEN_NODES
from mathnavi.controllers.ocp.residual import RESIDUAL
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.solver import Options
from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array

Method = Literal["auto", "hp", "direct", "redistribute", "distribute", "refine"]
"""method by name. ``auto``: one that suits the problem; ``hp``: points, nodes and switching times until the replay is
within the tolerance; ``direct``: uniform nodes; ``redistribute``: nodes moved between two solves; ``distribute``: nodes
that are unknowns of the programme, (B.1); ``refine``: nodes added where the local error is"""

NODES = 40
"""default number of nodes, of methods that need one"""

MONITORS = {monitor.name: monitor for monitor in (ARCLENGTH, CURVATURE, LOCAL_ERROR, RESIDUAL, UNIFORM)}
"""monitor functions by name"""

_DEFAULT_MONITORS = {"redistribute": CURVATURE, "distribute": ARCLENGTH}  # of the methods that take one
_FIRST_NODES = 6  # of a refinement


def solve_by(
    problem: ProblemFunctions,
    nodes: int | None,
    method: Method,
    monitor: Monitor | str | None,
    *,
    guess: Solution | None,
    parameters: Array,
    tolerance: float | None = None,
    options: Options | None = None,
) -> Solution:
    """Solve a problem by one of the methods: "hp" by Radau collocation, the others by Hermite-Simpson's.

    Args:
        problem: the problem as compiled functions.
        nodes: N, for ``hp`` and ``refine`` the most that they may use; None for as many as ``auto`` and ``hp`` need,
            and for ``NODES``.
        method: see ``Method``.
        monitor: the monitor function that ``redistribute`` and ``distribute`` equidistribute, or its name in
            ``MONITORS``; None for the method's own, curvature and arclength.
        guess: a solution to start from, on any grid; None for the problem's own guess.
        parameters: (np,) values of the problem's parameters.
        tolerance: largest figures of the replay of a solution that is called OPTIMAL; None for the method's own.
        options: solver and its own tolerance; None for the method's own.

    Returns:
        The solution with its replay. Failure is in its status, and so is an adaptive grid that the gate refused.

    Raises:
        ProblemError: for fewer than two nodes, an unknown method or monitor, a monitor for a method that takes none,
            and for a monitor without a measure where the nodes are unknowns.
    """
    check_problem(problem)
    if nodes is not None:
        check_nodes(nodes)
    if method not in get_args(Method):
        raise ProblemError(f"method = {method!r}; {allowed_for(str(method), get_args(Method))}")
    given: dict[str, Any] = {"guess": guess, "parameters": parameters}
    if options is not None:
        given["options"] = options
    if method in ("auto", "hp") and monitor is None:
        if method == "auto":
            return automatic(problem, nodes, tolerance=tolerance, **given)
        return hp(problem, nodes or MOST_NODES, tolerance=TOLERANCE if tolerance is None else tolerance, **given)
    nodes = NODES if nodes is None else nodes
    within = tolerance if tolerance is not None else REFINED if method == "refine" else GIVEN_NODES
    if method in _DEFAULT_MONITORS:
        chosen = _DEFAULT_MONITORS[method] if monitor is None else _monitor(monitor)
        if method == "redistribute":
            return redistribute(problem, nodes, chosen, tolerance=within, **given)
        distribution = Equidistributed(chosen, chosen.epsilon)
        return distribute(problem, nodes, distribution, tolerance=within, **given)
    if monitor is not None:
        takers = ", ".join(_DEFAULT_MONITORS)
        raise ProblemError(f"monitor: method = {method!r} takes none; allowed: a monitor with method {takers}")
    if method == "refine":
        return refine(
            problem,
            min(_FIRST_NODES, nodes),
            most_nodes=nodes,
            tolerance=within,
            **given,
        )
    return solve(problem, nodes, tolerance=within, **given)


def _monitor(monitor: Monitor | str) -> Monitor:
    """The monitor function itself, or the one of a name."""
    if isinstance(monitor, Monitor):
        return monitor
    if monitor not in MONITORS:
        raise ProblemError(f"monitor = {monitor!r}; {allowed_for(str(monitor), list(MONITORS), 'a Monitor')}")
    return MONITORS[monitor]
