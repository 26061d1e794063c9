"""The quadratic programme of one step of the condensed method, compiled."""

from __future__ import annotations

import math

import numpy as np

from mathnavi.controllers.flight.kernels.constraint_rows import (
    INFINITY,
    add_curvature,
    ball_rows,
    clearance_rows,
    convexify,
    end_rows,
)
from mathnavi.controllers.flight.kernels.problem_data import (
    ACCELERATION,
    APPROACH_WEIGHT,
    BETA,
    CLIMB_WEIGHT,
    EPSILON,
    LENGTH,
    LENGTH_WEIGHT,
    PSI,
    SPEED,
    ProblemData,
    QuadraticProgramme,
    position,
)
from mathnavi.controllers.flight.spline import length_to_go
from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array


@njit(cache=True, nogil=True)
def linearise(
    unknowns: Array,
    known: tuple[Array, ...],
    terminal_position: Array,
    multipliers: Array,
    quadratic: tuple[Array, ...],
) -> bool:
    """Fill the quadratic programme of one step d:

        minimise d'Hd/2 + g'd  subject to  lower <= (d, rows d) <= upper,

    the first 3n + 1 bounds on d itself; rows in the order clearance (soft), approach (soft), speed, acceleration,
    manoeuvre, map borders, terminal constraint. ``terminal_position`` is empty, or the point (3,) [m] of the last node.

    H is the Hessian of the Lagrangian, but for the terrain's curvature: ``multipliers`` (2n + 1,) are those of the
    speed, acceleration and manoeuvre rows in the step before, which curve the balls behind their tangent planes. Where
    the terminal cost is not convex, as much of its curvature stays as H remains positive definite with. Returns
    True if all of it stayed.
    """
    data, programme = ProblemData(*known), QuadraticProgramme(*quadratic)
    lengths, weights = data.lengths, data.weights
    hessian = programme.hessian
    n = weights.shape[1]
    clipped = np.empty((3 * n + 1, 3 * n + 1))  # np.zeros takes longer to compile
    curvatures = np.empty((n, 3, 3))  # the Lagrangian's curvature in v_2 ... v_N
    hessian[:] = clipped[:] = 0.0
    curvatures[:] = 0.0
    programme.rows[:] = 0.0
    _own_terms(unknowns, data, programme)
    clearance_rows(unknowns, data, programme)
    is_clipped = _terminal_terms(unknowns, data, programme, clipped)
    row = weights.shape[0] - 1
    row = ball_rows(unknowns, data, multipliers, row, programme, curvatures)
    # v_i = v_1 + h_1 a_1 + ... + h_(i-1) a_(i-1): a_j and a_m meet in every velocity after both.
    for i in range(n - 2, -1, -1):
        for a in range(3):
            for b in range(3):
                curvatures[i, a, b] += curvatures[i + 1, a, b]
    for j in range(n):
        for m in range(n):
            for a in range(3):
                for b in range(3):
                    hessian[3 * j + a, 3 * m + b] += lengths[j] * lengths[m] * curvatures[max(j, m), a, b]
    is_exact = not is_clipped or convexify(hessian, clipped)
    end_rows(unknowns, data, terminal_position, row, programme)
    return is_exact


@inner_njit(nogil=True)
def _own_terms(unknowns: Array, data: ProblemData, programme: QuadraticProgramme) -> None:
    """Fill the quadratic cost of each unknown by itself, and its bounds."""
    lengths, packed = data.lengths, data.packed
    hessian, gradient, upper, lower = programme.hessian, programme.gradient, programme.upper, programme.lower
    n = lengths.shape[0]
    v_max, a_max = packed[SPEED], packed[ACCELERATION]
    for j in range(3 * n):
        h = lengths[j // 3]
        hessian[j, j] = 2.0 * h
        gradient[j] = 2.0 * h * unknowns[j]
        upper[j], lower[j] = a_max - unknowns[j], -a_max - unknowns[j]
    climb = unknowns[3 * n]
    hessian[3 * n, 3 * n], gradient[3 * n] = packed[CLIMB_WEIGHT], packed[CLIMB_WEIGHT] * climb
    upper[3 * n], lower[3 * n] = v_max - climb, -climb


@inner_njit(nogil=True)
def _terminal_terms(unknowns: Array, data: ProblemData, programme: QuadraticProgramme, clipped: Array) -> bool:
    """Add the desired length to go, terminal cost, and the target approaching controls of Definition A.1, soft.

    Returns True if curvature that is not convex went to ``clipped`` (3n + 1, 3n + 1).
    """
    start, lengths, base, weights, _, _, ground, ratio, scales, packed = data
    hessian, gradient, rows, upper, lower = programme
    n, count = weights.shape[1], weights.shape[0] - 2
    size, row = 3 * n + 1, count
    p, slope, curvature = np.empty(3), np.empty(3), np.empty((3, 3))
    is_clipped = False
    upper[size + row], lower[size + row] = INFINITY, -INFINITY
    if packed[LENGTH_WEIGHT] > 0.0:
        weight, end = packed[LENGTH_WEIGHT], weights[count]
        position(p, start, unknowns, base[count], weights[count], 0.0)
        error = length_to_go(ground, ratio, scales, p[0], p[1], p[2], slope, curvature) - packed[LENGTH]
        for j in range(n):
            for a in range(3):
                gradient[3 * j + a] += weight * error * end[j] * slope[a]
                for m in range(n):
                    for b in range(3):
                        hessian[3 * j + a, 3 * m + b] += weight * end[j] * slope[a] * end[m] * slope[b]
        is_clipped = add_curvature(hessian, clipped, end, weight * error, curvature)
    if packed[PSI] > 0.0:
        psi, end = packed[PSI], weights[count]
        beyond, curvature_beyond = np.empty(3), np.empty((3, 3))
        position(p, start, unknowns, base[count], weights[count], 0.0)
        here = length_to_go(ground, ratio, scales, p[0], p[1], p[2], slope, curvature)
        position(p, start, unknowns, base[count + 1], weights[count + 1], 0.0)
        there = length_to_go(ground, ratio, scales, p[0], p[1], p[2], beyond, curvature_beyond)
        unit = psi / (lengths[n - 1] * packed[BETA])
        scale = math.sqrt(packed[APPROACH_WEIGHT])
        far = (there - here) * unit + 1.0 + packed[EPSILON]
        for j in range(n):
            for a in range(3):
                gradient[3 * j + a] += psi * end[j] * slope[a]
                rows[row, 3 * j + a] = scale * unit * (weights[count + 1, j] * beyond[a] - end[j] * slope[a])
        upper[size + row] = -scale * far
        pressed = packed[APPROACH_WEIGHT] * max(far, 0.0) * unit
        is_clipped = add_curvature(hessian, clipped, end, psi - pressed, curvature) or is_clipped
        if pressed > 0.0:
            is_clipped = add_curvature(hessian, clipped, weights[count + 1], pressed, curvature_beyond) or is_clipped
    return is_clipped
