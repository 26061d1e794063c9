"""Grids: partitions 0 = τ_1 < ... < τ_N = 1 of the interval [0, T], as fractions τ = t / T (thesis, p of B.3)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array

_DENSE = 2001  # samples of a monitor function in an equidistributed grid

LEAST_WIDTH = 1e-9
"""least width of an interval, as a fraction of T, of a grid that a method makes: narrower ones end in rounding"""


@dataclass(frozen=True, eq=False)
class Grid:
    """A grid of N >= 2 nodes τ_i, increasing from 0 to 1; ProblemError for any other numbers."""

    nodes: Array  # (N,) fractions of T

    def __post_init__(self) -> None:
        nodes = np.asarray(self.nodes, float)
        if nodes.ndim != 1 or len(nodes) < 2:
            raise ProblemError(f"grid: {nodes.size} nodes; allowed: N >= 2")
        if not np.isfinite(nodes).all() or nodes[0] != 0.0 or nodes[-1] != 1.0 or (np.diff(nodes) <= 0.0).any():
            raise ProblemError(f"grid: nodes = {nodes.tolist()}; allowed: numbers that increase from 0 to 1")
        object.__setattr__(self, "nodes", nodes)

    def __len__(self) -> int:
        return len(self.nodes)

    @property
    def widths(self) -> Array:
        """Widths (N - 1,) of the intervals as fractions of T, d_i / T."""
        return np.diff(self.nodes)


def uniform(n: int) -> Grid:
    """The grid of n equidistant nodes, w = 1; ProblemError for n < 2."""
    return Grid(np.linspace(0.0, 1.0, check_nodes(n)))


def stretched(n: int, ratio: float) -> Grid:
    """The grid of n nodes whose intervals grow by ``ratio``, d_{i+1} = ratio d_i: dense at the start, sparse later.

    Example B.2's intent. ProblemError for n < 2 and for a ratio that is not finite and positive.
    """
    if not (math.isfinite(ratio) and ratio > 0.0):
        raise ProblemError(f"grid: ratio = {ratio!r}; allowed: a finite value > 0")
    widths = ratio ** np.arange(check_nodes(n) - 1, dtype=float)
    return from_widths(widths)


def given(nodes: Sequence[float] | Array) -> Grid:
    """The grid of given nodes (N,), in any unit and from any start, τ_i = (t_i - t_1) / (t_N - t_1).

    ProblemError for fewer than two nodes and for nodes that do not increase.
    """
    values = np.asarray(nodes, float)
    if values.ndim != 1 or len(values) < 2 or not values[-1] > values[0]:
        raise ProblemError(f"grid: nodes = {values.tolist()}; allowed: at least two numbers that increase")
    fractions = (values - values[0]) / (values[-1] - values[0])
    return Grid(fractions)


def from_widths(widths: Array) -> Grid:
    """The grid whose intervals have widths (N - 1,) > 0 in any unit, τ_i = Σ_{j<i} d_j / Σ d_j."""
    ends = np.cumsum(widths)
    nodes = np.concatenate([[0.0], ends / ends[-1]])
    nodes[-1] = 1.0
    return Grid(nodes)


def widened(widths: Array, least: float) -> Grid:
    """The grid whose intervals have widths (N - 1,), but none less than a fraction ``least`` of their sum."""
    return from_widths(np.maximum(widths, least * widths.sum()))


def equidistributed(n: int, monitor: Callable[[Array], Array], breaks: Array | None = None) -> Grid:
    """The grid of n nodes between which the integral of a monitor function w(τ) > 0 is the same (B.3).

        ∫_{τ_i}^{τ_{i+1}} w dτ = 1 / (N - 1) ∫_0^1 w dτ.

    ``monitor`` maps fractions (k,) to values (k,). It is sampled densely, and more densely between ``breaks`` (the
    nodes (N',) of the grid that it was computed on), so that a narrow peak is found. Raises ProblemError if w is not
    finite and positive, and for n < 2.
    """
    count = check_nodes(n)
    if count == 2:
        return uniform(2)
    samples = np.linspace(0.0, 1.0, _DENSE)
    if breaks is not None:
        parts = np.linspace(0.0, 1.0, 21)[:-1]
        samples = np.unique(np.concatenate([samples, (breaks[:-1, None] + parts * np.diff(breaks)[:, None]).ravel()]))
    middles = 0.5 * (samples[:-1] + samples[1:])
    w = np.asarray(monitor(middles), float)
    if w.shape != middles.shape or not np.isfinite(w).all() or (w <= 0.0).any():
        raise ProblemError(f"monitor: values between {np.min(w):g} and {np.max(w):g}; allowed: finite numbers > 0")
    mass = np.concatenate([[0.0], np.cumsum(w * np.diff(samples))])
    nodes = np.interp(np.linspace(0.0, mass[-1], count), mass, samples)
    nodes[0], nodes[-1] = 0.0, 1.0
    return Grid(nodes) if np.diff(nodes).min() >= LEAST_WIDTH else widened(np.diff(nodes), LEAST_WIDTH)


def split(grid: Grid, parts: Sequence[int]) -> Grid:
    """The grid with each interval i divided into ``parts[i]`` >= 1 equal ones (h-refinement); N - 1 parts."""
    pieces = [np.linspace(a, b, k + 1)[:-1] for a, b, k in zip(grid.nodes[:-1], grid.nodes[1:], parts, strict=True)]
    return Grid(np.concatenate([*pieces, [1.0]]))


def on_breaks(grid: Grid, breaks: Sequence[float]) -> Grid:
    """The grid with a node at each break (k,) of ]0, 1[: the nearest nodes are moved there, the others go with them.

    It has as many nodes as before, or k + 2 where these are more.
    """
    if not len(breaks):
        return grid
    at = np.array(breaks)
    nodes = grid.nodes if len(grid) >= len(at) + 2 else np.linspace(0.0, 1.0, len(at) + 2)
    nearest = np.searchsorted(0.5 * (nodes[1:] + nodes[:-1]), at)
    order = np.arange(len(at))
    # Each takes a node of its own, and leaves enough for those before and after it.
    moved = np.maximum.accumulate(np.maximum(nearest, 1 + order) - order) + order
    moved = np.minimum(moved, len(nodes) - 1 - len(at) + order)
    placed = np.interp(nodes, [0.0, *nodes[moved], 1.0], [0.0, *at, 1.0])
    placed[moved] = at
    return Grid(placed)


def check_breaks(name: str, n: int, breaks: Sequence[float]) -> None:
    """Raise ProblemError, with the problem's ``name``, where n nodes are too few for a node at each break."""
    if n < len(breaks) + 2:
        raise ProblemError(
            f"{name}: nodes = {n}; allowed: at least {len(breaks) + 2}, one at each of the {len(breaks)} times of "
            "at(), of tables, and of breaks, and at both ends"
        )


def check_nodes(n: int, name: str = "nodes") -> int:
    """The number of nodes n as an int; ProblemError, with the argument's name, unless it is a whole number >= 2."""
    if isinstance(n, bool) or not isinstance(n, (int, np.integer)) or n < 2:
        raise ProblemError(f"{name} = {n!r}; allowed: a whole number N >= 2")
    return int(n)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Interval i of the grid, 1 <= i <= N - 1, symbolic; S = diag(scales of the states), D_i = d_i (N - 1) / T."""

    count: int  # N - 1, the number of intervals
    index: ca.SX  # () i - 1, from 0
    relative_width: ca.SX  # () D_i, 1 on a uniform grid
    duration: ca.SX  # () T [s]
    chord: ca.SX  # (nx,) S^-1 (x_{i+1} - x_i)
    second_derivative: ca.SX  # (nx,) S^-1 T^2 (f_{i+1} - f_i) / d_i with respect to τ = t / T
