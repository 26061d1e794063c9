"""Walls, sensors and poses that tests of range estimators have in common."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import strategies as st

from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import BEAN, EGG, Curve, ellipse
from mathnavi.models.unicycle.kernels import integrate

FIELD = ellipse(3.763, math.sqrt(2.0))
WALLS = (FIELD, EGG, BEAN)
SENSORS = {
    "2t": (-90.0, -45.0),
    "2s": (-60.0, 60.0),
    "3": (0.0, 120.0, 240.0),
    "4": (0.0, 90.0, 180.0, 270.0),
}  # [deg]

walls = st.sampled_from(WALLS)
angles = st.sampled_from([tuple(math.radians(angle) for angle in angles) for angles in SENSORS.values()])
seeds = st.integers(0, 2**32 - 1)


def clear_pose(curve: Curve, alpha: Array, rng: np.random.Generator, margin: float = 0.2) -> Array:
    """A pose (3,) from which no ray is near to grazing the wall, so that ranges are smooth around it."""
    while True:
        pose = curve.draw(rng, margin)
        if _slant(curve, pose, alpha) > 0.3:
            return pose


def ranges_around(curve: Curve, alpha: Array, pose: Array, u: Array, h: float) -> tuple[Array, Array]:
    """rho (5, l) and s (5, l), continuous, at -2 h, ..., 2 h [s] of a motion with u (2,) through ``pose`` (3,)."""
    seen = [curve.ranges(integrate(pose, u[0], u[1], k * h), alpha) for k in (-2, -1, 0, 1, 2)]
    return np.array([rho for rho, _ in seen]), np.unwrap(np.array([s for _, s in seen]), axis=0)


def central_difference(values: Array, h: float) -> Array:
    """The derivative in the middle of values (5, ...) at a distance h, to fourth order."""
    slope: Array = (values[0] - 8.0 * values[1] + 8.0 * values[3] - values[4]) / (12.0 * h)
    return slope


def _slant(curve: Curve, pose: Array, alpha: Array) -> float:
    """The least sine between a ray and the wall that it meets."""
    _, s = curve.ranges(pose, alpha)
    tangent = curve.tangent(s)
    beta = pose[2] + alpha
    across = tangent[:, 1] * np.cos(beta) - tangent[:, 0] * np.sin(beta)
    return float((np.abs(across) / np.linalg.norm(tangent, axis=1)).min())
