"""A problem and its quadratic programme as the compiled kernels of the condensed method read them.

Unknowns U = (a_1, ..., a_n, w) (3n + 1,): n accelerations (3,) [m/s^2] and the manoeuvre's final climb rate w [m/s].
Every position that the problem constrains is affine in U:

    p_q = p_1 + S_q v_1 + sum_j C_qj a_j + W_q w e_z .

The statement that the kernels implement is that of ``mathnavi.controllers.flight.problem``, which CasADi states
independently (``mathnavi.controllers.flight.reference``); a test holds one against the other. The three functions that
the solver calls, ``line_search.begin``, ``line_search.search`` and ``linearisation.linearise``, also take
``ProblemData`` and ``QuadraticProgramme`` as plain tuples, which cross into compiled code in a quarter of the time.

The cost of the condensed problem and the violation of its conditions at the ends, compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mathnavi.controllers.flight.spline import length_to_go, surface
from mathnavi.interfaces.compiled import inner_njit, njit
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


@njit(cache=True, nogil=True)
def objective(unknowns: Array, data: ProblemData) -> float:
    """Cost of unknowns U (3n + 1,) [m/s^2, m/s], with the soft penalties of the problem."""
    return float(cost_of(unknowns, data))


@inner_njit(nogil=True)
def cost_of(unknowns: Array, data: ProblemData) -> float:
    """Cost of unknowns U (3n + 1,) [m/s^2, m/s], with the soft penalties of the problem.

    ``data.base`` (Q,), ``data.weights`` (Q, n), ``data.climbs`` (Q,) place the Q points: the clearance points first,
    then the last node, then one last arc's length beyond it.
    """
    start, lengths, base, weights, climbs, terrain, ground, ratio, scales, packed = data
    n = weights.shape[1]
    count = weights.shape[0] - 2
    p = np.empty(3)
    cost = 0.0
    for j in range(3 * n):
        cost += lengths[j // 3] * unknowns[j] * unknowns[j]
    climb = unknowns[3 * n]
    cost += 0.5 * packed[CLIMB_WEIGHT] * climb * climb
    for q in range(count):
        position(p, start, unknowns, base[q], weights[q], climbs[q])
        height, _, _ = surface(terrain, p[1] / packed[SPACING], p[0] / packed[SPACING])
        low = height + packed[FLOOR] - p[2]
        if low > 0.0:
            cost += 0.5 * packed[TERRAIN_WEIGHT] * low * low
    if packed[LENGTH_WEIGHT] > 0.0:
        gradient, hessian = np.empty(3), np.empty((3, 3))
        position(p, start, unknowns, base[count], weights[count], 0.0)
        error = length_to_go(ground, ratio, scales, p[0], p[1], p[2], gradient, hessian) - packed[LENGTH]
        cost += 0.5 * packed[LENGTH_WEIGHT] * error * error
    if packed[PSI] > 0.0:
        gradient, hessian = np.empty(3), np.empty((3, 3))
        position(p, start, unknowns, base[count], weights[count], 0.0)
        here = length_to_go(ground, ratio, scales, p[0], p[1], p[2], gradient, hessian)
        position(p, start, unknowns, base[count + 1], weights[count + 1], 0.0)
        there = length_to_go(ground, ratio, scales, p[0], p[1], p[2], gradient, hessian)
        cost += packed[PSI] * here
        far = (there - here) * packed[PSI] / (lengths[n - 1] * packed[BETA]) + 1.0 + packed[EPSILON]
        if far > 0.0:
            cost += 0.5 * packed[APPROACH_WEIGHT] * far * far
    return float(cost)


@inner_njit(nogil=True)
def end_violation(unknowns: Array, data: ProblemData, terminal_position: Array) -> float:
    """Largest violation [m] of the conditions at the ends.

    The last node and the manoeuvre's end are to be on the map, and the last node at ``terminal_position`` (3,) [m]
    unless that is empty.
    """
    start, base, weights, climbs, packed = data.start, data.base, data.weights, data.climbs, data.packed
    count, p = weights.shape[0] - 2, np.empty(3)
    violation = 0.0
    for q in (count - 1, count):
        position(p, start, unknowns, base[q], weights[q], climbs[q])
        west, east = BORDER - p[0], p[0] + BORDER - packed[WIDTH]
        south, north = BORDER - p[1], p[1] + BORDER - packed[DEPTH]
        violation = max(violation, west, east, south, north)
    if terminal_position.size > 0:
        for axis in range(3):
            violation = max(violation, abs(p[axis] - terminal_position[axis]))
    return violation
