"""The cost of the condensed problem and the violation of its conditions at the ends, compiled."""

from __future__ import annotations

import numpy as np

from mathnavi.controllers.flight.kernels.problem_data import (
    APPROACH_WEIGHT,
    BETA,
    BORDER,
    CLIMB_WEIGHT,
    DEPTH,
    EPSILON,
    FLOOR,
    LENGTH,
    LENGTH_WEIGHT,
    PSI,
    SPACING,
    TERRAIN_WEIGHT,
    WIDTH,
    ProblemData,
    position,
)
from mathnavi.controllers.flight.length_to_go import length_to_go
from mathnavi.controllers.flight.spline import surface
from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array


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
