"""Outputs of range sensors along a motion, compiled, and the pose that fits readings.

A motion is the unicycle's path under a given input, in its initial frame: d_k = (forward, left) [m] and the turn c_k
[rad] at the instants k = 0, ..., K - 1. From the pose x = (p, phi) the robot comes to (p + R_phi d_k, phi + c_k), as if
sensors were mounted along a rigid body, and reads

    y_{k i}(x) = rho(p + R_phi d_k, phi + c_k + alpha_i).
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.kernels import cast_ray, is_inside, range_gradient

_HALVINGS = 30  # of a step that leaves the field or does not fit better
_LEAST_DAMPING = 1e-14  # relative; keeps the normal equations of a deficient fit solvable
_LEAST_STEP = 1e-13  # [m, rad] below which a step is round-off, and the pose a minimum
_LEAST_GAIN = 1e-9  # of the cost, below which a step gains nothing more: a minimum that does not fit


@njit(cache=True, nogil=True)
def outputs_along(
    coefficients: Array, polyline: Array, pose: Array, motion: Array, angles: Array
) -> tuple[Array, Array]:
    """Outputs y (K l,) [m] and their Jacobian (K l, 3) from a ``pose`` (3,) along a ``motion`` (K, 3); NaN outside the
    wall.
    """
    n, sensors = len(motion), len(angles)
    y, J = np.empty(n * sensors), np.empty((n * sensors, 3))
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for k in range(n):
        dx, dy = c * motion[k, 0] - s * motion[k, 1], s * motion[k, 0] + c * motion[k, 1]
        px, py = pose[0] + dx, pose[1] + dy
        inside = is_inside(coefficients, polyline, px, py)
        for i in range(sensors):
            row = k * sensors + i
            y[row], J[row] = math.nan, math.nan
            if not inside:
                continue
            beta = pose[2] + motion[k, 2] + angles[i]
            rho, at = cast_ray(coefficients, polyline, px, py, beta)
            gx, gy, g_phi = range_gradient(coefficients, at, rho, beta)
            y[row] = rho
            J[row, 0], J[row, 1], J[row, 2] = gx, gy, g_phi + gy * dx - gx * dy
    return y, J


@njit(cache=True, nogil=True)
def fit_pose(
    coefficients: Array, polyline: Array, motion: Array, angles: Array, y: Array, start: Array, steps: int
) -> tuple[Array, float]:
    """Fit a pose (3,) near ``start`` (3,) to the outputs y (K l,) [m], by the Levenberg-Marquardt method.

    Returns the pose and its largest residual [m]. With fewer outputs than unknowns, the pose is close to the nearest
    one that fits. Steps that leave the field are shortened; the result is NaN if the motion from ``start`` leaves the
    field.
    """
    pose, damping = start.copy(), 1e-6
    found, J = outputs_along(coefficients, polyline, pose, motion, angles)
    r = found - y
    cost = float(r @ r)
    if not math.isfinite(cost):
        return pose, math.nan
    for _ in range(steps):
        H, g = J.T @ J, J.T @ r
        scale = H[0, 0] + H[1, 1] + H[2, 2]
        improved = False
        for _ in range(_HALVINGS):
            A = H + (damping + _LEAST_DAMPING) * scale * np.eye(3)
            step = np.linalg.solve(A, g)
            if np.max(np.abs(step)) < _LEAST_STEP:
                break
            trial = pose - step
            found_, J_ = outputs_along(coefficients, polyline, trial, motion, angles)
            r_ = found_ - y
            cost_ = float(r_ @ r_)
            if cost_ < cost:  # False for NaN
                improved = cost_ < (1.0 - _LEAST_GAIN) * cost
                pose, r, J, cost = trial, r_, J_, cost_
                damping *= 0.03
                break
            damping = max(10.0 * damping, 1e-9)
        if not improved or cost < 1e-28:
            break
    return pose, float(np.max(np.abs(r)))
