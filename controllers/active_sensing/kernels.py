"""The expected covariance of the pose after inputs, and how long they keep the robot within the wall, compiled.

An input is followed over N nodes x_j, h apart, of which it is held for the first n; then the robot rests. With
F_j = d x_j / d x_0, and every sensor being read h / dt times between two nodes, dt the time between readings, the error
at the last node is expected to have the covariance

    F_N (P^-1 + sum_j F_j' H_j' (h / dt) R_j^-1 H_j F_j)^-1 F_N',    H_j = d rho / d x at x_j,   R_j = diag(var rho_i),

which no process noise widens. A ray that misses the wall, or grazes it, carries no information.

So it is with beacons, whose readings are those of ``models.unicycle.beacons``. A robot with some at known places reads
them alone.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import float64, int64

from mathnavi.interfaces.compiled import Signature, njit
from mathnavi.interfaces.kernel_types import ONE, TWO, TWO_READ, array, named
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.field.kernels import (
    cast_ray,
    curve_second_derivative,
    curve_tangent,
    is_inside,
    range_gradient,
    wall_distance,
)
from mathnavi.models.field.polygon_kernels import is_polygonal
from mathnavi.models.unicycle.kernels import integrate, integrate_jacobians, mounted, sinc, wrapped

_HALVINGS = 20  # of the way from a pose to one that is too near to the wall
_ROUNDING = 1e-9  # [m]
_AT_BEACON = 1e-3  # [m] from a beacon, within which it carries no information
RANGE, BEARING, DIFFERENCE = range(3)  # kinds of readings of beacons


class WallTable(NamedTuple):
    """The wall theta(s): ``table`` and ``polyline`` of a ``models.field.wall.Wall``."""

    coefficients: Array  # (K + 1, 4) [m], or a table of segments (m, 8)
    polyline: Array  # (n + 1, 2) [m]


class RangeSensors(NamedTuple):
    """Range sensors of a robot and their noise."""

    rays: Array  # (l, 3) [rad, m, m] angle off the heading, and place in the robot's axes
    noise: Array  # (2,) standard deviation of a range: relative share, and absolute [m]


class PredictionHorizon(NamedTuple):
    """Nodes of a prediction."""

    spacing: float  # [s] h
    nodes: int  # N
    readings: float  # h / dt, of each sensor between two nodes


@njit(cache=True, nogil=True)
def expected_covariance(
    wall: WallTable,
    sensors: RangeSensors,
    horizon: PredictionHorizon,
    pose: Array,
    P: Array,
    u: Array,
    held: int,
    beacons: Array,
) -> tuple[Array, Array]:
    """Pose (3,) and covariance (3, 3) at the last node, from ``pose`` (3,) and P (3, 3) at the first.

    The input u (2,) [m/s, rad/s] is held for ``held`` nodes; then the robot rests. ``beacons`` (m, 8) are what is read
    of beacons, each with its kind, its place and that of the one to which a difference is [m], the deviation of a
    reading, absolute and by the distance, and the number of readings between two nodes.
    """
    coefficients, polyline = wall
    rays, noise = sensors
    spacing, nodes, readings = horizon
    x, F, information = pose, np.eye(3), inverse(P)
    for j in range(nodes):
        u_1, u_2 = (u[0], u[1]) if j < held else (0.0, 0.0)
        step, _ = integrate_jacobians(x, u_1, u_2, spacing)
        F, x = step @ F, integrate(x, u_1, u_2, spacing)
        for i in range(len(rays)):
            beta, (m_1, m_2) = x[2] + rays[i, 0], mounted(rays[i], x[2])
            rho, s = cast_ray(coefficients, polyline, x[0] + m_1, x[1] + m_2, beta)
            h_1, h_2, h_3 = range_gradient(coefficients, s, rho, beta)
            h_3 += h_2 * m_1 - h_1 * m_2
            if math.isfinite(h_1 + h_2 + h_3):
                row = h_1 * F[0] + h_2 * F[1] + h_3 * F[2]
                information += (readings / ((noise[0] * rho) ** 2 + noise[1] ** 2)) * np.outer(row, row)
        for i in range(len(beacons)):
            h_1, h_2, h_3, length = beacon_gradient(beacons[i], x)
            row = h_1 * F[0] + h_2 * F[1] + h_3 * F[2]
            variance = beacons[i, 5] ** 2 + (beacons[i, 6] * length) ** 2
            information += (beacons[i, 7] / variance) * np.outer(row, row)
    return x, F @ inverse(information) @ F.T


@njit(cache=True, nogil=True)
def beacon_gradient(beacon: Array, x: Array) -> tuple[float, float, float, float]:
    """Gradient by a pose x (3,) of what is read of a ``beacon`` (8,), and the distance [m] on which its noise depends.

    The gradient is zero at a beacon.
    """
    d_1, d_2 = beacon[1] - x[0], beacon[2] - x[1]
    rho = math.hypot(d_1, d_2)
    if rho < _AT_BEACON:
        return 0.0, 0.0, 0.0, rho
    e_1, e_2 = d_1 / rho, d_2 / rho
    if beacon[0] == BEARING:
        return e_2 / rho, -e_1 / rho, -1.0, rho
    if beacon[0] == RANGE:
        return -e_1, -e_2, 0.0, rho
    f_1, f_2 = beacon[3] - x[0], beacon[4] - x[1]
    first = math.hypot(f_1, f_2)
    if first < _AT_BEACON:
        return 0.0, 0.0, 0.0, rho
    return f_1 / first - e_1, f_2 / first - e_2, 0.0, abs(rho - first)


@njit(cache=True, nogil=True)
def expected_traces(
    wall: WallTable,
    sensors: RangeSensors,
    horizon: PredictionHorizon,
    pose: Array,
    P: Array,
    inputs: Array,
    held: Integers,
    beacons: Array,
) -> Array:
    """Traces (m,) of the expected covariance after each of ``inputs`` (m, 2) [m/s, rad/s] for ``held`` (m,) nodes."""
    traces = np.empty(len(inputs))
    for m in range(len(inputs)):
        _, covariance = expected_covariance(wall, sensors, horizon, pose, P, inputs[m], held[m], beacons)
        traces[m] = np.trace(covariance)
    return traces


@njit(cache=True, nogil=True)
def smallest_singular_values(wall: WallTable, angles: Array, pose: Array, inputs: Array) -> Array:
    """Least singular values (m,) of O = [d rho / dx; d rho_dot / dx] (2 l, 3) at a pose (3,), one for each input.

    ``angles`` (l,) [rad] are those of the sensors, ``inputs`` (m, 2) [m/s, rad/s].
    """
    coefficients, polyline = wall
    values = np.empty(len(inputs))
    for m in range(len(inputs)):
        rows = np.zeros((2 * len(angles), 3))
        for i in range(len(angles)):
            beta = pose[2] + angles[i]
            rho, s = cast_ray(coefficients, polyline, pose[0], pose[1], beta)
            h_1, h_2, h_3 = range_gradient(coefficients, s, rho, beta)
            if math.isfinite(h_1 + h_2 + h_3):
                rows[2 * i, 0], rows[2 * i, 1], rows[2 * i, 2] = h_1, h_2, h_3
                rows[2 * i + 1] = range_rate_gradient(coefficients, s, rho, beta, pose[2], inputs[m])
        values[m] = math.sqrt(max(0.0, np.linalg.eigvalsh(rows.T @ rows)[0]))
    return values


@njit(cache=True, nogil=True)
def range_rate_gradient(coefficients: Array, s: float, rho: float, beta: float, phi: float, u: Array) -> Array:
    """Gradient d rho_dot / d (x_1, x_2, phi) (3,) of a ray along ``beta`` [rad] that ends at theta(s), under u (2,).

    With t = theta'(s), e = (cos beta, sin beta) and D = e x t,

        rho_dot = (u_1 (t_1 sin phi - t_2 cos phi) + rho u_2 e . t) / D,

    in which s and rho move with the pose as (C.4) has it: D ds = e x dx + rho d phi.
    """
    t_1, t_2 = curve_tangent(coefficients, s)
    b_1, b_2 = curve_second_derivative(coefficients, s)
    e_1, e_2, c, sn = math.cos(beta), math.sin(beta), math.cos(phi), math.sin(phi)
    D, dot = e_1 * t_2 - e_2 * t_1, e_1 * t_1 + e_2 * t_2
    rate = (u[0] * (t_1 * sn - t_2 * c) + rho * u[1] * dot) / D
    # Partial derivatives by s, by rho and by phi.
    by_s = (u[0] * (b_1 * sn - b_2 * c) + rho * u[1] * (e_1 * b_1 + e_2 * b_2) - rate * (e_1 * b_2 - e_2 * b_1)) / D
    by_rho = u[1] * dot / D
    by_phi = (u[0] * (t_1 * c + t_2 * sn) + rho * u[1] * D + rate * dot) / D
    s_slope = np.array([-e_2 / D, e_1 / D, rho / D])
    rho_slope = np.array([-t_2 / D, t_1 / D, rho * dot / D])
    slope: Array = by_s * s_slope + by_rho * rho_slope + by_phi * np.array([0.0, 0.0, 1.0])
    return slope


@njit(cache=True, nogil=True)
def nodes_within(wall: WallTable, poses: Array, margin: float, inputs: Array, spacing: float, nodes: int) -> Integers:
    """Number (m,) of ``nodes``, ``spacing`` [s] apart, for which ``inputs`` (m, 2) may be held from all ``poses``
    (n, 3).

    None of these comes nearer to the wall than ``margin`` [m], or than it is where it is nearer already.
    """
    least = np.empty(len(poses))
    for i in range(len(poses)):
        least[i] = min(margin, clearance(wall, poses[i, 0], poses[i, 1])) - _ROUNDING
    kept = np.full(len(inputs), nodes)
    for m in range(len(inputs)):
        for i in range(len(poses)):
            x = poses[i]
            for j in range(kept[m]):
                x = integrate(x, inputs[m, 0], inputs[m, 1], spacing)
                if clearance(wall, x[0], x[1]) < least[i]:
                    kept[m] = j
                    break
    return kept


@njit(cache=True, nogil=True)
def sigma_poses(wall: WallTable, pose: Array, P: Array, deviations: float, margin: float) -> Array:
    """A pose (3,) and those k ``deviations`` from it along the axes of its covariance P (3, 3), as rows (7, 3).

    One that is nearer to the wall than ``margin`` [m], and than the pose itself, is drawn back to where it is not.
    """
    margin = min(margin, clearance(wall, pose[0], pose[1]))
    values, axes = np.linalg.eigh(P)
    poses = np.empty((7, 3))
    poses[0] = pose
    for i in range(6):
        offset = deviations * math.sqrt(max(0.0, values[i // 2])) * axes[:, i // 2] * (1.0 - 2.0 * (i % 2))
        low, high = 0.0, 1.0
        if clearance(wall, pose[0] + offset[0], pose[1] + offset[1]) >= margin:
            low = 1.0
        else:
            for _ in range(_HALVINGS):
                middle = 0.5 * (low + high)
                if clearance(wall, pose[0] + middle * offset[0], pose[1] + middle * offset[1]) >= margin:
                    low = middle
                else:
                    high = middle
        poses[1 + i] = pose + low * offset
    return poses


@njit(cache=True, nogil=True)
def clearance(wall: WallTable, x_1: float, x_2: float) -> float:
    """Distance [m] of a point (x_1, x_2) [m] from a polygon, or the nearest point of a curve's polyline; negative
    outside the wall.
    """
    coefficients, polyline = wall
    if is_polygonal(coefficients):
        far = wall_distance(coefficients, polyline, x_1, x_2)
        return far if is_inside(coefficients, polyline, x_1, x_2) else -far
    square = math.inf
    for k in range(len(polyline) - 1):
        d_1, d_2 = polyline[k, 0] - x_1, polyline[k, 1] - x_2
        square = min(square, d_1 * d_1 + d_2 * d_2)
    distance = math.sqrt(square)
    return distance if is_inside(coefficients, polyline, x_1, x_2) else -distance


@njit(cache=True, nogil=True)
def inverse(M: Array) -> Array:
    """Inverse of a symmetric positive semidefinite M (3, 3), M != 0, after 1e-12 tr M is added to its diagonal."""
    tiny = 1e-12 * (M[0, 0] + M[1, 1] + M[2, 2])
    a, b, c = M[0, 0] + tiny, M[0, 1], M[0, 2]
    d, e, f = M[1, 1] + tiny, M[1, 2], M[2, 2] + tiny
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    D, E, G = a * f - c * c, b * c - a * e, a * d - b * b
    inverted: Array = np.array([[A, B, C], [B, D, E], [C, E, G]]) / (a * A + b * B + c * C)
    return inverted


# Kernels that are compiled before a run (``sim.engine.compilation``), for arguments of these types.
WALL = named(WallTable, TWO_READ, TWO_READ)
SENSORS = named(RangeSensors, TWO, ONE)
HORIZON = named(PredictionHorizon, float64, int64, float64)
MOTION = (ONE, float64, float64, float64)  # pose, inputs and duration
KERNELS: tuple[Signature, ...] = (
    (expected_traces, (WALL, SENSORS, HORIZON, ONE, TWO, TWO, array(1, int64), TWO)),
    (nodes_within, (WALL, TWO, float64, TWO, float64, int64)),
    (sigma_poses, (WALL, ONE, TWO, float64, float64)),
    (clearance, (WALL, float64, float64)),
    (is_inside, (TWO_READ, TWO_READ, float64, float64)),
    (wall_distance, (TWO_READ, TWO_READ, float64, float64)),
    (integrate, MOTION),
    (integrate_jacobians, MOTION),
    (sinc, (float64,)),
    (wrapped, (float64,)),
)
