"""The methods of Paper B and their monitor functions by name, for a problem that is solved in one call.

**The default method**: hp refinement, or where that falls short the method whose solution replays better.

With a given number of nodes it is one solve on that many uniform nodes. Without, hp refinement is tried first: it finds
switches and singular arcs, adds points where the solution is smooth and ends at the tolerance. Where its replay is not
within the tolerance, or the solver gives up, the problem is solved by Hermite-Simpson's scheme, whose controls are
continuous, on nodes that are moved, round by round, to where the residual is; then hp refinement goes on from there.
The best replay is returned. The message says what was chosen, and why.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Literal, get_args

import numpy as np

from mathnavi.controllers.ocp.distribution import Equidistributed
from mathnavi.controllers.ocp.grid import check_nodes
from mathnavi.controllers.ocp.methods.adaptation import REFINED, distribute, redistribute, refine, solve
from mathnavi.controllers.ocp.methods.hp import MOST_NODES, TOLERANCE, hp
from mathnavi.controllers.ocp.monitors import ARCLENGTH, CURVATURE, LOCAL_ERROR, UNIFORM, Monitor
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions, check_problem
from mathnavi.controllers.ocp.replay import GIVEN_NODES
from mathnavi.controllers.ocp.residual import RESIDUAL
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome, Timing
from mathnavi.controllers.ocp.solver import Options
from mathnavi.controllers.ocp.structure import linear_controls
from mathnavi.controllers.ocp.verification.verified import verified
from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array

_NODES, _ROUNDS = 60, 5  # of the redistribution
_HOPELESS = (SolverOutcome.UNBOUNDED, SolverOutcome.OVERDETERMINED, SolverOutcome.NOT_FINITE)  # by any method


def automatic(
    problem: ProblemFunctions,
    nodes: int | None = None,
    *,
    guess: Solution | None = None,
    parameters: Array | None = None,
    tolerance: float | None = None,
    options: Options | None = None,
) -> Solution:
    """Solve a problem by the method that suits it; the solution's message says which, and why.

    Args:
        problem: the problem as compiled functions.
        nodes: number N of uniform nodes; None for as many as the tolerance needs.
        guess: a solution to start from, on any grid; None for the problem's own guess.
        parameters: (np,) values of the problem's parameters; None for the nominal ones.
        tolerance: largest figures of the replay of a solution that is called OPTIMAL; None for 1e-3 on a given number
            of nodes, and 1e-6 otherwise.
        options: solver and its own tolerance; None for each method's own.

    Returns:
        The solution with its replay; failure is in its status.

    Raises:
        ProblemError: for fewer than two nodes, a tolerance that is not positive, and parameters or a guess that do not
            fit the problem.
    """
    given: dict[str, Any] = {"guess": guess, "parameters": parameters}
    if options is not None:
        given["options"] = options
    if nodes is not None:
        within = GIVEN_NODES if tolerance is None else tolerance
        return solve(problem, nodes, tolerance=within, **given)
    within = TOLERANCE if tolerance is None else tolerance
    first = hp(problem, tolerance=within, **given)
    if first.status is SolverOutcome.OPTIMAL:
        return _named(first, f"hp, for {_reason(problem)}: {first.message}")
    if first.status in _HOPELESS:
        return first
    moved = redistribute(problem, _NODES, RESIDUAL, rounds=_ROUNDS, tolerance=within, **given)
    found = [first, moved]
    if moved.solved:
        found.append(hp(problem, tolerance=within, **(given | {"guess": moved})))
    if not any(each.solved for each in found):
        return first
    chosen = min(found, key=_error)
    others = ", ".join(f"{each.method} {_shown(each)}" for each in found if each is not chosen)
    spent = sum((each.timing for each in found), Timing())
    return _named(dataclasses.replace(chosen, timing=spent), f"{chosen.method}, for {others}: {chosen.message}")


def _named(solution: Solution, message: str) -> Solution:
    return dataclasses.replace(solution, message=message)


def _reason(problem: ProblemFunctions) -> str:
    """Reason for hp refinement in this problem."""
    bounded = np.isfinite(problem.control_bounds.lower) | np.isfinite(problem.control_bounds.upper)
    linear = [name for name, is_linear in zip(problem.controls, linear_controls(problem), strict=True) if is_linear]
    if linear:
        return f"{', '.join(linear)} may switch or be singular"
    if bounded.any() or len(problem.path_bounds.lower):
        return "bounds may hold on arcs"
    return "the solution is smooth"


def _error(solution: Solution) -> float:
    """Largest figure of the replay; infinite where nothing was solved."""
    return solution.replay.error if solution.solved and solution.replay is not None else math.inf


def _shown(solution: Solution) -> str:
    return f"replays with {_error(solution):.2g}" if solution.solved else f"failed ({solution.status.value})"


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
    verify: bool | None = None,
) -> Solution:
    """Solve a problem by one of the methods: "hp" by Radau collocation, the others by Hermite-Simpson's; and verify it.

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
        verify: True to bound the error of J on two finer meshes; False for the second-order condition alone; None for
            the bound with every method but "direct" (and "auto" on a given number of nodes).

    Returns:
        The solution with its replay. Failure is in its status, and so is an adaptive grid that the gate refused. It is
        OPTIMAL where a verification found nothing against it (see ``verification.verified``).

    Raises:
        ProblemError: for fewer than two nodes, an unknown method or monitor, a monitor for a method that takes none,
            and for a monitor without a measure where the nodes are unknowns.
    """
    check_problem(problem)
    if nodes is not None:
        check_nodes(nodes)
    if method not in get_args(Method):
        raise ProblemError(f"method = {method!r}; {allowed_for(str(method), get_args(Method))}")
    adaptive = method == "hp" or (method == "auto" and nodes is None and monitor is None)
    found = _solved_by(problem, nodes, method, monitor, guess, parameters, tolerance, options)

    def again(start: Solution, chosen: Options | None) -> Solution:
        own = options if chosen is None else chosen
        found = _solved_by(problem, nodes, "hp", None, start, parameters, tolerance, own)
        return _named(found, f"hp, for {_reason(problem)}: {found.message}") if method == "auto" else found

    bounded = adaptive or method not in ("auto", "direct") if verify is None else verify
    return verified(found, again if adaptive else None, options, bounded=bounded)


def _solved_by(
    problem: ProblemFunctions,
    nodes: int | None,
    method: Method,
    monitor: Monitor | str | None,
    guess: Solution | None,
    parameters: Array,
    tolerance: float | None,
    options: Options | None,
) -> Solution:
    """The method's own solution, judged by its replay alone."""
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
