"""The default method: hp refinement, or where that falls short the method whose solution replays better.

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
from typing import Any

import numpy as np

from mathnavi.controllers.ocp.budget import Budget
from mathnavi.controllers.ocp.call import at
from mathnavi.controllers.ocp.crossings import crossings
from mathnavi.controllers.ocp.methods.adaptation import redistribute, solve
from mathnavi.controllers.ocp.methods.crossing_nodes import solved_at_crossings
from mathnavi.controllers.ocp.methods.hp import OPTIONS, TOLERANCE, hp
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.replay import GIVEN_NODES, check_tolerance
from mathnavi.controllers.ocp.residual import RESIDUAL
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome, Timing
from mathnavi.controllers.ocp.solver import DEFAULT, Options
from mathnavi.controllers.ocp.structure import linear_controls
from mathnavi.controllers.ocp.switching_surfaces import surfaces_of
from mathnavi.interfaces.signals import Array

_NODES, _ROUNDS = 60, 5  # of the redistribution
_HOPELESS = (
    SolverOutcome.UNBOUNDED, SolverOutcome.OVERDETERMINED, SolverOutcome.NOT_FINITE, SolverOutcome.INFEASIBLE
)  # by any method  # fmt: skip
_ERRORS = (ArithmeticError, LookupError, RuntimeError, ValueError)  # of an attempt, of CasADi's among them


def automatic(
    problem: ProblemFunctions,
    nodes: int | None = None,
    *,
    guess: Solution | None = None,
    parameters: Array | None = None,
    tolerance: float | None = None,
    options: Options | None = None,
    budget: Budget | None = None,
    bounded: bool = True,
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
        budget: CPU time of the call that this one belongs to; None for the seconds of the options.
        bounded: True to bound the error of J where nodes are placed at crossings, which are judged here.

    Returns:
        The solution with its replay; failure is in its status.

    Raises:
        ProblemError: for fewer than two nodes, a tolerance that is not positive, and parameters or a guess that do not
            fit the problem.
    """
    given: dict[str, Any] = {"guess": guess, "parameters": parameters}
    budget = Budget(options or OPTIONS) if budget is None else budget
    if nodes is not None:
        within = GIVEN_NODES if tolerance is None else tolerance
        return solve(problem, nodes, tolerance=within, options=budget.left(options or DEFAULT), **given)
    within = TOLERANCE if tolerance is None else tolerance
    check_tolerance(within)
    attempts = _Attempts(budget)
    first = attempts.tried("hp", lambda left: hp(problem, tolerance=within, options=left, **given), options or OPTIONS)
    optimal = first is not None and first.status is SolverOutcome.OPTIMAL
    if first is not None and (first.status in _HOPELESS or (budget.spent and not optimal)):
        return first
    if first is not None and not budget.spent and _needs_nodes(first):
        left = budget.left(options or OPTIONS)
        placed = solved_at_crossings(first, tolerance=within, parameters=parameters, options=left, bounded=bounded)
        improves = placed.status is SolverOutcome.OPTIMAL if optimal else placed.solved
        if (placed.surface_nodes and improves) or (not optimal and (first.not_smooth or budget.spent)):
            return placed
    if first is not None and optimal:
        return by_hp(first)
    moved = attempts.tried(
        "redistribution, residual",
        lambda left: redistribute(
            problem, _NODES, RESIDUAL, rounds=_ROUNDS, tolerance=within, options=left, **given
        ),
        options or DEFAULT,
    )  # fmt: skip
    if moved is not None and moved.solved and not budget.spent:
        better = given | {"guess": moved}
        attempts.tried(
            "hp from there", lambda left: hp(problem, tolerance=within, options=left, **better), options or OPTIONS
        )
    return attempts.best()


def _needs_nodes(first: Solution) -> bool:
    """True if a solution crosses jumps or kinks inside intervals, or a solver gave up where that may be why.

    Kinks of tables too that bend a solution by less than its tolerance.
    """
    if first.not_smooth:
        return True
    surfaces = surfaces_of(first.problem)
    if surfaces is None:
        return False
    gave_up = first.status in (SolverOutcome.LIMIT, SolverOutcome.FAILED)
    tables = first.solved and any(each.knots for each in surfaces.every)
    return (gave_up or tables) and any(each.inside for each in crossings(first))


class _Attempts:
    """Attempts at a problem, within one budget of time."""

    def __init__(self, budget: Budget) -> None:
        self._budget = budget
        self._found: list[Solution] = []
        self._failed: dict[str, Exception] = {}

    def tried(self, name: str, attempt: Callable[[Options], Solution], options: Options) -> Solution | None:
        """The solution of an attempt with what is left of the time; None where it ended in an error."""
        try:
            with at(method=name):
                self._found.append(attempt(self._budget.left(options)))
        except _ERRORS as error:
            self._failed[name] = error
            return None
        return self._found[-1]

    def best(self) -> Solution:
        """The solution that replays best, with what became of the others; raises the first error if none does."""
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


def by_hp(solution: Solution) -> Solution:
    """A solution by hp with the reason for that method in its message."""
    return _named(solution, f"hp, for {_reason(solution.problem)}: {solution.message}")


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
