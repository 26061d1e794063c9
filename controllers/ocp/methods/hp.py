"""hp refinement with switch detection: degree where a solution is smooth, nodes where it is not, a boundary at a switch.

Each round solves by Radau collocation, compares every interval with its own dynamics under the saturated control (see
``defects``) and reads the solution's structure (see ``structure``). Where controls are held by their bounds, or leave
them, the next programme has arcs whose lengths are unknowns; controls that a bound holds are held. Intervals whose
defect is too large are divided or, where most are, get another point; neighbours that do not need to be two become one.
The rounds end when the defects are small and J no longer changes.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from mathnavi.controllers.ocp.arcs import Arcs
from mathnavi.controllers.ocp.defects import Defects, defects
from mathnavi.controllers.ocp.grid import Grid, uniform
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.replay import replayed
from mathnavi.controllers.ocp.solution import Solution, Timing
from mathnavi.controllers.ocp.solver import FIXED, Options, transcription
from mathnavi.controllers.ocp.structure import Structure, structure
from mathnavi.controllers.ocp.transcriptions.radau import RadauIIA
from mathnavi.controllers.ocp.winding import unwound
from mathnavi.sim.interfaces.signals import Array

OPTIONS = Options(tolerance=1e-11)
FIRST_COUNT, MOST_COUNT = 3, 5  # points of an interval
ROUNDS = 12
_MARGIN = 0.1  # of the tolerance that defects and changes of J may take
_MOST_ARCS = 24
_TRACE = False


@dataclass(frozen=True, eq=False)
class Round:
    """What a round solves: a grid, the points of its intervals, and its structure."""

    grid: Grid
    count: int  # points of each interval
    structure: Structure | None

    def solved(
        self, problem: ProblemFunctions, guess: Solution | None, parameters: Array | None, options: Options
    ) -> Solution:
        arcs = None
        if self.structure is not None and len(self.structure) > 1:
            ends = np.searchsorted(self.grid.nodes, np.append(self.structure.boundaries, 1.0) - 1e-12)
            intervals = tuple(int(n) for n in np.diff(np.append(0, ends)))
            arcs = Arcs(intervals, self.structure.control_bounds(problem))
        made = transcription(
            problem, RadauIIA(self.count), len(self.grid), FIXED, options, 1 if arcs is None else len(arcs)
        )
        return made.solve(guess, self.grid, parameters, arcs)


def hp(
    problem: ProblemFunctions,
    nodes: int = 13,
    *,
    most_nodes: int = 120,
    tolerance: float = 1e-6,
    guess: Solution | None = None,
    parameters: Array | None = None,
    options: Options = OPTIONS,
) -> Solution:
    current, timing = guess, Timing()
    following = Round(uniform(nodes), FIRST_COUNT, None)
    cost, small = math.nan, False
    for number in range(ROUNDS):
        made = following
        found = unwound(made.solved(problem, current, parameters, options))
        timing += found.timing
        if _TRACE:
            print(
                f"   round {number}: N={len(made.grid)} k={made.count} arcs={len(made.structure) if made.structure else 1} {found.status.name} it={found.iterations} J={found.cost:.10g} build {found.timing.build_ms:.0f} solve {found.timing.solve_ms:.0f}",
                end="",
            )
        if not found.ok:
            if _TRACE:
                print()
            break
        errors = interval_errors(found, defects(found))
        seen = structure(found)
        if len(seen) > _MOST_ARCS:
            seen = None
        change = abs(found.cost - cost) / max(abs(found.cost), 1e-9)
        current, cost = found, found.cost
        if _TRACE:
            print(f" err={errors.sum():.1e} change={change:.1e} seen={len(seen) if seen else None}")
            if _TRACE > 1 and seen:
                print(np.column_stack([np.append(seen.boundaries, 1), seen.held]))
        known = made.structure
        same = (seen is None and known is None) or (
            seen is not None and ((known is not None and seen.same(known)) or (known is None and len(seen) == 1))
        )
        small = errors.sum() <= _MARGIN * tolerance
        if same and small and change <= _MARGIN * tolerance:
            break
        if same and not small and len(found.grid) >= most_nodes:
            break
        if same:
            struct = None if known is None else dataclasses.replace(known, boundaries=_boundaries(found, made))
            following = refined(found, made.count, struct, errors, _MARGIN * tolerance, most_nodes)
        else:
            following = Round(with_boundaries(found.grid, seen.boundaries), made.count, seen)
    return replayed(dataclasses.replace(current, method="hp", timing=timing))


def _boundaries(found, made):
    ends = np.searchsorted(made.grid.nodes, made.structure.boundaries - 1e-12)
    return found.grid.nodes[ends]


def interval_errors(solution: Solution, found: Defects) -> Array:
    """Error (N - 1,) of each interval: the larger of its scaled defect and its share in the error of J, relative."""
    scale = max(abs(solution.cost), 1e-9)
    lam = np.vstack([solution.costates[1:], solution.costates[-1:]]) * solution.problem.state_scale
    share = np.abs((np.where(found.states == 0.0, 0.0, found.states) * lam).sum(axis=1) + found.cost) / scale
    return np.maximum(np.abs(found.states).max(axis=1), share)


def refined(solution, count, struct, errors, target, most_nodes):
    grid = solution.grid
    each = target / len(errors)
    flagged = errors > each
    if count < MOST_COUNT and (flagged.sum() == 0 or flagged.mean() > 0.5) and errors.max() < 1e-2:
        return Round(grid, count + 1, struct)
    if not flagged.any():
        flagged = np.ones(len(errors), dtype=bool)
    flagged &= grid.widths > 1e-8
    parts = np.where(
        flagged, np.clip(np.ceil((np.minimum(errors, 1e3) / each) ** (1.0 / (2 * count))), 2, 4), 1
    ).astype(int)
    while parts.sum() > most_nodes - 1 and parts.max() > 1:
        parts[np.flatnonzero(parts > 1)[np.argmin(errors[parts > 1])]] = 1
    pieces = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(grid.nodes[:-1], grid.nodes[1:], parts, strict=True)]
    return Round(Grid(np.append(np.concatenate(pieces), 1.0)), count, struct)


def with_boundaries(grid: Grid, boundaries: Array) -> Grid:
    """The grid with a node at each boundary, in the place of those that are too near."""
    nodes = grid.nodes[1:-1]
    if len(boundaries):
        width = np.interp(nodes, 0.5 * (grid.nodes[1:] + grid.nodes[:-1]), grid.widths)
        nodes = nodes[np.abs(nodes[:, None] - boundaries).min(axis=1) > 0.4 * width]
    return Grid(np.unique(np.concatenate([[0.0], nodes, boundaries, [1.0]])))
