"""Restarts of a solve that found no feasible point, and what may be said where none finds one.

An interior-point method ends where no direction makes the violation smaller: a stationary point of the constraints,
and no proof; and it does not begin where a guess is not finite. So before a problem is called infeasible,
it is solved from other guesses (see ``starts``) on a coarse grid. The first that is solved is the guess with which the
method goes on. The draws come from a generator of a fixed seed: the same problem has the same restarts.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from mathnavi.controllers.ocp.budget import Budget
from mathnavi.controllers.ocp.call import at
from mathnavi.controllers.ocp.defects import defects
from mathnavi.controllers.ocp.feasibility.starts import starts
from mathnavi.controllers.ocp.grid import on_breaks, uniform
from mathnavi.controllers.ocp.problem_functions import GuessedTrajectory, ProblemFunctions
from mathnavi.controllers.ocp.replay import replayed
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.solver import FIXED, Options, transcription
from mathnavi.controllers.ocp.transcriptions.collocation import RadauIIA
from mathnavi.interfaces.signals import Array

_SEED = 0
_NODES, _POINTS = 21, 3
_ITERATIONS, _SECONDS = 300, 5.0  # of a restart
_VIOLATED = 1e-4  # scaled, from which on a last iterate is not feasible
_RESTARTED = (
    SolverOutcome.NO_FEASIBLE_POINT, SolverOutcome.LIMIT, SolverOutcome.FAILED, SolverOutcome.NOT_FINITE
)  # fmt: skip


def with_restarts(
    problem: ProblemFunctions,
    again: Callable[[Solution | None], Solution],
    guess: Solution | None,
    parameters: Array,
    tolerance: float,
    options: Options,
    budget: Budget,
    *,
    given_mesh: bool,
) -> Solution:
    """Solve a problem from a guess and, where that leads to no feasible point, from other ones.

    Args:
        problem: the problem as compiled functions.
        again: solves the problem by a method from a guess, None for the problem's own.
        guess: the first guess.
        parameters: (np,) values of the problem's parameters.
        tolerance: of the replay of a restart's solution with which the method itself cannot go on.
        options: solver, and the number of restarts.
        budget: CPU time of the whole call.
        given_mesh: True where another mesh or scheme than the method's is no answer: the first failure is returned.

    Returns:
        The first solution. Where every start ends at a stationary point of the constraints, NO_FEASIBLE_POINT with
        their number and the constraints that could not hold; otherwise the first failure.
    """
    failed = again(guess)
    stopped = failed.status is SolverOutcome.LIMIT and options.iterations < _ITERATIONS  # as the caller wanted
    if failed.status not in _RESTARTED or stopped:
        return failed
    not_finite = failed.status is SolverOutcome.NOT_FINITE  # at the guess it may be, and at no solution: |w| w at rest
    if failed.status is not SolverOutcome.NO_FEASIBLE_POINT and not (failed.iterations or not_finite):
        return failed  # the solver did not begin
    feasible = not_finite or (failed.status is not SolverOutcome.NO_FEASIBLE_POINT and not _violated(failed))
    own = problem.guess if guess is None else sampled(guess)
    words = failed.message if failed.status is SolverOutcome.NO_FEASIBLE_POINT else ""
    tried, timing, grid = 0, failed.timing, on_breaks(uniform(_NODES), problem.breaks)
    for what, start in starts(problem, own, parameters, options.restarts, np.random.default_rng(_SEED)):
        if budget.spent:
            break
        coarse = dataclasses.replace(
            options, backend="ipopt", warm=False, log=None, seconds=min(budget.left(options).seconds, _SECONDS),
            iterations=min(options.iterations, _ITERATIONS),
        )  # fmt: skip
        with at(f"restart {tried + 1}, {what}", "coarse mesh"):
            made = transcription(problem, RadauIIA(_POINTS), len(grid), FIXED, coarse)
            found = made.solve(start, grid, parameters, explained=not words)
        tried, timing = tried + 1, timing + found.timing
        if found.status in (SolverOutcome.INFEASIBLE, SolverOutcome.UNBOUNDED):
            return dataclasses.replace(found, method=failed.method, timing=timing)
        if found.solved:
            solved = again(found)
            if not solved.solved and solved.status is not SolverOutcome.UNBOUNDED:
                solved = replayed(found, tolerance)
                if given_mesh and solved.status is not SolverOutcome.NOT_FINITE:
                    return dataclasses.replace(failed, timing=timing + solved.timing)
            if not_finite and solved.status is SolverOutcome.NOT_FINITE:  # wherever it starts
                return dataclasses.replace(failed, timing=timing + solved.timing)
            message = f"from restart {tried} ({what}): {solved.message}"
            return dataclasses.replace(solved, message=message, timing=timing + solved.timing)
        if found.status is SolverOutcome.NO_FEASIBLE_POINT:
            words = words or found.message
        else:
            feasible = feasible or not _violated(found)
    failed = dataclasses.replace(failed, timing=timing)
    if feasible or not tried:
        return failed
    message = f"none found from {1 + tried} starts; {words or failed.message}"
    return dataclasses.replace(failed, status=SolverOutcome.NO_FEASIBLE_POINT, message=message)


def sampled(guess: Solution) -> GuessedTrajectory:
    """A solution that is a guess, at its nodes."""
    return GuessedTrajectory(guess.grid.nodes, guess.x, guess.control(guess.t), guess.duration)


def _violated(solution: Solution) -> bool:
    """True if conditions at the ends, the path or the dynamics are violated by a last iterate."""
    problem, p, T = solution.problem, solution.parameters, solution.duration
    t = solution.point_times.ravel()
    x, u = solution.inner.reshape(len(t), problem.nx), solution.u.reshape(len(t), problem.nu)
    ends = (
        (problem.initial(solution.x[0], p), problem.initial_bounds),
        (problem.final(solution.x[-1], T, p), problem.final_bounds),
        (problem.path.map(len(t))(x.T, u.T, t[None, :], np.tile(p[:, None], (1, len(t)))), problem.path_bounds),
    )
    worst = 0.0
    for rows, (lower, upper) in ends:
        values = np.array(rows.full())
        largest = np.maximum(*(np.where(np.isfinite(side), np.abs(side), 0.0) for side in (lower, upper)))
        excess = np.maximum(lower[:, None] - values, values - upper[:, None]) / np.maximum(1.0, largest)[:, None]
        worst = max(worst, float(np.nan_to_num(excess, nan=math.inf).max(initial=0.0)))
    if len(solution.scheme.points) > 1:
        worst = max(worst, float(np.nan_to_num(np.abs(defects(solution).states), nan=math.inf).max(initial=0.0)))
    return worst > _VIOLATED
