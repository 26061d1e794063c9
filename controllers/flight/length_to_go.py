"""Length-to-go of the factored cost, compiled: the shape of Psi without its factor beta / v_c (see ``cost_to_go``).

    L(p) = sqrt(|p - p_f|^2 + l^2) tau(p) - l,

tau a tricubic spline in the stretched coordinates (layer, row, column). The array arguments are those of
``cost_to_go.FactoredCost``: spline coefficients of the grid's ground and of tau, and ``scales`` (8,).
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.controllers.flight.spline import surface, surface_curvature, volume
from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array

TARGET_LENGTH = 50.0  # [m] l: within it the distance to the target is rounded off


@inner_njit(nogil=True)
def length_to_go(
    ground: Array, ratio: Array, scales: Array, x: float, y: float, z: float, gradient: Array, hessian: Array
) -> float:
    """sqrt(|p - p_f|^2 + l^2) tau(p) - l [m]; fills its gradient (3,) and Hessian (3, 3)."""
    x_0, y_0, spacing, level_0, layer_spacing = scales[0], scales[1], scales[2], scales[3], scales[4]
    v, w = (y - y_0) / spacing, (x - x_0) / spacing
    floor, floor_v, floor_w = surface(ground, v, w)
    floor_vv, floor_vw, floor_ww = surface_curvature(ground, v, w)
    u = (z - floor - level_0) / layer_spacing
    dt = np.empty(3)
    ddt = np.empty((3, 3))
    tau = volume(ratio, u, v, w, dt, ddt)
    # Chain rule from (u, v, w) to (x, y, z); u depends on all three.
    jacobian = np.empty((3, 3))
    jacobian[:] = 0.0
    jacobian[0, 0], jacobian[0, 1] = -floor_w / (spacing * layer_spacing), -floor_v / (spacing * layer_spacing)
    jacobian[0, 2] = 1.0 / layer_spacing
    jacobian[1, 1] = jacobian[2, 0] = 1.0 / spacing
    tau_p = np.empty(3)
    tau_pp = np.empty((3, 3))
    for a in range(3):
        tau_p[a] = tau_pp[a, 0] = tau_pp[a, 1] = tau_pp[a, 2] = 0.0
        for k in range(3):
            tau_p[a] += jacobian[k, a] * dt[k]
            for b in range(3):
                for m in range(3):
                    tau_pp[a, b] += jacobian[k, a] * ddt[k, m] * jacobian[m, b]
    floor_factor = -dt[0] / (spacing * spacing * layer_spacing)
    tau_pp[0, 0] += floor_factor * floor_ww
    tau_pp[0, 1] += floor_factor * floor_vw
    tau_pp[1, 0] += floor_factor * floor_vw
    tau_pp[1, 1] += floor_factor * floor_vv
    d = np.empty(3)
    d[0], d[1], d[2] = x - scales[5], y - scales[6], z - scales[7]
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
