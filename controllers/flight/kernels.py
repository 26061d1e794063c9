"""Compiled kernels of the condensed Gauss-Newton method: objective, gradient, Hessian and rows of one iteration.

The statement they implement is that of ``controllers.flight.problem``, which CasADi states independently; a test
holds one against the other. Unknowns U = (a_1, ..., a_n, w): n accelerations (3,) [m/s^2] and the manoeuvre's final
climb rate w [m/s]. Every position the problem looks at is affine in U:

    p_q = p_1 + S_q v_1 + sum_j C_qj a_j + W_q w e_z .

The array arguments are those of ``problem.Stencil`` (geometry in time), ``problem.Landscape`` (splines) and
``problem.Parameters.packed`` (numbers, by the indices below).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from controllers.flight.cost_to_go import TARGET_LENGTH
from controllers.flight.spline import surface, surface_curvature, volume
from sim.signals import Array

# Indices into Parameters.packed.
H, MANOEUVRE, FLOOR, SPEED, ACCELERATION, BETA, PSI, EPSILON, WIDTH, DEPTH = range(10)
TERRAIN_WEIGHT, APPROACH_WEIGHT, CLIMB_WEIGHT, HARD_WEIGHT, SPACING = range(10, 15)
PACKED_SIZE = 15

BORDER = 1.0  # [m] that the plan's end keeps from the edge of the map
_SLOW = 1e-3  # below this length [m/s, m/s^2] a ball constraint is far from active and has no direction


@njit(cache=True, nogil=True)
def length_to_go(
    ground: Array, ratio: Array, scales: Array, x: float, y: float, z: float, gradient: Array, hessian: Array
) -> float:
    """sqrt(|p - p_f|^2 + l^2) tau(p) - l [m]; fills gradient (3,) and Hessian (3, 3) of it."""
    x_0, y_0, spacing, level_0, layer_spacing = scales[0], scales[1], scales[2], scales[3], scales[4]
    v, w = (y - y_0) / spacing, (x - x_0) / spacing
    floor, floor_v, floor_w = surface(ground, v, w)
    floor_vv, floor_vw, floor_ww = surface_curvature(ground, v, w)
    u = (z - floor - level_0) / layer_spacing
    dt = np.empty(3)
    ddt = np.empty((3, 3))
    tau = volume(ratio, u, v, w, dt, ddt)
    # Chain rule from (u, v, w) to (x, y, z); u depends on all three.
    jacobian = np.zeros((3, 3))
    jacobian[0, 0], jacobian[0, 1] = -floor_w / (spacing * layer_spacing), -floor_v / (spacing * layer_spacing)
    jacobian[0, 2] = 1.0 / layer_spacing
    jacobian[1, 1] = jacobian[2, 0] = 1.0 / spacing
    tau_p = np.zeros(3)
    tau_pp = np.zeros((3, 3))
    for a in range(3):
        for k in range(3):
            tau_p[a] += jacobian[k, a] * dt[k]
            for b in range(3):
                for m in range(3):
                    tau_pp[a, b] += jacobian[k, a] * ddt[k, m] * jacobian[m, b]
    bend = -dt[0] / (spacing * spacing * layer_spacing)
    tau_pp[0, 0] += bend * floor_ww
    tau_pp[0, 1] += bend * floor_vw
    tau_pp[1, 0] += bend * floor_vw
    tau_pp[1, 1] += bend * floor_vv
    d = np.array([x - scales[5], y - scales[6], z - scales[7]])
    r = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + TARGET_LENGTH * TARGET_LENGTH)
    for a in range(3):
        gradient[a] = tau * d[a] / r + r * tau_p[a]
        for b in range(3):
            identity = 1.0 if a == b else 0.0
            hessian[a, b] = (
                tau * (identity - d[a] * d[b] / (r * r)) / r
                + (d[a] * tau_p[b] + tau_p[a] * d[b]) / r
                + r * tau_pp[a, b]
            )
    return r * tau - TARGET_LENGTH


@njit(cache=True, nogil=True)
def cost_many(ground: Array, ratio: Array, scales: Array, points: Array) -> tuple[Array, Array]:
    """Length-to-go (n,) [m] and its gradient (n, 3) at (n, 3) points [m]."""
    values = np.empty(points.shape[0])
    gradients = np.empty((points.shape[0], 3))
    hessian = np.empty((3, 3))
    for i in range(points.shape[0]):
        values[i] = length_to_go(ground, ratio, scales, points[i, 0], points[i, 1], points[i, 2], gradients[i], hessian)
    return values, gradients


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
def objective(
    unknowns: Array,
    start: Array,
    base: Array,
    weights: Array,
    climbs: Array,
    terrain: Array,
    ground: Array,
    ratio: Array,
    scales: Array,
    packed: Array,
) -> tuple[float, float]:
    """The problem's cost with its soft penalties, and the largest violation of its hard bounds [m, m/s or m/s^2].

    ``base`` (Q,), ``weights`` (Q, n), ``climbs`` (Q,) place the Q looked-at points: the clearance points first, then
    the last node, then one step beyond it.
    """
    n = weights.shape[1]
    looked = weights.shape[0] - 2
    h, p = packed[H], np.empty(3)
    cost = 0.0
    for j in range(3 * n):
        cost += h * unknowns[j] * unknowns[j]
    climb = unknowns[3 * n]
    cost += 0.5 * packed[CLIMB_WEIGHT] * climb * climb
    for q in range(looked):
        _position(p, start, unknowns, base[q], weights[q], climbs[q])
        height, _, _ = surface(terrain, p[1] / packed[SPACING], p[0] / packed[SPACING])
        low = height + packed[FLOOR] - p[2]
        if low > 0.0:
            cost += 0.5 * packed[TERRAIN_WEIGHT] * low * low
    if packed[PSI] > 0.0:
        gradient, hessian = np.empty(3), np.empty((3, 3))
        _position(p, start, unknowns, base[looked], weights[looked], 0.0)
        here = length_to_go(ground, ratio, scales, p[0], p[1], p[2], gradient, hessian)
        _position(p, start, unknowns, base[looked + 1], weights[looked + 1], 0.0)
        there = length_to_go(ground, ratio, scales, p[0], p[1], p[2], gradient, hessian)
        cost += packed[PSI] * here
        far = (there - here) * packed[PSI] / (h * packed[BETA]) + 1.0 + packed[EPSILON]
        if far > 0.0:
            cost += 0.5 * packed[APPROACH_WEIGHT] * far * far
    return cost, _hard_violation(unknowns, start, packed, n)


@njit(cache=True, nogil=True)
def _hard_violation(unknowns: Array, start: Array, packed: Array, n: int) -> float:
    worst = 0.0
    v = start[3:6].copy()
    for j in range(n):
        a = unknowns[3 * j : 3 * j + 3]
        worst = max(worst, math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]) - packed[ACCELERATION])
        for axis in range(3):
            v[axis] += packed[H] * a[axis]
        worst = max(worst, math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) - packed[SPEED])
    rise = unknowns[3 * n] - v[2]
    braking = math.sqrt(v[0] * v[0] + v[1] * v[1] + rise * rise) / packed[MANOEUVRE]
    return float(max(worst, braking - packed[ACCELERATION]))


@njit(cache=True, nogil=True)
def linearise(
    unknowns: Array,
    start: Array,
    base: Array,
    weights: Array,
    climbs: Array,
    terrain: Array,
    ground: Array,
    ratio: Array,
    scales: Array,
    packed: Array,
    hold: Array,
    multipliers: Array,
    hessian: Array,
    gradient: Array,
    rows: Array,
    upper: Array,
    lower: Array,
) -> None:
    """Fill the quadratic programme of one Gauss-Newton step d:

        minimise d'Hd/2 + g'd  subject to  lower <= (d, rows d) <= upper,

    the first 3n + 1 bounds on d itself; rows in the order clearance (soft), approach (soft), speed, acceleration,
    manoeuvre, map borders, hold. ``hold`` is empty, or the point (3,) [m] that the last node must meet. ``multipliers``
    (2n + 1,) >= 0 of the balls, from the step before, add the balls' curvature to the Hessian, which without it would
    let the step leave along their tangents.
    """
    n = weights.shape[1]
    size = 3 * n + 1
    looked = weights.shape[0] - 2
    h, v_max, a_max = packed[H], packed[SPEED], packed[ACCELERATION]
    infinity = 1e30
    p, slope, bend = np.empty(3), np.empty(3), np.empty((3, 3))
    hessian[:] = 0.0
    rows[:] = 0.0
    for j in range(3 * n):
        hessian[j, j] = 2.0 * h
        gradient[j] = 2.0 * h * unknowns[j]
        upper[j], lower[j] = a_max - unknowns[j], -a_max - unknowns[j]
    climb = unknowns[3 * n]
    hessian[3 * n, 3 * n], gradient[3 * n] = packed[CLIMB_WEIGHT], packed[CLIMB_WEIGHT] * climb
    upper[3 * n], lower[3 * n] = v_max - climb, -climb
    row = 0
    # Clearance, soft: z - H(x, y) >= floor.
    scale = math.sqrt(packed[TERRAIN_WEIGHT])
    for q in range(looked):
        _position(p, start, unknowns, base[q], weights[q], climbs[q])
        height, height_v, height_u = surface(terrain, p[1] / packed[SPACING], p[0] / packed[SPACING])
        hx, hy = height_u / packed[SPACING], height_v / packed[SPACING]
        for j in range(n):
            c = scale * weights[q, j]
            rows[row, 3 * j], rows[row, 3 * j + 1], rows[row, 3 * j + 2] = -c * hx, -c * hy, c
        rows[row, 3 * n] = scale * climbs[q]
        lower[size + row] = scale * (height + packed[FLOOR] - p[2])
        upper[size + row] = infinity
        row += 1
    # Terminal cost and the target approaching controls of Definition A.1, soft.
    upper[size + row], lower[size + row] = infinity, -infinity
    if packed[PSI] > 0.0:
        psi = packed[PSI]
        _position(p, start, unknowns, base[looked], weights[looked], 0.0)
        here = length_to_go(ground, ratio, scales, p[0], p[1], p[2], slope, bend)
        _positive_part(bend)
        end = weights[looked]
        for j in range(n):
            for a in range(3):
                gradient[3 * j + a] += psi * end[j] * slope[a]
                for m in range(n):
                    for b in range(3):
                        hessian[3 * j + a, 3 * m + b] += psi * end[j] * end[m] * bend[a, b]
        beyond = np.empty(3)
        _position(p, start, unknowns, base[looked + 1], weights[looked + 1], 0.0)
        there = length_to_go(ground, ratio, scales, p[0], p[1], p[2], beyond, bend)
        unit = psi / (h * packed[BETA])
        scale = math.sqrt(packed[APPROACH_WEIGHT])
        for j in range(n):
            for a in range(3):
                rows[row, 3 * j + a] = scale * unit * (weights[looked + 1, j] * beyond[a] - end[j] * slope[a])
        upper[size + row] = -scale * ((there - here) * unit + 1.0 + packed[EPSILON])
    row += 1
    # Balls |v_i| <= v_max and |a_i| <= a_max by their tangent planes at the iterate.
    v = start[3:6].copy()
    for i in range(n):
        for axis in range(3):
            v[axis] += h * unknowns[3 * i + axis]
        length = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        upper[size + row], lower[size + row] = infinity, -infinity
        if length > _SLOW:
            upper[size + row] = v_max - length
            for j in range(i + 1):
                for axis in range(3):
                    rows[row, 3 * j + axis] = h * v[axis] / length
            if multipliers[i] > 0.0:
                _bend(hessian, v / length, multipliers[i] * h * h / length, 0, i + 1)
        row += 1
    for i in range(n):
        a0, a1, a2 = unknowns[3 * i], unknowns[3 * i + 1], unknowns[3 * i + 2]
        length = math.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
        upper[size + row], lower[size + row] = infinity, -infinity
        if length > _SLOW:
            upper[size + row] = a_max - length
            rows[row, 3 * i], rows[row, 3 * i + 1], rows[row, 3 * i + 2] = a0 / length, a1 / length, a2 / length
            if multipliers[n + i] > 0.0:
                _bend(hessian, unknowns[3 * i : 3 * i + 3] / length, multipliers[n + i] / length, i, i + 1)
        row += 1
    # The manoeuvre's acceleration ((0, 0, w) - v_n) / duration.
    v[2] -= climb
    length = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    upper[size + row], lower[size + row] = infinity, -infinity
    if length > _SLOW:
        upper[size + row] = a_max * packed[MANOEUVRE] - length
        for j in range(n):
            for axis in range(3):
                rows[row, 3 * j + axis] = h * v[axis] / length
        rows[row, 3 * n] = -v[2] / length
    row += 1
    # On the map: the last node and the end of the manoeuvre.
    for q in (looked, looked - 1):
        _position(p, start, unknowns, base[q], weights[q], climbs[q])
        for axis in range(2):
            for j in range(n):
                rows[row, 3 * j + axis] = weights[q, j]
            side = packed[WIDTH] if axis == 0 else packed[DEPTH]
            upper[size + row], lower[size + row] = side - BORDER - p[axis], BORDER - p[axis]
            row += 1
    if hold.size > 0:
        _position(p, start, unknowns, base[looked], weights[looked], 0.0)
        for axis in range(3):
            for j in range(n):
                rows[row, 3 * j + axis] = weights[looked, j]
            upper[size + row] = lower[size + row] = hold[axis] - p[axis]
            row += 1


@njit(cache=True, nogil=True)
def _bend(hessian: Array, direction: Array, strength: float, first: int, last: int) -> None:
    """Add strength (I - e e') to every pair of the blocks first ... last - 1 of the Hessian, e a unit vector (3,)."""
    for a in range(3):
        for b in range(3):
            curvature = strength * ((1.0 if a == b else 0.0) - direction[a] * direction[b])
            for j in range(first, last):
                for m in range(first, last):
                    hessian[3 * j + a, 3 * m + b] += curvature


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
    values = np.array([max(0.0, matrix[k, k]) for k in range(3)])
    for a in range(3):
        for b in range(3):
            total = 0.0
            for k in range(3):
                total += vectors[a, k] * values[k] * vectors[b, k]
            matrix[a, b] = total
