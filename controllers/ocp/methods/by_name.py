"""The methods of Paper B and their monitor functions by name, for a problem that is solved in one call.

**The default method**: hp refinement, or where that falls short the method whose solution replays better.

With a given number of nodes it is one solve on that many uniform nodes. Without, hp refinement is tried first: it finds
switches and singular arcs, adds points where the solution is smooth and ends at the tolerance. Where its replay is not
within the tolerance, or the solver gives up, the problem is solved by Hermite-Simpson's scheme, whose controls are
continuous, on nodes that are moved, round by round, to where the residual is; then hp refinement goes on from there.
The best replay is returned. The message says what was chosen, and why. An attempt that ends in an error is one that
fell short: the message names it, and only where all of them do the first error is raised.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any, Literal, get_args

import numpy as np

from mathnavi.controllers.ocp.budget import Budget
from mathnavi.controllers.ocp.distribution import Equidistributed
from mathnavi.controllers.ocp.grid import check_breaks, check_nodes
from mathnavi.controllers.ocp.methods.adaptation import REFINED, distribute, redistribute, refine, solve
from mathnavi.controllers.ocp.methods.crossing_nodes import solved_at_crossings
from mathnavi.controllers.ocp.methods.hp import MOST_NODES, OPTIONS, TOLERANCE, hp
from mathnavi.controllers.ocp.methods.schemes import chosen_scheme
from mathnavi.controllers.ocp.monitors import ARCLENGTH, CURVATURE, LOCAL_ERROR, UNIFORM, Monitor
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions, check_problem
from mathnavi.controllers.ocp.replay import GIVEN_NODES, check_tolerance
from mathnavi.controllers.ocp.residual import RESIDUAL
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome, Timing
from mathnavi.controllers.ocp.solver import DEFAULT, Options
from mathnavi.controllers.ocp.structure import linear_controls
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array

_NODES, _ROUNDS = 60, 5  # of the redistribution
_HOPELESS = (SolverOutcome.UNBOUNDED, SolverOutcome.OVERDETERMINED, SolverOutcome.NOT_FINITE)  # by any method
_ERRORS = (ArithmeticError, LookupError, RuntimeError, ValueError)  # of an attempt, of CasADi's among them


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
    if nodes is not None:
        within = GIVEN_NODES if tolerance is None else tolerance
        return solve(problem, nodes, tolerance=within, options=options or DEFAULT, **given)
    within = TOLERANCE if tolerance is None else tolerance
    check_tolerance(within)
    attempts = _Attempts(Budget(options or OPTIONS))
    first = attempts.tried("hp", lambda left: hp(problem, tolerance=within, options=left, **given), options or OPTIONS)
    if first is not None and first.status is SolverOutcome.OPTIMAL:
        return _named(first, f"hp, for {_reason(problem)}: {first.message}")
    if first is not None and (first.status in _HOPELESS or attempts.budget.spent):
        return first
    if first is not None and first.not_smooth:
        left = attempts.budget.left(options or OPTIONS)
        return solved_at_crossings(first, tolerance=within, parameters=parameters, options=left)
    moved = attempts.tried(
        "redistribution, residual",
        lambda left: redistribute(
            problem, _NODES, RESIDUAL, rounds=_ROUNDS, tolerance=within, options=left, **given
        ),
        options or DEFAULT,
    )  # fmt: skip
    if moved is not None and moved.solved and not attempts.budget.spent:
        better = given | {"guess": moved}
        attempts.tried(
            "hp from there", lambda left: hp(problem, tolerance=within, options=left, **better), options or OPTIONS
        )
    return attempts.best()


class _Attempts:
    """Attempts at a problem, within one budget of time."""

    def __init__(self, budget: Budget) -> None:
        self.budget = budget
        self._found: list[Solution] = []
        self._failed: dict[str, Exception] = {}

    def tried(self, name: str, attempt: Callable[[Options], Solution], options: Options) -> Solution | None:
        """The solution of an attempt with what is left of the time; None where it ended in an error."""
        try:
            self._found.append(attempt(self.budget.left(options)))
        except _ERRORS as error:
            self._failed[name] = error
            return None
        return self._found[-1]

    def best(self) -> Solution:
        """The solution that replays best, with what became of the others; raises the first error if there is none."""
        if not self._found:
            raise next(iter(self._failed.values()))
        solved = any(each.solved for each in self._found)
        chosen = min(self._found, key=_error) if solved else self._found[0]
        others = [f"{each.method} {_shown(each)}" for each in self._found if each is not chosen and solved]
        others += [f"{name} failed ({_words(error)})" for name, error in self._failed.items()]
        if not others:
            return chosen
        if solved:
            chosen = dataclasses.replace(chosen, timing=sum((each.timing for each in self._found), Timing()))
        return _named(chosen, f"{chosen.method}, for {', '.join(others)}: {chosen.message}")


def _words(error: Exception) -> str:
    """Kind and last line of an error; CasADi's begin with the place in its sources."""
    return f"{type(error).__name__}: {(str(error).strip().splitlines() or ['without a message'])[-1]}"


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
    scheme: Scheme | str | None = None,
    replay: bool = True,
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
        scheme: transcription of an interval, or its name in ``SCHEMES``, with which ``auto`` is ``direct``; None for
            the method's own, or multiple shooting for FATROP.
        replay: False for one solve on a given number of nodes that is not replayed, and at best CONVERGED.

    Returns:
        The solution with its replay. Failure is in its status, and so is an adaptive grid that the gate refused.

    Raises:
        ProblemError: for fewer than two nodes, or than the problem's break times need, an unknown method, scheme or
            monitor, a scheme or a monitor for a method that takes none, no replay for one that needs it, and for a
            monitor without a measure where the nodes are unknowns.
    """
    check_problem(problem)
    if nodes is not None:
        check_breaks(problem.name, check_nodes(nodes), problem.breaks)
    if method not in get_args(Method):
        raise ProblemError(f"method = {method!r}; {allowed_for(str(method), get_args(Method))}")
    given: dict[str, Any] = {"guess": guess, "parameters": parameters}
    if options is not None:
        given["options"] = options
    chosen_by_name = chosen_scheme(scheme, method, options)
    if chosen_by_name is not None:
        given["scheme"] = chosen_by_name
        method = "direct" if method == "auto" else method
    if not replay:
        if nodes is None or method not in ("auto", "direct") or monitor is not None:
            raise ProblemError(
                f"replay = False with nodes = {nodes}, method = {method!r}; allowed: a number of nodes, and method = "
                "'auto' or 'direct': the others decide by the replay"
            )
        return solve(problem, nodes, replay=False, **given)
    if method in ("auto", "hp") and monitor is None:
        if method == "auto":
            return automatic(problem, nodes, tolerance=tolerance, **given)
        return hp(problem, nodes or MOST_NODES, tolerance=TOLERANCE if tolerance is None else tolerance, **given)
    nodes = max(NODES, len(problem.breaks) + 2) if nodes is None else nodes
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
            min(max(_FIRST_NODES, len(problem.breaks) + 2), nodes),
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
