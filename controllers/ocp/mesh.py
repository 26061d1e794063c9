"""The interval of a grid as monitor functions and node distributions see it, in unknowns of a programme."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True, eq=False)
class Mesh:
    """Interval i of the grid, 1 <= i <= N - 1; S are the states' scales."""

    count: int  # N - 1
    index: ca.SX  # i - 1, from 0
    relative_width: ca.SX  # D_i
    duration: ca.SX  # T [s]
    chord: ca.SX  # (nx,) S^-1 (x_{i+1} - x_i)
    second_derivative: ca.SX  # (nx,) S^-1 T^2 (f_{i+1} - f_i) / d_i with respect to τ = t / T
