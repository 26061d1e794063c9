"""One interval of a grid, in unknowns of a programme: the argument of monitor measures and node distributions."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True, eq=False)
class Mesh:
    """Interval i of the grid, 1 <= i <= N - 1, symbolic; S = diag(scales of the states), D_i = d_i (N - 1) / T."""

    count: int  # N - 1, the number of intervals
    index: ca.SX  # () i - 1, from 0
    relative_width: ca.SX  # () D_i, 1 on a uniform grid
    duration: ca.SX  # () T [s]
    chord: ca.SX  # (nx,) S^-1 (x_{i+1} - x_i)
    second_derivative: ca.SX  # (nx,) S^-1 T^2 (f_{i+1} - f_i) / d_i with respect to τ = t / T
