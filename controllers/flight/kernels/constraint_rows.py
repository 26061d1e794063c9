"""Linearised rows of the constraints: clearance, balls of speed and acceleration, map borders, terminal constraint.

Curvature that enters a Hessian, kept positive definite, compiled.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.controllers.flight.kernels.problem_data import (
    ACCELERATION,
    BORDER,
    DEPTH,
    FLOOR,
    MANOEUVRE,
    SPACING,
    SPEED,
    TERRAIN_WEIGHT,
    WIDTH,
    ProblemData,
    QuadraticProgramme,
    position,
)
from mathnavi.controllers.flight.spline import surface
from mathnavi.interfaces.compiled import inner_njit
from mathnavi.interfaces.signals import Array

_SMALLEST_PIVOT = 1e-6  # far below CLIMB_WEIGHT, the smallest entry of the Hessian's diagonal


@inner_njit(nogil=True)
def add_norm_hessian(block: Array, v: Array, length: float, multiplier: float) -> None:
    """Add the Hessian of multiplier * |v|, v (3,) of the given length, to a ``block`` (3, 3), if multiplier > 0."""
    if multiplier > 0.0:
        for a in range(3):
            for b in range(3):
                block[a, b] -= multiplier * v[a] * v[b] / length**3
            block[a, a] += multiplier / length


@inner_njit(nogil=True)
def add_curvature(hessian: Array, clipped: Array, weights: Array, strength: float, curvature: Array) -> bool:
    """Add strength * ``curvature`` (3, 3) in the point sum_j weights_j a_j: its convex part to the Hessian.

    ``hessian`` and ``clipped`` (3n + 1, 3n + 1), ``weights`` (n,). The rest goes to ``clipped``; returns True if there
    was any. (Loops, because whole arrays compile for seconds.)
    """
    convex, rest = np.empty((3, 3)), np.empty((3, 3))
    for a in range(3):
        for b in range(3):
            rest[a, b] = convex[a, b] = strength * curvature[a, b]
    _positive_part(convex)
    is_clipped = False
    for a in range(3):
        for b in range(3):
            rest[a, b] -= convex[a, b]
            is_clipped = is_clipped or rest[a, b] != 0.0
    n = weights.shape[0]
    for j in range(n):
        for m in range(n):
            both = weights[j] * weights[m]
            for a in range(3):
                for b in range(3):
                    hessian[3 * j + a, 3 * m + b] += both * convex[a, b]
                    clipped[3 * j + a, 3 * m + b] += both * rest[a, b]
    return is_clipped


@inner_njit(nogil=True)
def convexify(hessian: Array, clipped: Array) -> bool:
    """Add as much of ``clipped`` (all, half, a quarter or nothing) as the Hessian stays positive definite with.

    Both (3n + 1, 3n + 1). Returns True if it was all.
    """
    size = hessian.shape[0]
    trial = np.empty((size, size))
    for share in (1.0, 0.5, 0.25):
        for i in range(size):
            for j in range(size):
                trial[i, j] = hessian[i, j] + share * clipped[i, j]
        if _is_positive_definite(trial):
            for i in range(size):
                for j in range(size):
                    hessian[i, j] = trial[i, j]
            return share == 1.0
    return False


@inner_njit(nogil=True)
def _is_positive_definite(matrix: Array) -> bool:
    """True if Cholesky's factorisation of a symmetric matrix (m, m) exists, its pivots clear of rounding."""
    size = matrix.shape[0]
    factor = np.empty((size, size))
    for i in range(size):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i > j:
                factor[i, j] = total / factor[j, j]
            elif total <= _SMALLEST_PIVOT:
                return False
            else:
                factor[i, i] = math.sqrt(total)
    return True


@inner_njit(nogil=True)
def _positive_part(matrix: Array) -> None:
    """Replace a symmetric 3 x 3 matrix by its nearest positive semidefinite one (Jacobi rotations)."""
    vectors = np.empty((3, 3))
    for a in range(3):
        for b in range(3):
            vectors[a, b] = 1.0 if a == b else 0.0
    for _ in range(12):
        if abs(matrix[0, 1]) + abs(matrix[0, 2]) + abs(matrix[1, 2]) < 1e-14:
            break
        for a, b in ((0, 1), (0, 2), (1, 2)):
            if matrix[a, b] == 0.0:
                continue
            theta = 0.5 * (matrix[b, b] - matrix[a, a]) / matrix[a, b]
            t = (1.0 if theta >= 0.0 else -1.0) / (abs(theta) + math.sqrt(theta * theta + 1.0))
            c = 1.0 / math.sqrt(t * t + 1.0)
            s = t * c
            for k in range(3):
                ka, kb = matrix[k, a], matrix[k, b]
                matrix[k, a], matrix[k, b] = c * ka - s * kb, s * ka + c * kb
            for k in range(3):
                ak, bk = matrix[a, k], matrix[b, k]
                matrix[a, k], matrix[b, k] = c * ak - s * bk, s * ak + c * bk
                va, vb = vectors[k, a], vectors[k, b]
                vectors[k, a], vectors[k, b] = c * va - s * vb, s * va + c * vb
    values = np.empty(3)
    for k in range(3):
        values[k] = max(0.0, matrix[k, k])
    for a in range(3):
        for b in range(3):
            total = 0.0
            for k in range(3):
                total += vectors[a, k] * values[k] * vectors[b, k]
            matrix[a, b] = total


INFINITY = 1e30
"""limit of a row that is not limited"""

_SLOW = 1e-3  # below this length [m/s, m/s^2] a ball constraint is far from active and has no direction


@inner_njit(nogil=True)
def clearance_rows(unknowns: Array, data: ProblemData, programme: QuadraticProgramme) -> None:
    """Fill the first rows, clearance [m], soft: z - H(x, y) >= floor at the clearance points."""
    start, _, base, weights, climbs, terrain, _, _, _, packed = data
    rows, upper, lower = programme.rows, programme.upper, programme.lower
    n, count = weights.shape[1], weights.shape[0] - 2
    size, p = 3 * n + 1, np.empty(3)
    scale = math.sqrt(packed[TERRAIN_WEIGHT])
    for q in range(count):
        position(p, start, unknowns, base[q], weights[q], climbs[q])
        height, height_v, height_u = surface(terrain, p[1] / packed[SPACING], p[0] / packed[SPACING])
        hx, hy = height_u / packed[SPACING], height_v / packed[SPACING]
        for j in range(n):
            c = scale * weights[q, j]
            rows[q, 3 * j], rows[q, 3 * j + 1], rows[q, 3 * j + 2] = -c * hx, -c * hy, c
        rows[q, 3 * n] = scale * climbs[q]
        lower[size + q] = scale * (height + packed[FLOOR] - p[2])
        upper[size + q] = INFINITY


@inner_njit(nogil=True)
def ball_rows(
    unknowns: Array,
    data: ProblemData,
    multipliers: Array,
    row: int,
    programme: QuadraticProgramme,
    curvatures: Array,
) -> int:
    """Fill the rows from ``row`` on: |v_i| <= v_max, |a_i| <= a_max, the manoeuvre's, by tangent planes at the iterate.

    Their curvature goes to ``curvatures`` (n, 3, 3) of the velocities v_2 ... v_N, and to the Hessian.
    Returns the next row.
    """
    start, lengths, packed = data.start, data.lengths, data.packed
    hessian, rows, upper, lower = programme.hessian, programme.rows, programme.upper, programme.lower
    n = lengths.shape[0]
    size = 3 * n + 1
    v_max, a_max = packed[SPEED], packed[ACCELERATION]
    v = start[3:6].copy()
    for i in range(n):
        for axis in range(3):
            v[axis] += lengths[i] * unknowns[3 * i + axis]
        length = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        upper[size + row], lower[size + row] = INFINITY, -INFINITY
        if length > _SLOW:
            upper[size + row] = v_max - length
            for j in range(i + 1):
                for axis in range(3):
                    rows[row, 3 * j + axis] = lengths[j] * v[axis] / length
            add_norm_hessian(curvatures[i], v, length, multipliers[i])
        row += 1
    for i in range(n):
        a0, a1, a2 = unknowns[3 * i], unknowns[3 * i + 1], unknowns[3 * i + 2]
        length = math.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
        upper[size + row], lower[size + row] = INFINITY, -INFINITY
        if length > _SLOW:
            upper[size + row] = a_max - length
            rows[row, 3 * i], rows[row, 3 * i + 1], rows[row, 3 * i + 2] = a0 / length, a1 / length, a2 / length
            block = hessian[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
            add_norm_hessian(block, unknowns[3 * i : 3 * i + 3], length, multipliers[n + i])
        row += 1
    # The manoeuvre's acceleration ((0, 0, w) - v_n) / duration.
    v[2] -= unknowns[3 * n]
    length = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    upper[size + row], lower[size + row] = INFINITY, -INFINITY
    if length > _SLOW:
        upper[size + row] = a_max * packed[MANOEUVRE] - length
        for j in range(n):
            for axis in range(3):
                rows[row, 3 * j + axis] = lengths[j] * v[axis] / length
        rows[row, 3 * n] = -v[2] / length
        end_curvature = np.empty((3, 3))
        end_curvature[:] = 0.0
        add_norm_hessian(end_curvature, v, length, multipliers[2 * n])
        for a in range(3):
            for b in range(3):
                curvatures[n - 1, a, b] += end_curvature[a, b]
        for j in range(n):
            for axis in range(3):
                hessian[3 * j + axis, 3 * n] -= lengths[j] * end_curvature[axis, 2]
                hessian[3 * n, 3 * j + axis] -= lengths[j] * end_curvature[axis, 2]
        hessian[3 * n, 3 * n] += end_curvature[2, 2]
    return row + 1


@inner_njit(nogil=True)
def end_rows(
    unknowns: Array, data: ProblemData, terminal_position: Array, row: int, programme: QuadraticProgramme
) -> None:
    """Fill the rows from ``row`` on: last node and manoeuvre's end on the map, and the terminal constraint."""
    start, base, weights, climbs, packed = data.start, data.base, data.weights, data.climbs, data.packed
    rows, upper, lower = programme.rows, programme.upper, programme.lower
    n, count = weights.shape[1], weights.shape[0] - 2
    size, p = 3 * n + 1, np.empty(3)
    for q in (count, count - 1):
        position(p, start, unknowns, base[q], weights[q], climbs[q])
        for axis in range(2):
            for j in range(n):
                rows[row, 3 * j + axis] = weights[q, j]
            side = packed[WIDTH] if axis == 0 else packed[DEPTH]
            upper[size + row], lower[size + row] = side - BORDER - p[axis], BORDER - p[axis]
            row += 1
    if terminal_position.size > 0:
        position(p, start, unknowns, base[count], weights[count], 0.0)
        for axis in range(3):
            for j in range(n):
                rows[row, 3 * j + axis] = weights[count, j]
            upper[size + row] = lower[size + row] = terminal_position[axis] - p[axis]
            row += 1
