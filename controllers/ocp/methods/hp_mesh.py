"""Errors of the intervals of a solution, and the mesh that follows from them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from mathnavi.controllers.ocp.defects import Defects
from mathnavi.controllers.ocp.grid import LEAST_WIDTH, Grid
from mathnavi.controllers.ocp.methods.switching_gaps import switches_at_nodes
from mathnavi.controllers.ocp.replay import least_cost
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.structure import Structure
from mathnavi.controllers.ocp.transcriptions.collocation import RadauIIA
from mathnavi.controllers.ocp.transcriptions.variable_radau import VariableRadauIIA, alike, point_counts
from mathnavi.interfaces.signals import Array, Integers

LEAST_COUNT, MOST_COUNT = 3, 5  # points of an interval where all get one more
HIGHEST_COUNT = 9  # points of an interval that is smooth
_MOST_PARTS = 4  # of an interval in one round
_NARROWEST = 1e-8  # interval that is still divided, as a fraction of T
VIOLATION = 5.0  # times the allowed sum of errors, a violation may stay
_ASYMPTOTIC = 1e-2  # error below which another point helps more than another node
_SMOOTH = 0.2  # decay of the Legendre coefficients below which an interval gets points, not nodes
_FASTEST = 1e-3  # decay that counts: coefficients at rounding say nothing
_IDLE = 1e-2  # of the allowed error, that of an interval without one of its points
_VANISHING = 1e-5  # of the scale of J: |J| below which its error is no longer relative
_KEPT = 0.4  # of an interval's width that a node keeps from a boundary


@dataclass(frozen=True, eq=False)
class IntervalErrors:
    """Errors (N - 1,) of each interval."""

    own: Array  # the larger of its scaled defect and its relative share in the error of J
    path: Array  # scaled violation of the states' bounds and path constraints between points, but for those in:
    held: Array  # that of constraints on a control that hold throughout: as smooth as this control
    gaps: Array  # relative share in J that a switch inside of it costs, part of ``own``

    @property
    def total(self) -> float:
        """Sum of the intervals' own errors."""
        return float(self.own.sum())


@dataclass(frozen=True, eq=False)
class HpMesh:
    """A mesh: the nodes of a grid and the number of points of each interval, the degree of its controls plus one."""

    grid: Grid
    counts: Integers  # (N - 1,)

    @staticmethod
    def from_solution(solution: Solution) -> HpMesh:
        """The mesh of a solution by Radau collocation, its nodes where the solution has put them, however near."""
        return HpMesh(solution.grid, np.broadcast_to(point_counts(solution.scheme), solution.nodes - 1))

    @staticmethod
    def uniform(grid: Grid, count: int) -> HpMesh:
        """The mesh whose intervals all have ``count`` points."""
        return HpMesh(grid, np.full(len(grid) - 1, count))

    @cached_property
    def scheme(self) -> RadauIIA | VariableRadauIIA:
        """Radau collocation on this mesh."""
        if (self.counts == self.counts[0]).all():
            return RadauIIA(int(self.counts[0]))
        return VariableRadauIIA(tuple(self.counts.tolist()))

    def with_boundaries(self, boundaries: Array, most_nodes: int) -> HpMesh:
        """The mesh with a node at each boundary (k,) of ]0, 1[, see the function; points as were in the middle.

        No interval of it is narrower than ``LEAST_WIDTH``.
        """
        grid = with_boundaries(self.grid, boundaries, most_nodes)
        middles = 0.5 * (grid.nodes[1:] + grid.nodes[:-1])
        return HpMesh(grid, self.counts[np.searchsorted(self.grid.nodes, middles, side="right") - 1])

    def same(self, other: HpMesh) -> bool:
        """True if both have as many intervals with the same numbers of points."""
        return np.array_equal(self.counts, other.counts)


def size_of_cost(solution: Solution) -> float:
    """|J|, or where it all but vanishes, as that of a fit without noise, a small share of the size of its terms."""
    return max(abs(solution.cost), _VANISHING * least_cost(solution))


def interval_errors(solution: Solution, found: Defects, gaps: Array | None = None) -> IntervalErrors:
    """Errors of the intervals of a solution, from its defects and, where given, its ``switching_gaps`` (N - 1,)."""
    scale = size_of_cost(solution)
    after = np.vstack([solution.costates[1:], solution.costates[-1:]]) * solution.problem.state_scale
    with np.errstate(invalid="ignore"):
        share = np.abs((found.states * after).sum(axis=1) + found.cost) / scale
    relative = np.zeros(len(share)) if gaps is None else gaps / scale
    own = np.maximum(np.abs(found.states).max(axis=1), np.maximum(share, relative))
    return IntervalErrors(np.where(np.isnan(own), np.inf, own), found.path, found.held, relative)


def meshed(
    solution: Solution, structure: Structure, errors: IntervalErrors, allowed: float, most_nodes: int, *, hard: bool
) -> HpMesh:
    """Mesh of the next round, with the boundaries of a structure among its nodes.

    Where the error is too large nearly everywhere, all intervals get a point more. Else each one whose error is too
    large gets points where its solution is smooth, nodes where it is not; one whose error would be small enough with
    a point less loses it, and neighbours whose error would be small enough as one are joined. One with a switch inside
    is divided, and a node at which a control switches is kept.

    Args:
        solution: the last round's.
        structure: arcs of the next round.
        errors: of the solution's intervals.
        allowed: sum of the intervals' own errors that may stay, and a fifth of the largest violation.
        most_nodes: limit of the number of nodes.
        hard: True if a solve failed before: the mesh grows more slowly.
    """
    mesh = HpMesh.from_solution(solution)
    fixed = np.concatenate([structure.boundaries, solution.problem.breaks])
    if errors.gaps.any():
        fixed = np.concatenate([fixed, switches_at_nodes(solution)])
    fixed = np.unique(fixed)
    counts, nodes, widths = mesh.counts, mesh.grid.nodes, mesh.grid.widths
    each = allowed / len(widths)
    asymptotic = errors.total < _ASYMPTOTIC
    errors = dataclasses.replace(errors, own=np.maximum(errors.own, each / (VIOLATION * allowed) * errors.held))
    large, violated = errors.own > each, errors.path > VIOLATION * allowed
    everywhere = not 0.0 < large.mean() <= 0.5
    full, switching = len(nodes) >= most_nodes, errors.gaps > each
    if (counts < MOST_COUNT).any() and ((everywhere and asymptotic and not (violated | switching).any()) or full):
        raised = np.where(counts < MOST_COUNT, counts + 1, counts)
        return HpMesh(mesh.grid, raised).with_boundaries(fixed, most_nodes)
    # Two parts with a point more each, for want of both.
    both = everywhere and not asymptotic and bool((counts < MOST_COUNT).any()) and not switching.any()
    decays = _decays(solution)
    counts, raised = _degrees(counts, decays, errors, each, large & ~violated & ~switching, both=both)
    order = 2 * mesh.counts
    parts = np.where(large, np.ceil((np.minimum(errors.own, 1.0) / each) ** (1.0 / order)), 1.0)
    parts = np.where(large & ~raised, np.clip(parts, 2, 2 if hard or both else _MOST_PARTS), 1).astype(int)
    parts[violated] = np.maximum(parts[violated], 2)
    parts[switching] = _MOST_PARTS
    if not (large.any() or violated.any()):
        parts[:] = 2
    parts[widths < _NARROWEST] = 1
    # Where a constraint is active, neighbours stay: joined, they would violate it and be divided again.
    own = errors.own + np.where(errors.path > 0.0, each, 0.0)
    kept = _without_idle(nodes, own, parts, counts, each, fixed)
    spare = most_nodes - len(kept)
    pieces, of_pieces = [], []
    worst = np.argsort(-np.where(parts > 1, errors.own + errors.path, -1.0))
    granted = np.ones_like(parts)
    for i in worst:
        granted[i] = min(parts[i], 1 + max(0, spare))
        spare -= granted[i] - 1
    for start, end in pairwise(kept):
        i = int(np.searchsorted(nodes, start, side="right")) - 1
        n = granted[i] if end - start <= 1.0000001 * widths[i] else 1
        pieces.append(np.linspace(start, end, n + 1)[:-1])
        of_pieces += [counts[i]] * n
    grid = Grid(np.append(np.concatenate(pieces), 1.0))
    return HpMesh(grid, np.array(of_pieces)).with_boundaries(fixed, most_nodes)


def _degrees(
    counts: Integers, decays: Array, errors: IntervalErrors, each: float, large: NDArray[np.bool_], *, both: bool
) -> tuple[Integers, NDArray[np.bool_]]:
    """Numbers of points (N - 1,) of the next round, and which intervals (N - 1,) these make accurate enough.

    A point more makes the error of an interval smaller by the square of its decay, a point less larger by as much.
    """
    if both:
        return np.minimum(counts + 1, np.maximum(counts, MOST_COUNT)), np.zeros(len(counts), dtype=bool)
    gain = -2.0 * np.log(decays)
    wanted = np.ceil(np.log(np.maximum(np.minimum(errors.own, 1.0) / each, 1.0)) / np.maximum(gain, 1e-9))
    raised = large & (decays <= _SMOOTH) & (counts + wanted <= HIGHEST_COUNT)
    spare = (counts > LEAST_COUNT) & (errors.own / decays**2 < _IDLE * each) & (errors.path <= 0.0)
    return np.where(raised, counts + np.where(raised, wanted, 0.0), counts - spare).astype(np.int64), raised


def _decays(solution: Solution) -> Array:
    """Decay (N - 1,) of the Legendre coefficients of rates and controls in each interval, from one to the next."""
    scales = solution.problem.state_scale / solution.duration, solution.problem.control_scale
    values = np.concatenate([solution.rates / scales[0], solution.u / scales[1]], axis=2)
    found = np.ones(solution.nodes - 1)
    for scheme, intervals in alike(solution.scheme, solution.nodes - 1):
        k = len(scheme.points)
        coefficients = np.linalg.inv(legvander(2.0 * np.array(scheme.points) - 1.0, k - 1)) @ values[intervals, :k]
        sizes = np.abs(coefficients).max(axis=2)
        steps = 1 if k < 4 else 2  # the mean carries no information on the decay
        before = np.maximum(sizes[:, -1 - steps], np.finfo(float).tiny)
        found[intervals] = np.clip((sizes[:, -1] / before) ** (1.0 / steps), _FASTEST, 1.0)
    return found


def _without_idle(nodes: Array, own: Array, parts: Integers, counts: Integers, each: float, boundaries: Array) -> Array:
    """The nodes without those between two intervals of as many points whose error would be below ``each`` as one."""
    keep = np.ones(len(nodes), dtype=bool)
    i = 0
    while i + 1 < len(own) and len(nodes) > 20:
        joined = (own[i] + own[i + 1]) * 4.0 ** counts[i]
        at_boundary = len(boundaries) and np.abs(boundaries - nodes[i + 1]).min() < 1e-12
        if joined < each and parts[i] == parts[i + 1] == 1 and counts[i] == counts[i + 1] and not at_boundary:
            keep[i + 1] = False
            i += 1
        i += 1
    return nodes[keep]


def with_boundaries(grid: Grid, boundaries: Array, most_nodes: int) -> Grid:
    """The grid with a node at each boundary (k,) in ]0, 1[, in place of those too near or, in all, too many.

    Arcs that shrink take their intervals with them, the more the more often they do: nodes nearer than ``LEAST_WIDTH``
    to another one, or to a boundary, are left out.
    """
    if not len(boundaries):
        return _apart(grid.nodes[1:-1], np.array([0.0, 1.0]))
    nodes = grid.nodes[1:-1]
    width = np.minimum(grid.widths[1:], grid.widths[:-1])
    distance = np.abs(nodes[:, None] - boundaries).min(axis=1)
    nodes, distance = nodes[distance > _KEPT * width], distance[distance > _KEPT * width]
    spare = max(0, most_nodes - 2 - len(boundaries))
    nodes = nodes[np.sort(np.argsort(-distance, kind="stable")[:spare])]
    return _apart(nodes, np.unique(np.concatenate([[0.0], boundaries, [1.0]])))


def _apart(nodes: Array, fixed: Array) -> Grid:
    """The grid of the ``fixed`` nodes, the ends among them, and those of ``nodes`` that keep the least width."""
    kept = nodes[np.abs(nodes[:, None] - fixed).min(axis=1, initial=1.0) >= LEAST_WIDTH]
    chosen = [True] * len(kept)
    last = -1.0
    for k, node in enumerate(kept):
        chosen[k] = node - last >= LEAST_WIDTH
        last = node if chosen[k] else last
    return Grid(np.union1d(fixed, kept[chosen]))
