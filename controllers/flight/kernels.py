"""Compiled kernels of the condensed method: objective, gradient, Hessian and rows of one iteration.

The statement they implement is that of ``mathnavi.controllers.flight.problem``, which CasADi states independently; a
test holds one against the other. Unknowns U = (a_1, ..., a_n, w): n accelerations (3,) [m/s^2] and the manoeuvre's
final climb rate w [m/s]. Every position that the problem constrains is affine in U:

    p_q = p_1 + S_q v_1 + sum_j C_qj a_j + W_q w e_z .

``ProblemData`` is what they read of a problem, ``QuadraticProgramme`` what they fill. The three that the solver calls,
``begin``, ``linearise`` and ``search``, also take them as plain tuples, which cross into compiled code in a quarter of
the time.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from mathnavi.controllers.flight.length_to_go import length_to_go
from mathnavi.controllers.flight.spline import surface
from mathnavi.sim.interfaces.signals import Array

# Indices into Problem.packed.
MANOEUVRE, FLOOR, SPEED, ACCELERATION, BETA, PSI, EPSILON, WIDTH, DEPTH = range(9)
TERRAIN_WEIGHT, APPROACH_WEIGHT, CLIMB_WEIGHT, SPACING, LENGTH, LENGTH_WEIGHT = range(9, 15)
PACKED_SIZE = 15

BORDER = 1.0  # [m] that the plan's end keeps from the edge of the map
_SUFFICIENT, _SHORTEST = 1e-4, 1e-3  # of the line search: share of the promised decrease, length of a step
_SMALLEST_PIVOT = 1e-6  # far below CLIMB_WEIGHT, the smallest entry of the Hessian's diagonal
_INFINITY = 1e30  # of a bound that is none
_SLOW = 1e-3  # below this length [m/s, m/s^2] a ball constraint is far from active and has no direction


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


@njit(cache=True, nogil=True)
def _position(out: Array, start: Array, unknowns: Array, s: float, c: Array, climb: float) -> None:
    """Fills p = p_1 + s v_1 + sum_j c_j a_j + climb w e_z."""
    n = c.shape[0]
    for axis in range(3):
        out[axis] = start[axis] + s * start[3 + axis]
    for j in range(n):
        for axis in range(3):
            out[axis] += c[j] * unknowns[3 * j + axis]
    out[2] += climb * unknowns[3 * n]


@njit(cache=True, nogil=True)
def objective(unknowns: Array, data: ProblemData) -> float:
    """The problem's cost with its soft penalties.

    ``base`` (Q,), ``weights`` (Q, n), ``climbs`` (Q,) place the Q points: the clearance points first, then
    the last node, then one last arc's length beyond it.
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
        _position(p, start, unknowns, base[q], weights[q], climbs[q])
        height, _, _ = surface(terrain, p[1] / packed[SPACING], p[0] / packed[SPACING])
        low = height + packed[FLOOR] - p[2]
        if low > 0.0:
            cost += 0.5 * packed[TERRAIN_WEIGHT] * low * low
    if packed[LENGTH_WEIGHT] > 0.0:
        gradient, hessian = np.empty(3), np.empty((3, 3))
        _position(p, start, unknowns, base[count], weights[count], 0.0)
        error = length_to_go(ground, ratio, scales, p[0], p[1], p[2], gradient, hessian) - packed[LENGTH]
        cost += 0.5 * packed[LENGTH_WEIGHT] * error * error
    if packed[PSI] > 0.0:
        gradient, hessian = np.empty(3), np.empty((3, 3))
        _position(p, start, unknowns, base[count], weights[count], 0.0)
        here = length_to_go(ground, ratio, scales, p[0], p[1], p[2], gradient, hessian)
        _position(p, start, unknowns, base[count + 1], weights[count + 1], 0.0)
        there = length_to_go(ground, ratio, scales, p[0], p[1], p[2], gradient, hessian)
        cost += packed[PSI] * here
        far = (there - here) * packed[PSI] / (lengths[n - 1] * packed[BETA]) + 1.0 + packed[EPSILON]
        if far > 0.0:
            cost += 0.5 * packed[APPROACH_WEIGHT] * far * far
    return float(cost)


@njit(cache=True, nogil=True)
def end_violation(unknowns: Array, data: ProblemData, terminal_position: Array) -> float:
    """Largest violation [m] of the conditions at the ends.

    The last node and the manoeuvre's end are to be on the map, and the last node at ``terminal_position`` (3,) [m]
    unless that is empty.
    """
    start, base, weights, climbs, packed = data.start, data.base, data.weights, data.climbs, data.packed
    count, p = weights.shape[0] - 2, np.empty(3)
    violation = 0.0
    for q in (count - 1, count):
        _position(p, start, unknowns, base[q], weights[q], climbs[q])
        west, east = BORDER - p[0], p[0] + BORDER - packed[WIDTH]
        south, north = BORDER - p[1], p[1] + BORDER - packed[DEPTH]
        violation = max(violation, west, east, south, north)
    if terminal_position.size > 0:
        for axis in range(3):
            violation = max(violation, abs(p[axis] - terminal_position[axis]))
    return violation


@njit(cache=True, nogil=True)
def project(unknowns: Array, data: ProblemData, out: Array) -> None:
    """Fills ``out`` with unknowns near the given ones that keep every bound on speed, acceleration and manoeuvre.

    Velocities are pulled into the ball |v_i| <= v_max, then approached with |a_i| <= a_max, node by node; a node within
    the ball is reached from within the ball, so both bounds hold. w = 0 is always within reach of the manoeuvre.
    """
    start, lengths, packed = data.start, data.lengths, data.packed
    n = (unknowns.shape[0] - 1) // 3
    v_max, a_max = packed[SPEED], packed[ACCELERATION]
    desired, v, a = start[3:6].copy(), start[3:6].copy(), np.empty(3)
    for i in range(n):
        h = lengths[i]
        for axis in range(3):
            desired[axis] += h * unknowns[3 * i + axis]
        length = math.sqrt(desired[0] * desired[0] + desired[1] * desired[1] + desired[2] * desired[2])
        pull = v_max / length if length > v_max else 1.0
        for axis in range(3):
            a[axis] = (pull * desired[axis] - v[axis]) / h
        length = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
        pull = a_max / length if length > a_max else 1.0
        for axis in range(3):
            out[3 * i + axis] = pull * a[axis]
            v[axis] += h * pull * a[axis]
    across = v[0] * v[0] + v[1] * v[1]
    rise = math.sqrt(max(0.0, (packed[MANOEUVRE] * a_max) ** 2 - across))
    out[3 * n] = min(max(unknowns[3 * n], v[2] - rise, 0.0), v[2] + rise, v_max)


@njit(cache=True, nogil=True)
def _model_decrease(step: Array, programme: QuadraticProgramme, soft: int) -> float:
    """Decrease of the quadratic programme's objective from d = 0 to ``step``; its first ``soft`` rows are soft."""
    hessian, gradient, rows, upper, lower = programme
    size = step.shape[0]
    decrease = 0.0
    for j in range(size):
        product = 0.0
        for k in range(size):
            product += hessian[j, k] * step[k]
        decrease -= step[j] * (gradient[j] + 0.5 * product)
    for r in range(soft):
        along = 0.0
        for k in range(size):
            along += rows[r, k] * step[k]
        below, above = lower[size + r], -upper[size + r]
        decrease += 0.5 * (max(below, 0.0) ** 2 - max(below - along, 0.0) ** 2)
        decrease += 0.5 * (max(above, 0.0) ** 2 - max(above + along, 0.0) ** 2)
    return decrease


@njit(cache=True, nogil=True)
def begin(guess: Array, known: tuple[Array, ...], terminal_position: Array, out: Array) -> tuple[float, float]:
    """Fill ``out`` with the projected guess; its cost and its violation [m]."""
    data = ProblemData(*known)
    project(guess, data, out)
    return objective(out, data), end_violation(out, data, terminal_position)


@njit(cache=True, nogil=True)
def search(
    unknowns: Array,
    cost: float,
    violation: float,
    step: Array,
    penalty: float,
    soft: int,
    quadratic: tuple[Array, ...],
    known: tuple[Array, ...],
    terminal_position: Array,
    out: Array,
) -> tuple[float, float, float, bool]:
    """Backtracking from the full step along the projected line until merit = cost + penalty * violation falls enough.

    ``cost`` and ``violation`` [m] are those of the unknowns; the first ``soft`` rows of the programme are soft. Fills
    ``out``; returns the decrease that the quadratic model promises of the full step, the cost and violation of ``out``
    and whether the merit fell.
    """
    data, programme = ProblemData(*known), QuadraticProgramme(*quadratic)
    decrease = penalty * violation + _model_decrease(step, programme, soft)
    merit = cost + penalty * violation
    length = 1.0
    while True:
        project(unknowns + length * step, data, out)
        cost = objective(out, data)
        violation = end_violation(out, data, terminal_position)
        if cost + penalty * violation <= merit - _SUFFICIENT * length * max(decrease, 0.0):
            return decrease, cost, violation, True
        length *= 0.5
        if length < _SHORTEST:
            return decrease, cost, violation, False


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
    whether all of it stayed.
    """
    data, programme = ProblemData(*known), QuadraticProgramme(*quadratic)
    lengths, weights = data.lengths, data.weights
    hessian = programme.hessian
    n = weights.shape[1]
    clipped = np.zeros((3 * n + 1, 3 * n + 1))
    curvatures = np.zeros((n, 3, 3))  # the Lagrangian's curvature in v_2 ... v_N
    hessian[:] = 0.0
    programme.rows[:] = 0.0
    _own_terms(unknowns, data, programme)
    _clearance_rows(unknowns, data, programme)
    is_clipped = _terminal_terms(unknowns, data, programme, clipped)
    row = weights.shape[0] - 1
    row = _ball_rows(unknowns, data, multipliers, row, programme, curvatures)
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
    is_exact = not is_clipped or _convexify(hessian, clipped)
    _end_rows(unknowns, data, terminal_position, row, programme)
    return is_exact


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
def _clearance_rows(unknowns: Array, data: ProblemData, programme: QuadraticProgramme) -> None:
    """Clearance, soft: z - H(x, y) >= floor at the clearance points, the first rows."""
    start, _, base, weights, climbs, terrain, _, _, _, packed = data
    rows, upper, lower = programme.rows, programme.upper, programme.lower
    n, count = weights.shape[1], weights.shape[0] - 2
    size, p = 3 * n + 1, np.empty(3)
    scale = math.sqrt(packed[TERRAIN_WEIGHT])
    for q in range(count):
        _position(p, start, unknowns, base[q], weights[q], climbs[q])
        height, height_v, height_u = surface(terrain, p[1] / packed[SPACING], p[0] / packed[SPACING])
        hx, hy = height_u / packed[SPACING], height_v / packed[SPACING]
        for j in range(n):
            c = scale * weights[q, j]
            rows[q, 3 * j], rows[q, 3 * j + 1], rows[q, 3 * j + 2] = -c * hx, -c * hy, c
        rows[q, 3 * n] = scale * climbs[q]
        lower[size + q] = scale * (height + packed[FLOOR] - p[2])
        upper[size + q] = _INFINITY


@njit(cache=True, nogil=True)
def _terminal_terms(unknowns: Array, data: ProblemData, programme: QuadraticProgramme, clipped: Array) -> bool:
    """The length to go that is desired; terminal cost and the target approaching controls of Definition A.1, soft.

    Returns whether curvature that is not convex went to ``clipped``.
    """
    start, lengths, base, weights, _, _, ground, ratio, scales, packed = data
    hessian, gradient, rows, upper, lower = programme
    n, count = weights.shape[1], weights.shape[0] - 2
    size, row = 3 * n + 1, count
    p, slope, curvature = np.empty(3), np.empty(3), np.empty((3, 3))
    is_clipped = False
    upper[size + row], lower[size + row] = _INFINITY, -_INFINITY
    if packed[LENGTH_WEIGHT] > 0.0:
        weight, end = packed[LENGTH_WEIGHT], weights[count]
        _position(p, start, unknowns, base[count], weights[count], 0.0)
        error = length_to_go(ground, ratio, scales, p[0], p[1], p[2], slope, curvature) - packed[LENGTH]
        for j in range(n):
            for a in range(3):
                gradient[3 * j + a] += weight * error * end[j] * slope[a]
                for m in range(n):
                    for b in range(3):
                        hessian[3 * j + a, 3 * m + b] += weight * end[j] * slope[a] * end[m] * slope[b]
        is_clipped = _add_curvature(hessian, clipped, end, weight * error, curvature)
    if packed[PSI] > 0.0:
        psi, end = packed[PSI], weights[count]
        beyond, curvature_beyond = np.empty(3), np.empty((3, 3))
        _position(p, start, unknowns, base[count], weights[count], 0.0)
        here = length_to_go(ground, ratio, scales, p[0], p[1], p[2], slope, curvature)
        _position(p, start, unknowns, base[count + 1], weights[count + 1], 0.0)
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
        is_clipped = _add_curvature(hessian, clipped, end, psi - pressed, curvature) or is_clipped
        if pressed > 0.0:
            is_clipped = _add_curvature(hessian, clipped, weights[count + 1], pressed, curvature_beyond) or is_clipped
    return is_clipped


@njit(cache=True, nogil=True)
def _ball_rows(
    unknowns: Array,
    data: ProblemData,
    multipliers: Array,
    row: int,
    programme: QuadraticProgramme,
    curvatures: Array,
) -> int:
    """Balls |v_i| <= v_max, |a_i| <= a_max and the manoeuvre's by their tangent planes at the iterate, from ``row``.

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
        upper[size + row], lower[size + row] = _INFINITY, -_INFINITY
        if length > _SLOW:
            upper[size + row] = v_max - length
            for j in range(i + 1):
                for axis in range(3):
                    rows[row, 3 * j + axis] = lengths[j] * v[axis] / length
            _add_norm_hessian(curvatures[i], v, length, multipliers[i])
        row += 1
    for i in range(n):
        a0, a1, a2 = unknowns[3 * i], unknowns[3 * i + 1], unknowns[3 * i + 2]
        length = math.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
        upper[size + row], lower[size + row] = _INFINITY, -_INFINITY
        if length > _SLOW:
            upper[size + row] = a_max - length
            rows[row, 3 * i], rows[row, 3 * i + 1], rows[row, 3 * i + 2] = a0 / length, a1 / length, a2 / length
            block = hessian[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
            _add_norm_hessian(block, unknowns[3 * i : 3 * i + 3], length, multipliers[n + i])
        row += 1
    # The manoeuvre's acceleration ((0, 0, w) - v_n) / duration.
    v[2] -= unknowns[3 * n]
    length = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    upper[size + row], lower[size + row] = _INFINITY, -_INFINITY
    if length > _SLOW:
        upper[size + row] = a_max * packed[MANOEUVRE] - length
        for j in range(n):
            for axis in range(3):
                rows[row, 3 * j + axis] = lengths[j] * v[axis] / length
        rows[row, 3 * n] = -v[2] / length
        end_curvature = np.zeros((3, 3))
        _add_norm_hessian(end_curvature, v, length, multipliers[2 * n])
        for a in range(3):
            for b in range(3):
                curvatures[n - 1, a, b] += end_curvature[a, b]
        for j in range(n):
            for axis in range(3):
                hessian[3 * j + axis, 3 * n] -= lengths[j] * end_curvature[axis, 2]
                hessian[3 * n, 3 * j + axis] -= lengths[j] * end_curvature[axis, 2]
        hessian[3 * n, 3 * n] += end_curvature[2, 2]
    return row + 1


@njit(cache=True, nogil=True)
def _end_rows(
    unknowns: Array, data: ProblemData, terminal_position: Array, row: int, programme: QuadraticProgramme
) -> None:
    """Rows, from ``row`` on, of the last node and the manoeuvre's end on the map, and of the terminal constraint."""
    start, base, weights, climbs, packed = data.start, data.base, data.weights, data.climbs, data.packed
    rows, upper, lower = programme.rows, programme.upper, programme.lower
    n, count = weights.shape[1], weights.shape[0] - 2
    size, p = 3 * n + 1, np.empty(3)
    for q in (count, count - 1):
        _position(p, start, unknowns, base[q], weights[q], climbs[q])
        for axis in range(2):
            for j in range(n):
                rows[row, 3 * j + axis] = weights[q, j]
            side = packed[WIDTH] if axis == 0 else packed[DEPTH]
            upper[size + row], lower[size + row] = side - BORDER - p[axis], BORDER - p[axis]
            row += 1
    if terminal_position.size > 0:
        _position(p, start, unknowns, base[count], weights[count], 0.0)
        for axis in range(3):
            for j in range(n):
                rows[row, 3 * j + axis] = weights[count, j]
            upper[size + row] = lower[size + row] = terminal_position[axis] - p[axis]
            row += 1


@njit(cache=True, nogil=True)
def _add_norm_hessian(block: Array, v: Array, length: float, multiplier: float) -> None:
    """Add the Hessian of multiplier * |v| to a 3 x 3 block."""
    if multiplier > 0.0:
        for a in range(3):
            for b in range(3):
                block[a, b] -= multiplier * v[a] * v[b] / length**3
            block[a, a] += multiplier / length


@njit(cache=True, nogil=True)
def _add_curvature(hessian: Array, clipped: Array, weights: Array, strength: float, curvature: Array) -> bool:
    """Add strength * ``curvature`` (3, 3) in the point sum_j weights_j a_j: its convex part to the Hessian.

    The rest goes to ``clipped``; returns whether there was any. (Loops, because whole arrays compile for seconds.)
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


@njit(cache=True, nogil=True)
def _convexify(hessian: Array, clipped: Array) -> bool:
    """Add as much of ``clipped`` (all, half, a quarter or nothing) as the Hessian stays positive definite with.

    Returns whether it was all.
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


@njit(cache=True, nogil=True)
def _is_positive_definite(matrix: Array) -> bool:
    """Whether Cholesky's factorisation exists, its pivots clear of rounding."""
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


@njit(cache=True, nogil=True)
def _positive_part(matrix: Array) -> None:
    """Replace a symmetric 3 x 3 matrix by its nearest positive semidefinite one (Jacobi rotations)."""
    vectors = np.eye(3)
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
