"""Bound on the error of J: J on two finer meshes.

Every interval is cut into k = 2 and into k = 3, and the problem is solved again by Radau collocation from the solution,
without arcs. Where these meshes resolve the solution, J - J_k is the error of J but for a higher order, and

    E = max(1.5 max(|J - J_2|, |J - J_3|), 2e-8 J_s),        J_s = max(|J|, ∫_0^T |L| dt),

bounds it. Two meshes, for a switch may lie near a node of one of them. The least E is what a solver's relaxation of the
bounds leaves. J_s is the size of J; where J and L vanish the bound is absolute.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from mathnavi.controllers.ocp.defects import running_costs
from mathnavi.controllers.ocp.grid import Grid
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.solver import FIXED, Options, transcription
from mathnavi.controllers.ocp.transcriptions.variable_radau import VariableRadauIIA, point_counts

PARTS = (2, 3)
"""numbers k of parts into which every interval is cut"""
LEAST_BOUND = 2e-8
"""least E over J_s"""

_FACTOR = 1.5
_POINTS = 3, 7  # least and largest number of points of an interval
_ANOTHER = 1e-2  # of J_s
_LEAST_SIZE = 1e-9  # of J_s, in units of J: below this nothing but rounding is left


@dataclass(frozen=True, eq=False)
class CostBound:
    """Bound E on the error of J, infinite where a finer mesh was not solved, and J_s, both in units of J."""

    bound: float
    size: float
    finer: Solution  # on the mesh cut into 2, solved or not; in 3 where that is in a lower minimum


def cost_size(solution: Solution) -> float:
    """J_s, in units of J."""
    at, shares = solution.point_times.ravel(), solution.point_shares
    x, u = solution.inner.reshape(len(at), -1), solution.u.reshape(len(at), solution.problem.nu)
    gathered = float((np.abs(running_costs(solution, x, u, at)).reshape(shares.shape) * shares).sum())
    return max(abs(solution.cost), gathered if math.isfinite(gathered) else 0.0, _LEAST_SIZE)


def cost_bound(solution: Solution, options: Options) -> CostBound:
    """Bound the error of a solution's J; ``options`` are those of the solver on the finer meshes."""
    size = cost_size(solution)
    finer = [on_finer_mesh(solution, parts, options) for parts in PARTS]
    if not all(each.solved for each in finer):
        return CostBound(math.inf, size, finer[0])
    difference = max(abs(solution.cost - each.cost) for each in finer)
    # The finer ones are in another minimum where they differ by more than their meshes explain.
    best = min(finer, key=lambda each: each.cost) if difference > _ANOTHER * size else finer[0]
    return CostBound(max(_FACTOR * difference, LEAST_BOUND * size), size, best)


def on_finer_mesh(solution: Solution, parts: int, options: Options) -> Solution:
    """Solve the problem from a solution on its mesh with each interval cut into ``parts``; without a replay."""
    fractions = np.arange(parts) / parts
    nodes = (solution.grid.nodes[:-1, None] + fractions * solution.grid.widths[:, None]).ravel()
    grid = Grid(np.append(nodes, 1.0))
    counts = np.broadcast_to(np.clip(point_counts(solution.scheme), *_POINTS), solution.nodes - 1)
    scheme = VariableRadauIIA(tuple(np.repeat(counts, parts).tolist()))
    for warm in (True, False):  # near a solution a large barrier leads away from it
        chosen = dataclasses.replace(options, warm=warm)
        found = transcription(solution.problem, scheme, len(grid), FIXED, chosen).solve(
            solution, grid, solution.parameters
        )
        if found.solved:
            break
    return found
