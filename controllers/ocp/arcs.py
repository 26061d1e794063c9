"""Arcs: parts of [0, T] whose lengths are unknowns of the programme, so that a control switches exactly at a node.

A control that jumps or has a kink inside an interval costs any transcription its order. The grid is therefore divided
into arcs a = 1 ... A of whole intervals; their lengths δ_a are unknowns, and a node is at

    t_i = Σ_a E_ia δ_a,      d_i = Σ_a W_ia δ_a,      Σ_a δ_a = T,

W_ia the interval's fixed share of the arc it belongs to, E_i the sum of the W before it. On an arc where a control is
known to rest on a bound it is held there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mathnavi.controllers.ocp.grid import Grid, widened
from mathnavi.controllers.ocp.problem_functions import Interval
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array, Integers

_ROUNDING = 1e-13  # width of an interval, as a fraction of T, below which two nodes may round to one


@dataclass(frozen=True, eq=False)
class Arcs:
    """Arcs of a grid: the number of intervals of each, and the limits of what may be held on it."""

    intervals: tuple[int, ...]  # (A,) at least one each
    control_bounds: Interval  # (A, nu) each; equal where the control is held
    path_bounds: Interval  # (A, nd) each; equal where the constraint holds with equality
    state_bounds: Interval  # (A, nb) each, of the bounded states; equal where the state is held
    smoothing: Array | None = None  # (A, nu) weight ρ of each control's variation within an interval; None for zeros

    def __post_init__(self) -> None:
        if not self.intervals or min(self.intervals) < 1:
            raise ProblemError(f"arcs: intervals = {self.intervals}; allowed: at least one in each arc")

    def __len__(self) -> int:
        return len(self.intervals)

    @property
    def of_interval(self) -> Integers:
        """Index (N - 1,) of the arc that each interval belongs to."""
        return np.repeat(np.arange(len(self), dtype=np.int64), self.intervals)

    def check(self, grid: Grid) -> None:
        """Raise ProblemError for a grid with another number of intervals."""
        if sum(self.intervals) != len(grid) - 1:
            raise ProblemError(f"arcs: intervals = {self.intervals}; allowed: {len(grid) - 1} in all, like the grid's")

    def lengths(self, grid: Grid) -> Array:
        """Lengths (A,) of the arcs on a grid, fractions of T."""
        return np.bincount(self.of_interval, grid.widths, minlength=len(self)).astype(float)

    def shares(self, grid: Grid) -> Array:
        """Shares W (N - 1, A) of each interval in the arcs."""
        shares = np.zeros((len(grid) - 1, len(self)))
        of_interval = self.of_interval
        shares[np.arange(len(of_interval)), of_interval] = grid.widths / self.lengths(grid)[of_interval]
        return shares


def starts(shares: Array) -> Array:
    """Shares E (N - 1, A) of the arcs before each interval, the running sum of W (N - 1, A)."""
    return np.vstack([np.zeros(shares.shape[1]), np.cumsum(shares, axis=0)[:-1]])


def placed(shares: Array, lengths: Array) -> Grid:
    """The grid whose intervals have the shares W (N - 1, A) of arcs with these lengths (A,)."""
    return widened(shares @ lengths, _ROUNDING)
