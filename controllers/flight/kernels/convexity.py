"""Curvature that enters a Hessian, kept positive definite, compiled."""

from __future__ import annotations

import math

import numpy as np

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
