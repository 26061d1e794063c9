"""Verification of a solution that replays within its tolerance: the word that it has earned.

A replay shows that controls and states belong together, not that another control costs no more. Four more questions:

1. Does another start lead lower (``other_starts``)? What is lower takes its place.
2. Is it a minimum of the programme (``second_order``)? Where its curvature is negative along a direction, the
   problem is solved from both sides (``escape``); what is lower takes its place, and what runs away is UNBOUNDED.
3. Has the Hamiltonian a minimum in u, where nothing limits u (``weierstrass``)?
4. Does J stay on finer meshes (``cost_bound``)? Where it does not, and the mesh is the method's own choice, the problem
   is solved again from the finer mesh. A lower J takes the place of the solution, a dearer one never does.

No answer is worse news than that one is missing: the status follows from all of them together (``verdict``).
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from typing import Any

from mathnavi.controllers.ocp.budget import Budget
from mathnavi.controllers.ocp.call import at
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome, Timing
from mathnavi.controllers.ocp.solver import FIXED, Options, transcription
from mathnavi.controllers.ocp.structure import linear_controls
from mathnavi.controllers.ocp.verification.cost_bound import cost_bound, cost_size
from mathnavi.controllers.ocp.verification.escape import escaped
from mathnavi.controllers.ocp.verification.other_starts import OtherStarts, minima
from mathnavi.controllers.ocp.verification.second_order import SecondOrder, second_order
from mathnavi.controllers.ocp.verification.verdict import Evidence, judge
from mathnavi.controllers.ocp.verification.weierstrass import control_without_minimum
from mathnavi.interfaces.signals import Array

Again = Callable[[Solution, Options | None], Solution]
"""the method once more, from a solution, with options or with its own"""

_ESCAPES, _ROUNDS = 3, 3
_ITERATIONS = 150  # of an additional solve, which begins at a solution
_SECONDS = 5.0  # least limit [s] of CPU time of a solve
_TOLERANCE = 1e-11  # of the solver: J is compared
_SAME = 0.5  # of the tolerance: two solutions whose J differs by less confirm each other


def verified(
    solution: Solution,
    again: Again | None = None,
    options: Options | None = None,
    budget: Budget | None = None,
    *,
    bounded: bool = True,
    others: OtherStarts | None = None,
) -> Solution:
    """Find out what a solution with the status OPTIMAL may be called.

    Any other one is returned unchanged, unless one of several other starts leads to a better one.

    Args:
        solution: with its replay, as a method returned it.
        again: the method, where the mesh is its own choice, to be used from a lower or from a finer solution; None
            keeps the mesh.
        options: the solver's, as given to the method; None for its own.
        budget: CPU time of the call that this belongs to; None for the seconds of the options.
        bounded: True to bound the error of J, which takes two more solves.
        others: other starts, None for no look elsewhere; what several of them found is in the message.

    Returns:
        The solution with the status and the message that the evidence carries and with its ``cost_bound``, or one of
        lower J that took its place.
    """
    began = time.perf_counter()
    budget = Budget(options or Options()) if budget is None else budget
    limited = _limited(options, solution.timing)
    looked = None
    if others is not None and solution.solved and (solution.status is SolverOutcome.OPTIMAL or others.count > 1):
        looked = minima(solution, others, cost_size(solution), limited, budget)
    reason, words = "", "" if looked is None or others is None or others.count < 2 else str(looked)
    timing = solution.timing
    if looked is not None and looked.lower is not None:
        reason = f"from another start than J = {solution.cost:.7g}"
        solution = looked.lower
    if solution.status is not SolverOutcome.OPTIMAL:
        message = "; ".join(filter(None, (solution.message, words)))
        return dataclasses.replace(solution, message=message, timing=timing, solved_programme=None)
    with at("second-order condition"):
        run = _Verification(solution, again, limited, budget, reason)
        if looked is not None:
            run.know(lower_elsewhere=looked.unconfirmed)
        run.leave_saddles()
    if bounded and not run.settled:
        with at("finer meshes"):
            run.bound()
    found, known = run.solution, run.evidence
    status, added = judge(known)
    kept = "" if status is SolverOutcome.UNBOUNDED else found.message
    return dataclasses.replace(
        found,
        status=status,
        message="; ".join(filter(None, (kept, added, words))),
        cost_bound=math.nan if known.bound is None else known.bound,
        timing=timing + Timing(verify_ms=1e3 * (time.perf_counter() - began)),
        solved_programme=None,
    )


def _limited(options: Options | None, timing: Timing) -> Options:
    """Options of the additional solves, with a limit of twice the time of the solution itself.

    The limit is a power of two of its least value, so that programmes which were built before fit.
    """
    own = Options() if options is None else options
    limit = _SECONDS * 2.0 ** max(0, math.ceil(math.log2(max(2e-3 * timing.total_ms, _SECONDS) / _SECONDS)))
    return Options(
        tolerance=_TOLERANCE,
        iterations=min(own.iterations, _ITERATIONS),
        seconds=min(own.seconds, limit),
        linear_solver=own.linear_solver,
    )


class _Verification:
    """A solution, and the evidence about it so far."""

    solution: Solution
    evidence: Evidence
    _direction: Array | None

    def __init__(self, solution: Solution, again: Again | None, options: Options, budget: Budget, reason: str) -> None:
        self._again, self._limit, self._budget = again, options, budget
        self._linear = bool(linear_controls(solution.problem).all())
        self._take(solution, reason)

    @property
    def settled(self) -> bool:
        """True if the evidence is against the solution, whatever its mesh."""
        return bool(self.evidence.runs_away or self.evidence.control_without_minimum)

    @property
    def _options(self) -> Options:
        """Options of the next solve, with what is left of the time."""
        return dataclasses.replace(
            self._limit, seconds=min(self._limit.seconds, self._budget.left(self._limit).seconds)
        )

    def leave_saddles(self) -> None:
        """Follow directions of negative curvature to what is lower, as long as there are any."""
        for _ in range(_ESCAPES):
            if self.settled or self._direction is None or self._budget.spent:
                return
            lower = escaped(self.solution, self._direction, self.evidence.size, self._options)
            if lower is None:
                return
            found = [dataclasses.replace(lower, method=self.solution.method)]
            if self._again is not None and lower.status is not SolverOutcome.UNBOUNDED:
                found.insert(0, self._again(lower, None))
            for each in found:
                if each.status is SolverOutcome.UNBOUNDED:
                    self.know(runs_away=each.message)
                    self.solution = dataclasses.replace(each, tolerance=self.solution.tolerance)
                    return
                if each.status is SolverOutcome.OPTIMAL and each.cost < self.solution.cost - self.evidence.allowed:
                    self._take(each, f"from a stationary point with J = {self.solution.cost:.7g}")
                    break
            else:
                self.know(lower_cost=lower.cost)
                return

    def bound(self) -> None:
        """Bound the error of J and, where the mesh may be chosen, refine it until the bound is small enough."""
        began = time.perf_counter()
        for number in range(_ROUNDS + 1):
            if self._budget.spent:
                self.know(bound=math.inf if self.evidence.bound is None else self.evidence.bound)
                return
            known = cost_bound(self.solution, self._options)
            self.know(bound=known.bound)
            late = time.perf_counter() - began > 2.0 * self._limit.seconds
            if known.bound <= self.evidence.allowed or self._again is None or number == _ROUNDS or late:
                return
            found = self._again(known.finer, self._options)
            gain = self.solution.cost - found.cost
            if found.status is not SolverOutcome.OPTIMAL or gain < -_SAME * self.evidence.allowed:
                return  # a dearer one says nothing
            if gain > 0.0:
                lower = self.evidence.lower_cost
                self._take(found)
                if lower is not None and lower < found.cost - self.evidence.allowed:
                    self.know(lower_cost=lower)
            if gain <= _SAME * self.evidence.allowed:
                self.know(bound=2.0 * abs(gain))
                return

    def _take(self, found: Solution, reason: str = "") -> None:
        """Take a solution, with what its own programme and Hamiltonian say."""
        self.solution = dataclasses.replace(found, message="; ".join(filter(None, (found.message, reason))))
        size, solved = cost_size(found), found.solved_programme
        if solved is not None and solved.programme.layout.moving:  # moves of nodes are no matter of the problem
            made = transcription(found.problem, found.scheme, found.nodes, FIXED, self._options)
            solved = made.solve(found, found.grid, found.parameters).solved_programme
        known = SecondOrder(decided=False) if solved is None else second_order(solved, size)
        self._direction = known.direction
        self.evidence = Evidence(
            found.cost,
            size,
            found.tolerance,
            control_without_minimum=control_without_minimum(found),
            decided=known.decided,
            negative_curvature=known.direction is not None,
            bent=not self._linear,
        )

    def know(self, **evidence: Any) -> None:
        """Add to the evidence."""
        self.evidence = dataclasses.replace(self.evidence, **evidence)
