"""hp refinement with switch detection: more points where a solution is smooth, nodes where not, a boundary at a switch.

Each round solves by Radau collocation, compares every interval with its own dynamics under the saturated control (see
``defects``) and reads the solution's structure (see ``structure``). Points and nodes are chosen interval by interval
(see ``hp_mesh``). Where controls are held by their bounds, or leave them, the next programme has arcs whose lengths are
unknowns; a control that a bound holds is held there. A control that enters linearly and is free, on a singular arc, is
kept from ringing by a small weight ρ on its variation about a straight line within an interval: J is at most ρ
times that variation above its least value, and ρ falls until this is below the tolerance. The rounds end when the
defects are small and J no longer changes or, of a smooth solution, is seen to be as good as its least value.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from mathnavi.controllers.ocp.arcs import Arcs
from mathnavi.controllers.ocp.budget import Budget
from mathnavi.controllers.ocp.call import at
from mathnavi.controllers.ocp.clocks import clocks_of, without_vanished
from mathnavi.controllers.ocp.defects import defects
from mathnavi.controllers.ocp.grid import Grid, check_nodes, on_breaks, uniform
from mathnavi.controllers.ocp.layout import control_variations, mixed_constraints
from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.methods.angles import unwound
from mathnavi.controllers.ocp.methods.guess_resolution import follows_guess
from mathnavi.controllers.ocp.methods.hp_mesh import (
    VIOLATION,
    HpMesh,
    IntervalErrors,
    interval_errors,
    meshed,
    size_of_cost,
    with_boundaries,
)
from mathnavi.controllers.ocp.methods.initial_value import initial_value
from mathnavi.controllers.ocp.methods.suboptimality import suboptimality
from mathnavi.controllers.ocp.methods.switching_gaps import switching_gaps
from mathnavi.controllers.ocp.nlp import SHORTEST_ARC
from mathnavi.controllers.ocp.problem_functions import GuessedTrajectory, ProblemFunctions, check_problem
from mathnavi.controllers.ocp.replay import check_tolerance, replayed
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome, Timing
from mathnavi.controllers.ocp.solver import FIXED, Options, nodes_of_instants, transcription
from mathnavi.controllers.ocp.structure import Structure, linear_controls, structure, without_structure
from mathnavi.interfaces.signals import Array

OPTIONS = Options(tolerance=1e-11)
"""solver options, tighter than those of other methods: J is compared from round to round"""
TOLERANCE = 1e-6
MOST_NODES = 300

_STARTS = ((13, 3), (25, 3), (41, 2))  # nodes and points of an interval, until one is solved
_ROUNDS = 14
_MARGIN = 0.1  # of the tolerance that the defects, and a change of J, may take
_MOST_ARCS = 30
_MOST_VISITS = 2  # to the same structure, before the rounds stay with it
_SMOOTHING = 1e-2  # first weight ρ, over |J|
_JITTER = 1e-4  # of that weight for a control that J or the dynamics bend: it would jitter in a narrow interval
_STALE = 3  # rounds that do not halve what a constraint is missed by, before boundaries no longer move
_MOST_BENT = 6  # rounds in which only a violated constraint adds nodes
_ASTRAY = 1e-2  # least relative rise of J that the errors have to explain
_COARSE = 1e-3  # sum of errors above which a structure is kept
_NEAR = 1e-3  # sum of errors below which the next solution is near, where no arcs have lengths to be found
_LEAST = 1e-3  # of the tolerance: least limit of the defects
_ROUNDING = 1e-9  # relative change of J that the solver's own tolerance leaves


@dataclass(frozen=True, eq=False)
class _Plan:
    """Programme of a round: a mesh, its structure and the smoothing of free controls."""

    mesh: HpMesh
    structure: Structure
    smoothing: float  # ρ, in units of J
    every: bool = False  # True if all free controls are smoothed, not only those that enter linearly
    near: bool = False  # True for a solver that stays near its guess, without bounds of what constraints determine

    def solved(
        self,
        problem: ProblemFunctions,
        guess: Solution | GuessedTrajectory | None,
        parameters: Array | None,
        options: Options,
        *,
        plain_rows: bool = False,
    ) -> Solution:
        known = self.structure
        ends = np.searchsorted(self.mesh.grid.nodes, np.append(known.boundaries, 1.0) - 1e-12)
        intervals = tuple(int(n) for n in np.diff(np.append(0, ends)))
        weights = np.where(known.held[:, : problem.nu] == 0, self.weights(problem), 0.0)
        arcs = Arcs(intervals, *known.limits(problem, determined=self.near), smoothing=weights)
        at = nodes_of_instants(problem, self.mesh.grid)
        options = dataclasses.replace(options, warm=True) if self.near else options
        made = transcription(problem, self.mesh.scheme, len(self.mesh.grid), FIXED, options, len(known), at)
        return unwound(made.solve(guess, self.mesh.grid, parameters, arcs, plain_rows=plain_rows))

    def added(self, solution: Solution) -> float:
        """Bound on what the smoothing adds to J: J is at most as much above its least value."""
        u = solution.u / solution.problem.control_scale
        return float(self.weights(solution.problem) @ control_variations(solution.scheme, u).sum(axis=0))

    def weights(self, problem: ProblemFunctions) -> Array:
        """Weights ρ (nu,) of the variation of each control where it is free."""
        weights = self.smoothing * np.where(linear_controls(problem) | self.every, 1.0, _JITTER)
        weights[[clock.rate for clock in clocks_of(problem)]] = 0.0
        return weights

    def placed(self, solution: Solution) -> Structure:
        """The structure with its boundaries where a solution put them, without arcs that all but vanished."""
        ends = np.searchsorted(self.mesh.grid.nodes, self.structure.boundaries - 1e-12)
        held, least = self.structure.held, 100.0 * SHORTEST_ARC
        for clock in clocks_of(solution.problem):
            own_time = solution.x[np.concatenate([[0], ends, [solution.nodes - 1]]), clock.state]
            held = without_vanished(clock, held, np.diff(own_time), least)
        moved = dataclasses.replace(self.structure, boundaries=solution.grid.nodes[ends], held=held)
        return moved.without_arcs_below(least)


def hp(
    problem: ProblemFunctions,
    most_nodes: int = MOST_NODES,
    *,
    tolerance: float = TOLERANCE,
    guess: Solution | None = None,
    parameters: Array | None = None,
    options: Options = OPTIONS,
) -> Solution:
    """Solve a problem to a tolerance by hp refinement with switch detection, from a coarse uniform grid.

    Args:
        problem: the problem as compiled functions.
        most_nodes: limit of the number of nodes.
        tolerance: allowed sum of the intervals' defects, over the states' scales, and relative error of J.
        guess: a solution to start from, with its grid; None for the problem's own guess on a uniform one.
        parameters: (np,) values of the problem's parameters; None for the nominal ones.
        options: solver and its tolerance.

    Returns:
        The solution with its replay; its message says what was found and whether the tolerance was reached.

    Raises:
        ProblemError: for fewer than two nodes and a tolerance that is not positive.
    """
    check_problem(problem)
    check_tolerance(tolerance)
    check_nodes(most_nodes, "most_nodes")
    budget = Budget(options)
    plan, current = _first(problem, most_nodes, guess, parameters, budget, options)
    if not current.solved:
        explained = _explained(current, problem, guess, parameters, budget.left(options))
        return dataclasses.replace(explained, method="hp")
    allowed, change, visited, bent = _MARGIN * tolerance, math.inf, [plan.structure], 0
    free = bool(problem.breaks)  # a boundary that moves would move them too: switches between them are narrowed down
    # Boundaries move to where a constraint of states alone, which no arc holds, is missed between the points.
    leaping = len(mixed_constraints(problem)) < len(problem.path_names)
    failures, left, stale, best, ambiguous = 0, False, 0, (math.inf, plan, current), False
    for number in range(_ROUNDS):
        known, seen, own = defects(current), structure(current), plan.placed(current)
        errors = interval_errors(current, known, switching_gaps(current) if problem.breaks or left else None)
        worst = max(errors.total, errors.path.max(), errors.held.max())
        leaps = leaping and errors.path.max() == worst
        stale = stale + 1 if leaps and worst >= 0.5 * best[0] else 0
        if worst < best[0]:
            best = worst, plan, current
        if len(plan.structure) > 1 and not free and stale >= _STALE:
            free, left, stale, own = True, True, 0, without_structure(problem)
            plan, current = best[1], dataclasses.replace(best[2], timing=current.timing)
            known = defects(current)
            errors = interval_errors(current, known, switching_gaps(current))
        visits = sum(seen.same(other) for other in visited)
        coarse = len(own) > 1 and errors.total > _COARSE  # a mesh that is too coarse shows arcs that are none
        settled = (
            free or coarse or seen.same(own) or visits >= _MOST_VISITS or len(seen) > min(_MOST_ARCS, most_nodes - 1)
        )
        unchanged = change <= max(allowed, _ROUNDING)
        small = errors.total <= allowed and max(errors.path.max(), errors.held.max()) <= VIOLATION * allowed
        smooth = plan.added(current) <= tolerance * size_of_cost(current)
        fair = small or (errors.total <= allowed and bent >= _MOST_BENT)
        bent += int(errors.total <= allowed and not small)
        resolved = settled or (ambiguous and unchanged)
        if resolved and fair and smooth and (unchanged or _shown_best(current, allowed)):
            current = replayed(current, tolerance, known)
            error = math.inf if current.replay is None else current.replay.error
            if not small or error <= tolerance or allowed < _LEAST * tolerance:
                break
            allowed *= max(_LEAST, 0.3 * tolerance / error)  # the true dynamics amplify the defects
        rho = plan.smoothing if number else _SMOOTHING * abs(current.cost)
        if settled:
            rho *= 0.1 if fair and not smooth else 1.0
            mesh = meshed(current, own, errors, allowed, most_nodes, hard=plan.every)
            near = plan.near or (len(own) == 1 and errors.total <= _NEAR)
            following = _Plan(mesh, own, rho, plan.every, near)
        else:
            mesh = HpMesh.from_solution(current).with_boundaries(seen.boundaries, most_nodes)
            following = _Plan(mesh, seen, rho, plan.every)
        if budget.spent:
            break
        with at(method=f"hp, round {number + 2}"):
            found, following, smooth_start = _next(problem, following, current, errors, parameters, budget, options)
        failures += int(not smooth_start)
        current = dataclasses.replace(current, timing=current.timing + found.timing)
        if not found.solved or failures > 1:
            break
        free = free or len(following.structure) == 1 < max(len(own), len(seen))
        # Two structures of as good a J: which of them is right, the solution does not show, and need not.
        ambiguous = not following.structure.same(plan.structure)
        change = abs(found.cost - current.cost) / size_of_cost(found)
        full = len(following.mesh.grid) >= most_nodes and following.mesh.same(plan.mesh)
        plan, current = following, dataclasses.replace(found, timing=current.timing)
        visited.append(plan.structure)
        if full:
            break
    if current.replay is None:
        current = replayed(current, tolerance)
    ended = "; stopped, for its seconds are spent" if budget.spent and not current.ok else ""
    return dataclasses.replace(current, method="hp", message=f"{_described(plan)}; {current.message}{ended}")


def _shown_best(solution: Solution, allowed: float) -> bool:
    """True if a solution's stationarity shows that J is within the relative error ``allowed`` of its least value."""
    return suboptimality(solution) <= allowed * size_of_cost(solution)


def _explained(
    failed: Solution, problem: ProblemFunctions, guess: Solution | None, parameters: Array | None, options: Options
) -> Solution:
    """A failed solution; one without a feasible point with the constraints that cannot hold, found without arcs."""
    infeasible = SolverOutcome.INFEASIBLE, SolverOutcome.NO_FEASIBLE_POINT
    if failed.status not in infeasible:
        return failed
    plain = solve(problem, failed.nodes, guess=guess, parameters=parameters, options=options)
    return plain if plain.status in infeasible else failed


def _first(
    problem: ProblemFunctions,
    most_nodes: int,
    guess: Solution | None,
    parameters: Array | None,
    budget: Budget,
    options: Options,
) -> tuple[_Plan, Solution]:
    """First grid that the solver solves, and its solution; the last solution if it solves none.

    The grid is that of the guess, or a uniform one, first those that can follow the problem's own guess. A guess that
    is a solution is near. Each second programme from another guess has its rows as stated: which scales lead from a
    guess to a solution, chance decides.
    """
    p = problem.nominal if parameters is None else parameters
    timing, smoothing = Timing(), _SMOOTHING if linear_controls(problem).any() else 0.0

    def plan_on(grid: Grid, count: int, *, near: bool = False) -> _Plan:
        return _Plan(HpMesh.uniform(grid, count), without_structure(problem), smoothing, near=near)

    starts = [(on_breaks(uniform(min(nodes, most_nodes)), problem.breaks), count) for nodes, count in _STARTS]
    plans = list[tuple[_Plan, Solution | GuessedTrajectory | None]]()
    if guess is None:
        starts.sort(key=lambda each: not follows_guess(problem, *each))
        if (simulated := initial_value(problem, p)) is not None:
            plans.append((plan_on(on_breaks(simulated[0], problem.breaks), _STARTS[0][1]), simulated[1]))
    elif len(guess.grid) <= most_nodes:
        grid = with_boundaries(on_breaks(guess.grid, problem.breaks), np.array(problem.breaks), most_nodes)
        plans += [(plan_on(grid, _STARTS[0][1], near=True), guess)] if guess.solves(problem, p) else []
        plans.append((plan_on(grid, _STARTS[0][1]), guess))
    plans += [(plan_on(*each), guess) for each in starts]
    stated = 0
    for plan, own in plans:
        found = plan.solved(problem, own, parameters, budget.left(options), plain_rows=stated % 2 == 1)
        stated += int(not plan.near)
        timing += found.timing
        if found.solved or found.status is SolverOutcome.INFEASIBLE or budget.spent:
            break
    return plan, dataclasses.replace(found, timing=timing)


def _next(
    problem: ProblemFunctions,
    following: _Plan,
    current: Solution,
    errors: IntervalErrors,
    parameters: Array | None,
    budget: Budget,
    options: Options,
) -> tuple[Solution, _Plan, bool]:
    """Solution of the following plan; where the solver fails or goes astray, of an easier one.

    That is the same plan, if it has arcs, from as near as the current solution is; with all controls smoothed; without
    arcs; or the last mesh with a point more. A solution has gone astray to another minimum where its J is larger than
    the errors of the current one explain. The last result is True if no easier plan was needed.
    """
    dearest = current.cost + size_of_cost(current) * max(_ASTRAY, 10.0 * errors.total)
    timing, weight, without = Timing(), _SMOOTHING * abs(current.cost), without_structure(problem)
    last = HpMesh.from_solution(current).with_boundaries(np.array(problem.breaks), len(current.grid))
    nodes = last.with_boundaries(np.append(following.structure.boundaries, problem.breaks), len(current.grid))
    arcs = len(following.structure) > 1
    tries = (
        following,
        *([dataclasses.replace(following, near=not following.near)] if arcs or following.near else []),
        dataclasses.replace(following, smoothing=weight, every=True, near=False),
        _Plan(nodes, without, weight, every=True),
        _Plan(HpMesh(last.grid, last.counts + 1), without, weight, every=True),
    )
    cheapest: tuple[Solution, _Plan] | None = None
    for each in tries:
        found = each.solved(problem, current, parameters, budget.left(options))
        timing += found.timing
        if found.solved and (cheapest is None or found.cost < cheapest[0].cost):
            cheapest = found, each
        if (found.solved and found.cost <= dearest) or budget.spent:
            break
    found, each = cheapest or (found, each)
    return dataclasses.replace(found, timing=timing), each, any(each is one for one in tries[:-3])


def _described(plan: _Plan) -> str:
    arcs = f", {len(plan.structure)} arcs" if len(plan.structure) > 1 else ""
    return f"{len(plan.mesh.grid)} nodes, {plan.mesh.scheme.name}{arcs}"
