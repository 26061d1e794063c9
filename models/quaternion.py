"""Rotation matrices of unit quaternions (w, x, y, z): one statement for numbers, arrays, expressions and kernels."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array


def rotation_entries(w: Any, x: Any, y: Any, z: Any) -> tuple[tuple[Any, Any, Any], ...]:
    """Rows of R, which leads from the frame of the body to the one in which the quaternion is given."""
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def symbolic_rotation(q: casadi.SX) -> casadi.SX:
    """R (3, 3) of a unit quaternion (4,) of expressions."""
    R: casadi.SX = casadi.vertcat(*(casadi.horzcat(*row) for row in rotation_entries(*casadi.vertsplit(q))))
    return R


_compiled_entries = njit(nogil=True)(rotation_entries)


@njit(cache=True, nogil=True)
def rotation(q: Array) -> Array:
    """R (3, 3) of a unit quaternion (4,)."""
    rows = _compiled_entries(q[0], q[1], q[2], q[3])
    R = np.empty((3, 3))
    for i in range(3):
        R[i, 0], R[i, 1], R[i, 2] = rows[i]
    return R
