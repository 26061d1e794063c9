"""Errors of the intervals of a solution, and the mesh that they ask for."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mathnavi.controllers.ocp.defects import Defects
from mathnavi.controllers.ocp.grid import Grid
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.structure import Structure
from mathnavi.sim.interfaces.signals import Array

TINY = 1e-9  # |J| below which its error is no longer relative
MOST_COUNT = 5  # points of an interval
_MOST_PARTS = 4  # of an interval in one round
_NARROWEST = 1e-8  # interval that is still divided, as a fraction of T
VIOLATION = 5.0  # times the allowed sum of errors, a violation may stay
_ASYMPTOTIC = 1e-2  # error below which another point helps more than another node
_KEPT = 0.4  # of an interval's width that a node keeps from a boundary


@dataclass(frozen=True, eq=False)
class Errors:
    """Errors (N - 1,) of each interval."""

    own: Array  # the larger of its scaled defect and its relative share in the error of J
    path: Array  # scaled violation of the states' bounds and path constraints between points

    @property
    def total(self) -> float:
        """Sum of the intervals' own errors."""
        return float(self.own.sum())


def interval_errors(solution: Solution, found: Defects) -> Errors:
    """Errors of the intervals of a solution, from its defects."""
    scale = max(abs(solution.cost), TINY)
    after = np.vstack([solution.costates[1:], solution.costates[-1:]]) * solution.problem.state_scale
    with np.errstate(invalid="ignore"):
        share = np.abs((found.states * after).sum(axis=1) + found.cost) / scale
    own = np.maximum(np.abs(found.states).max(axis=1), share)
    return Errors(np.where(np.isnan(own), np.inf, own), found.path)


def meshed(
    solution: Solution, structure: Structure, errors: Errors, allowed: float, most_nodes: int
) -> tuple[Grid, int]:
    """Grid and number of points of the next round, with the boundaries of a structure among its nodes.

    Args:
        solution: the last round's.
        structure: arcs of the next round.
        errors: of the solution's intervals.
        allowed: sum of the intervals' own errors that may stay, and a fifth of the largest violation.
        most_nodes: limit of the number of nodes.
    """
    count, nodes, widths = len(solution.scheme.points), solution.grid.nodes, solution.grid.widths
    each = allowed / len(widths)
    large, violated = errors.own > each, errors.path > VIOLATION * allowed
    if not violated.any() and errors.total < _ASYMPTOTIC and count < MOST_COUNT and not 0.0 < large.mean() <= 0.5:
        return with_boundaries(solution.grid, structure.boundaries), count + 1
    order = 2 * count
    parts = np.where(large, np.ceil((np.minimum(errors.own, 1.0) / each) ** (1.0 / order)), 1.0)
    parts = np.where(large, np.clip(parts, 2, _MOST_PARTS), 1).astype(int)
    parts[violated] = np.maximum(parts[violated], 2)
    if not (large.any() or violated.any()):
        parts[:] = 2
    parts[widths < _NARROWEST] = 1
    # Where a constraint is felt, neighbours stay: joined, they would violate it and be divided again.
    own = errors.own + np.where(errors.path > 0.0, each, 0.0)
    kept = _without_idle(nodes, own, parts, each, structure.boundaries, order)
    spare = most_nodes - len(kept)
    pieces = []
    worst = np.argsort(-np.where(parts > 1, errors.own + errors.path, -1.0))
    granted = np.ones_like(parts)
    for i in worst:
        granted[i] = min(parts[i], 1 + max(0, spare))
        spare -= granted[i] - 1
    for start, end in pairwise(kept):
        i = int(np.searchsorted(nodes, start + 1e-15, side="right")) - 1
        n = granted[i] if end - start <= 1.0000001 * widths[i] else 1
        pieces.append(np.linspace(start, end, n + 1)[:-1])
    return with_boundaries(Grid(np.append(np.concatenate(pieces), 1.0)), structure.boundaries), count


def _without_idle(nodes: Array, own: Array, parts: Array, each: float, boundaries: Array, order: int) -> Array:
    """The nodes without those between two intervals whose error would be below ``each`` as one."""
    keep = np.ones(len(nodes), dtype=bool)
    i = 0
    while i + 1 < len(own) and len(nodes) > 20:
        joined = (own[i] + own[i + 1]) * 2.0**order
        at_boundary = len(boundaries) and np.abs(boundaries - nodes[i + 1]).min() < 1e-12
        if joined < each and parts[i] == parts[i + 1] == 1 and not at_boundary:
            keep[i + 1] = False
            i += 1
        i += 1
    return nodes[keep]


def with_boundaries(grid: Grid, boundaries: Array) -> Grid:
    """The grid with a node at each boundary, in the place of those that are too near."""
    if not len(boundaries):
        return grid
    nodes = grid.nodes[1:-1]
    width = np.minimum(grid.widths[1:], grid.widths[:-1])
    distance = np.abs(nodes[:, None] - boundaries).min(axis=1)
    nodes = nodes[distance > _KEPT * width]
    return Grid(np.unique(np.concatenate([[0.0], nodes, boundaries, [1.0]])))
