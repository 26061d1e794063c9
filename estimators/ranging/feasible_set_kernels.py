"""Projection of poses onto the set of feasible states (Definition C.9), compiled.

    FS_y = {x : h(x) = y}

A pose is projected onto it by Gauss-Newton steps d, each the shortest that solves the linearised equations. Readings
are noisy, so y is an average with variances v_i, and the step weighs the equations accordingly:

    d = argmin sum_i (y_i - h_i - H_i d)^2 / v_i + |d|^2   [m, rad],   which is the shortest one where v is small.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.ranging.kalman_kernels import expected_range, move, step_within
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.field.kernels import WallShape
from mathnavi.models.unicycle.kernels import wrapped

_LONGEST = 1.0  # [m, rad] of a step in any coordinate


@njit(cache=True, nogil=True)
def project(
    states: Array, y: Array, v: Array, wall: WallShape, rays: Array, steps: int, gate: float
) -> tuple[Array, Array]:
    """Take ``steps`` steps from ``states`` (m, 4) to FS_y.

    Returns the states (m, 4) and their squared distances from FS_y then, sum_i min((y_i - h_i)^2 / v_i, gate) (m,): an
    outlier counts as the ``gate``. y (l,) [m] is NaN where a ray was lost, v (l,) [m^2], ``rays`` (l, 3) [rad, m, m].
    The distance is infinite for a pose with a ray without information.
    """
    projected, far = states.copy(), np.empty(len(states))
    A, g, H, D = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    for m in range(len(states)):
        x = projected[m]
        for step in range(steps + 1):
            far[m] = 0.0
            A[:], g[:] = np.eye(3), 0.0
            for i in range(len(y)):
                if math.isnan(y[i]):
                    continue
                h, _, _, _ = expected_range(wall, x, rays[i], H, D)
                if math.isnan(h):
                    far[m] = math.inf
                    break
                residual = y[i] - h
                far[m] += min(residual * residual / v[i], gate)
                for a in range(3):
                    g[a] += H[a] * residual / v[i]
                    for b in range(3):
                        A[a, b] += H[a] * H[b] / v[i]
            if step == steps or math.isinf(far[m]):
                break
            _move(x, solved(A, g), wall)
    return projected, far


@njit(cache=True, nogil=True)
def pushed(states: Array, inputs: Array, wall: WallShape, dt: float, first: float) -> Array:
    """Propagate ``states`` (m, 4) under ``inputs`` (n, 2), each held for dt [s], the first for the fraction ``first``
    of that.
    """
    after = states.copy()
    for m in range(len(states)):
        for k in range(len(inputs)):
            move(after[m], inputs[k], wall, dt if k else first * dt)
    return after


@njit(cache=True, nogil=True)
def farthest_points(states: Array, first: int, count: int, nearest: float) -> Integers:
    """Indices of up to ``count`` states (m, 4): the ``first``, then repeatedly the one farthest from all before.

    Distances are sqrt(|dx|^2 [m^2] + dphi^2 [rad^2]); the search ends when the farthest is no farther than ``nearest``.
    """
    far = np.full(len(states), np.inf)
    chosen = np.empty(count, np.int64)
    latest, n = first, 0
    while n < count:
        chosen[n] = latest
        n += 1
        for m in range(len(states)):
            dx, dy = states[m, 0] - states[latest, 0], states[m, 1] - states[latest, 1]
            angle = wrapped(states[m, 2] - states[latest, 2])
            far[m] = min(far[m], dx * dx + dy * dy + angle * angle)
        latest = int(np.argmax(far))
        if far[latest] <= nearest * nearest:
            break
    return chosen[:n]


@njit(cache=True, nogil=True)
def _move(x: Array, d: Array, wall: WallShape) -> None:
    """Add a step to a pose, in place, shortened until it stays within the wall."""
    scale = min(1.0, _LONGEST / max(abs(d[0]), abs(d[1]), abs(d[2]), 1e-300))
    scale *= step_within(wall, x[0], x[1], scale * d[0], scale * d[1])
    for a in range(3):
        x[a] += scale * d[a]
    x[2] = wrapped(x[2])


@njit(cache=True, nogil=True)
def solved(A: Array, g: Array) -> Array:
    """Solve A w = g for w (3,), A (3, 3) positive definite, by its factors L D L'."""
    l_10, l_20 = A[1, 0] / A[0, 0], A[2, 0] / A[0, 0]
    d_1 = A[1, 1] - l_10 * A[1, 0]
    l_21 = (A[2, 1] - l_20 * A[1, 0]) / d_1
    d_2 = A[2, 2] - l_20 * A[2, 0] - l_21 * l_21 * d_1
    y_1 = g[1] - l_10 * g[0]
    y_2 = (g[2] - l_20 * g[0] - l_21 * y_1) / d_2
    y_1 = y_1 / d_1 - l_21 * y_2
    return np.array([g[0] / A[0, 0] - l_10 * y_1 - l_20 * y_2, y_1, y_2])
