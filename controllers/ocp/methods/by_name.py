"""The methods of Paper B and their monitor functions by name, for a problem that is solved in one call."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal, get_args

from mathnavi.controllers.ocp.budget import Budget
from mathnavi.controllers.ocp.call import at
from mathnavi.controllers.ocp.distribution import Equidistributed
from mathnavi.controllers.ocp.feasibility.restarts import sampled, with_restarts
from mathnavi.controllers.ocp.grid import check_breaks, check_nodes
from mathnavi.controllers.ocp.interruption import ending_early
from mathnavi.controllers.ocp.methods.adaptation import REFINED, distribute, redistribute, refine, solve
from mathnavi.controllers.ocp.methods.automatic import automatic, by_hp
from mathnavi.controllers.ocp.methods.hp import MOST_NODES, OPTIONS, TOLERANCE, hp
from mathnavi.controllers.ocp.methods.schemes import chosen_scheme
from mathnavi.controllers.ocp.monitors import ARCLENGTH, CURVATURE, LOCAL_ERROR, UNIFORM, Monitor
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions, check_problem
from mathnavi.controllers.ocp.progress import Report, report_of
from mathnavi.controllers.ocp.replay import GIVEN_NODES
from mathnavi.controllers.ocp.residual import RESIDUAL
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.solver import DEFAULT, Options
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.controllers.ocp.verification.other_starts import STARTS, OtherStarts
from mathnavi.controllers.ocp.verification.verified import verified
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
    scheme: Scheme | str | None = None,
    replay: bool = True,
    verify: bool | None = None,
    starts: int | None = None,
    progress: bool | Report | None = None,
) -> Solution:
    """Solve a problem by one of the methods: "hp" by Radau collocation, the others by Hermite-Simpson's; and verify it.

    Where a method finds no feasible point it is restarted from other guesses (see ``feasibility.restarts``).

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
        verify: True to bound the error of J on two finer meshes; False for the second-order condition alone; None for
            the bound with every method but "direct" (and "auto" on a given number of nodes).
        starts: number of guesses that the problem is solved from; None for ``STARTS`` where the error of J is bounded,
            else one.
        progress: what is called with the progress (see ``progress.report_of``).

    Returns:
        The solution with its replay. Failure is in its status, and so is an adaptive grid that the gate refused. It is
        OPTIMAL where a verification found nothing against it (see ``verification.verified``).

    Raises:
        ProblemError: for fewer than two nodes, or than the problem's break times need, an unknown method, scheme or
            monitor, a scheme or a monitor for a method that takes none, no replay for one that needs it, and for a
            monitor without a measure where the nodes are unknowns, and a verification of what is not replayed.
    """
    check_problem(problem)
    if nodes is not None:
        check_breaks(problem.name, check_nodes(nodes), problem.breaks)
    if method not in get_args(Method):
        raise ProblemError(f"method = {method!r}; {allowed_for(str(method), get_args(Method))}")
    if starts is not None and (isinstance(starts, bool) or not isinstance(starts, int) or starts < 1):
        raise ProblemError(f"starts = {starts!r}; allowed: a whole number >= 1")
    first = DEFAULT if options is None else options
    report, budget = report_of(progress, printed=first.print_level > 0), Budget(first)
    at_crossings = verify is not False

    def chosen(guess: Solution | None, *, replay: bool = True) -> Solution:
        with at(method=method):
            return _by_method(
                problem, nodes, method, monitor, parameters, tolerance, options, scheme, budget, at_crossings, guess,
                replay=replay,
            )  # fmt: skip

    if not replay:
        if starts is not None and starts > 1:
            raise ProblemError(f"starts = {starts} with replay = False; allowed: replay = True, by which they compare")
        if verify:
            raise ProblemError("verify = True with replay = False; allowed: replay = True, for what verifies flies it")
        return chosen(guess, replay=False)
    fine = nodes is None or method == "hp"
    within = tolerance if tolerance is not None else TOLERANCE if fine else GIVEN_NODES
    given_mesh = nodes is not None or monitor is not None or scheme is not None

    def again(start: Solution, limited: Options | None) -> Solution:
        own = budget.left(limited or options or OPTIONS)
        with at(method="hp"):
            better = hp(problem, nodes or MOST_NODES, tolerance=within, guess=start, parameters=parameters, options=own)
        return by_hp(better) if method == "auto" else better

    def solved() -> Solution:
        found = with_restarts(problem, chosen, guess, parameters, within, first, budget, given_mesh=given_mesh)
        if found.surface_nodes:  # judged with nodes that move with the surfaces
            return dataclasses.replace(found, solved_programme=None)
        adaptive = method == "hp" or (method == "auto" and not given_mesh and found.method == "hp")
        bounded = adaptive or method not in ("auto", "direct") if verify is None else verify
        count = (STARTS if bounded else 1) if starts is None else starts
        own = problem.guess if guess is None else sampled(guess)
        others = OtherStarts(
            count - 1, own, (lambda start: again(start, None)) if adaptive else chosen, asked=starts is not None
        )
        return verified(
            found, again if adaptive else None, options, budget, bounded=bounded, others=others if count > 1 else None
        )

    return ending_early(solved, problem, parameters, within, first.seconds, report)


def _by_method(
    problem: ProblemFunctions,
    nodes: int | None,
    method: Method,
    monitor: Monitor | str | None,
    parameters: Array,
    tolerance: float | None,
    options: Options | None,
    scheme: Scheme | str | None,
    budget: Budget,
    bounded: bool,
    guess: Solution | None,
    *,
    replay: bool = True,
) -> Solution:
    """Solve a problem by one of the methods from one guess within a budget; see ``solve_by``."""
    given: dict[str, Any] = {"guess": guess, "parameters": parameters}
    chosen_by_name = chosen_scheme(scheme, method, options)
    if chosen_by_name is not None:
        given["scheme"] = chosen_by_name
        method = "direct" if method == "auto" else method
    left = budget.left(DEFAULT if options is None else options)
    if not replay:
        if nodes is None or method not in ("auto", "direct") or monitor is not None:
            raise ProblemError(
                f"replay = False with nodes = {nodes}, method = {method!r}; allowed: a number of nodes, and method = "
                "'auto' or 'direct': the others decide by the replay"
            )
        return solve(problem, nodes, replay=False, options=left, **given)
    if method in ("auto", "hp") and monitor is None:
        if method == "auto":
            limits: dict[str, Any] = {"tolerance": tolerance, "options": options, "budget": budget}
            return automatic(problem, nodes, bounded=bounded, **limits, **given)
        within = TOLERANCE if tolerance is None else tolerance
        own = budget.left(OPTIONS if options is None else options)
        return hp(problem, nodes or MOST_NODES, tolerance=within, options=own, **given)
    nodes = max(NODES, len(problem.breaks) + 2) if nodes is None else nodes
    within = tolerance if tolerance is not None else REFINED if method == "refine" else GIVEN_NODES
    given |= {"tolerance": within, "options": left}
    if method in _DEFAULT_MONITORS:
        chosen = _DEFAULT_MONITORS[method] if monitor is None else _monitor(monitor)
        if method == "redistribute":
            return redistribute(problem, nodes, chosen, **given)
        return distribute(problem, nodes, Equidistributed(chosen, chosen.epsilon), **given)
    if monitor is not None:
        takers = ", ".join(_DEFAULT_MONITORS)
        raise ProblemError(f"monitor: method = {method!r} takes none; allowed: a monitor with method {takers}")
    if method == "refine":
        return refine(problem, min(max(_FIRST_NODES, len(problem.breaks) + 2), nodes), most_nodes=nodes, **given)
    return solve(problem, nodes, **given)


def _monitor(monitor: Monitor | str) -> Monitor:
    """The monitor function itself, or the one of a name."""
    if isinstance(monitor, Monitor):
        return monitor
    if monitor not in MONITORS:
        raise ProblemError(f"monitor = {monitor!r}; {allowed_for(str(monitor), list(MONITORS), 'a Monitor')}")
    return MONITORS[monitor]
