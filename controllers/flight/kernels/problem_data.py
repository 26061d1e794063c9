"""A problem and its quadratic programme as the compiled kernels of the condensed method read them.

Unknowns U = (a_1, ..., a_n, w) (3n + 1,): n accelerations (3,) [m/s^2] and the manoeuvre's final climb rate w [m/s].
Every position that the problem constrains is affine in U:

    p_q = p_1 + S_q v_1 + sum_j C_qj a_j + W_q w e_z .

The statement that the kernels implement is that of ``mathnavi.controllers.flight.problem``, which CasADi states
independently (``mathnavi.controllers.flight.reference``); a test holds one against the other. The three functions that
the solver calls, ``line_search.begin``, ``line_search.search`` and ``linearisation.linearise``, also take
``ProblemData`` and ``QuadraticProgramme`` as plain tuples, which cross into compiled code in a quarter of the time.
"""

from __future__ import annotations

from typing import NamedTuple

from mathnavi.interfaces.compiled import inner_njit
from mathnavi.interfaces.signals import Array

# Indices into Problem.packed.
MANOEUVRE, FLOOR, SPEED, ACCELERATION, BETA, PSI, EPSILON, WIDTH, DEPTH = range(9)
TERRAIN_WEIGHT, APPROACH_WEIGHT, CLIMB_WEIGHT, SPACING, LENGTH, LENGTH_WEIGHT = range(9, 15)
PACKED_SIZE = 15

BORDER = 1.0
"""distance [m] that the plan's end keeps from the edge of the map"""


class ProblemData(NamedTuple):
    """A problem as the kernels read it: state, geometry in time, splines and numbers."""

    start: Array  # (6,) p_1 [m], v_1 [m/s]
    lengths: Array  # (n,) [s] of the arcs, h_1 ... h_n
    base: Array  # (Q,) [s] S, of ``problem.PredictionMatrices`` as are the next two
    weights: Array  # (Q, n) [s^2] C
    climbs: Array  # (Q,) [s] W
    terrain: Array  # spline coefficients of the heights [m]
    ground: Array  # spline coefficients of the cost-to-go's ground [m]
    ratio: Array  # spline coefficients of tau
    scales: Array  # (8,) of the cost-to-go's grid, see ``cost_to_go.FactoredCost``
    packed: Array  # (PACKED_SIZE,) numbers, by the indices above


class QuadraticProgramme(NamedTuple):
    """minimise d'Hd/2 + g'd subject to lower <= (d, rows d) <= upper, in buffers that the kernels fill."""

    hessian: Array  # (3n + 1, 3n + 1) H
    gradient: Array  # (3n + 1,) g
    rows: Array  # (m, 3n + 1)
    upper: Array  # (3n + 1 + m,)
    lower: Array  # (3n + 1 + m,)


@inner_njit(nogil=True)
def position(out: Array, start: Array, unknowns: Array, s: float, c: Array, climb: float) -> None:
    """Fill ``out`` (3,) [m] with p = p_1 + s v_1 + sum_j c_j a_j + climb w e_z; s, climb [s] and c (n,) [s^2]."""
    n = c.shape[0]
    for axis in range(3):
        out[axis] = start[axis] + s * start[3 + axis]
    for j in range(n):
        for axis in range(3):
            out[axis] += c[j] * unknowns[3 * j + axis]
    out[2] += climb * unknowns[3 * n]
