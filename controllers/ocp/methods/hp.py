"""hp refinement with switch detection: more points where a solution is smooth, nodes where not, a boundary at a switch.

Each round solves by Radau collocation, compares every interval with its own dynamics under the saturated control (see
``defects``) and reads the solution's structure (see ``structure``). Where controls are held by their bounds, or leave
them, the next programme has arcs whose lengths are unknowns; a control that a bound holds is held there. A control that
enters linearly and is free, on a singular arc, is kept from ringing by a small weight ρ on what it varies within an
interval beside its straight line: J is at most ρ times that variation above its least value, and ρ falls until this is
below the tolerance. The rounds end when the defects are small and J no longer changes.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from mathnavi.controllers.ocp.arcs import Arcs
from mathnavi.controllers.ocp.defects import defects
from mathnavi.controllers.ocp.grid import Grid, check_nodes, uniform
from mathnavi.controllers.ocp.methods.hp_mesh import interval_errors, meshed, with_boundaries
from mathnavi.controllers.ocp.nlp import SHORTEST_ARC, variation
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.replay import replayed
from mathnavi.controllers.ocp.solution import Solution, Timing
from mathnavi.controllers.ocp.solver import FIXED, Options, transcription
from mathnavi.controllers.ocp.structure import Structure, linear_controls, structure, without_structure
from mathnavi.controllers.ocp.transcriptions.radau import RadauIIA
from mathnavi.controllers.ocp.winding import unwound
from mathnavi.sim.interfaces.errors import ProblemError
from mathnavi.sim.interfaces.signals import Array

OPTIONS = Options(tolerance=1e-11)
"""tighter than that of other methods: what is compared from round to round is J"""
TOLERANCE = 1e-6
MOST_NODES = 200

_STARTS = ((13, 3), (25, 3), (41, 2))  # nodes and points of an interval, until one is solved
_ROUNDS = 14
_MARGIN = 0.1  # of the tolerance that the defects, and a change of J, may take
_MOST_ARCS = 30
_MOST_VISITS = 2  # to the same structure, before the rounds stay with it
_SMOOTHING = 1e-2  # first weight ρ, over |J|


@dataclass(frozen=True, eq=False)
class _Plan:
    """What a round solves: a grid, the points of its intervals, its structure and the smoothing of free controls."""

    grid: Grid
    count: int  # points of each interval
    structure: Structure
    smoothing: float  # ρ, in units of J

    def solved(
        self, problem: ProblemFunctions, guess: Solution | None, parameters: Array | None, options: Options
    ) -> Solution:
        known = self.structure
        ends = np.searchsorted(self.grid.nodes, np.append(known.boundaries, 1.0) - 1e-12)
        intervals = tuple(int(n) for n in np.diff(np.append(0, ends)))
        free = linear_controls(problem) & (known.held[:, : problem.nu] == 0)
        arcs = Arcs(intervals, *known.limits(problem), np.where(free, self.smoothing, 0.0))
        made = transcription(problem, RadauIIA(self.count), len(self.grid), FIXED, options, len(known))
        return unwound(made.solve(guess, self.grid, parameters, arcs))

    def added(self, solution: Solution) -> float:
        """What the smoothing adds to J: J is at most as much above its least value."""
        u, linear = solution.u / solution.problem.control_scale, linear_controls(solution.problem)
        return self.smoothing * float(np.einsum("kl,ikm,ilm->m", variation(solution.scheme), u, u)[linear].sum())

    def placed(self, solution: Solution) -> Structure:
        """The structure with its boundaries where a solution put them, without arcs that became as good as nothing."""
        ends = np.searchsorted(self.grid.nodes, self.structure.boundaries - 1e-12)
        moved = dataclasses.replace(self.structure, boundaries=solution.grid.nodes[ends])
        return moved.without_arcs_below(100.0 * SHORTEST_ARC)


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
        guess: a solution to start from, on any grid; None for the problem's own guess.
        parameters: (np,) values of the problem's parameters; None for the nominal ones.
        options: solver and its tolerance.

    Returns:
        The solution with its replay; its message says what was found and whether the tolerance was reached.

    Raises:
        ProblemError: for fewer than two nodes and a tolerance that is not positive.
    """
    if not (math.isfinite(tolerance) and tolerance > 0.0):
        raise ProblemError(f"tolerance = {tolerance!r}; allowed: a finite value > 0")
    check_nodes(most_nodes, "most_nodes")
    plan, current = _first(problem, most_nodes, guess, parameters, options)
    timing, change, visits, refused = current.timing, math.inf, [], False
    if not current.solved:
        return dataclasses.replace(current, method="hp")
    for number in range(_ROUNDS):
        errors = interval_errors(current, defects(current))
        allowed = _MARGIN * tolerance
        seen, own = structure(current), plan.placed(current)
        visits.append(own.held)
        known = sum(np.array_equal(seen.held, held) for held in visits)
        settled = refused or seen.same(own) or known >= _MOST_VISITS or len(seen) > _MOST_ARCS
        small = errors.total <= allowed and errors.path.max(initial=0.0) <= allowed
        smooth = plan.added(current) <= tolerance * abs(current.cost)
        if settled and small and smooth and change <= allowed:
            break
        rho = plan.smoothing if number else _SMOOTHING * abs(current.cost)
        if settled:
            if small and not smooth:
                rho *= 0.1
            following = _Plan(*meshed(current, own, errors, allowed, most_nodes), own, rho)
        else:
            following = _Plan(with_boundaries(current.grid, seen.boundaries), plan.count, seen, rho)
        found = following.solved(problem, current, parameters, options)
        timing += found.timing
        if not found.solved:
            if refused or len(following.structure) == 1:
                break
            refused = True  # the arcs do not help: go on without them
            nodes = with_boundaries(current.grid, following.structure.boundaries)
            following = _Plan(nodes, plan.count, without_structure(problem), rho)
            found = following.solved(problem, current, parameters, options)
            timing += found.timing
            if not found.solved:
                break
        change = abs(found.cost - current.cost) / max(abs(found.cost), 1e-9)
        stuck = (
            len(found.grid) >= most_nodes and len(following.grid) == len(plan.grid) and following.count == plan.count
        )
        plan, current = following, found
        if stuck and change <= allowed:
            break
    message = _message(plan, change)
    return replayed(dataclasses.replace(current, method="hp", message=message, timing=timing))


def _first(
    problem: ProblemFunctions, most_nodes: int, guess: Solution | None, parameters: Array | None, options: Options
) -> tuple[_Plan, Solution]:
    """The first uniform grid that the solver manages, and its solution; the last one's if it manages none."""
    timing = Timing()
    for nodes, count in _STARTS:
        grid = guess.grid if guess is not None and len(guess.grid) <= most_nodes else uniform(min(nodes, most_nodes))
        plan = _Plan(grid, count, without_structure(problem), _SMOOTHING if linear_controls(problem).any() else 0.0)
        found = plan.solved(problem, guess, parameters, options)
        timing += found.timing
        if found.solved:
            break
    return plan, dataclasses.replace(found, timing=timing)


def _message(plan: _Plan, change: float) -> str:
    arcs = f", {len(plan.structure)} arcs" if len(plan.structure) > 1 else ""
    return f"{len(plan.grid)} nodes, {RadauIIA(plan.count).name}{arcs}; J changed by {change:.1g} in the last round"
