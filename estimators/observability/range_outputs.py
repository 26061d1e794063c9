"""The output map h of a unicycle with range sensors, y = h(x), with its derivative and along motions.

    y_i = rho(p, phi + alpha_i),   i = 1, ..., l                                                   (thesis C.4)

A pose is x = (p, phi) [m, m, rad]. Poses are compared with a radian counted as a metre, angles by their wrapped
difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated

import numpy as np

from mathnavi.estimators.observability.kernels import fit_pose, outputs_along
from mathnavi.interfaces.bounds import Condition, configuration
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.models.field.curve import Curve
from mathnavi.models.unicycle.kernels import integrate

Input = Callable[[float], tuple[float, float]]
"""function of t [s] that returns u = (u_1, u_2) [m/s, rad/s]"""

STILL = np.zeros((1, 3))
"""motion (1, 3) at rest: one reading at the start"""

DEFICIENT = 1e-6
"""singular value of a derivative of outputs [m] by the pose, below which it counts as zero"""

_FIT_STEPS = 60
_FITTED = 1e-9  # [m] of the largest residual


@configuration
class RangeOutputs:
    """Output map h of sensors at ``angles`` (l,) [rad] off the heading within a wall."""

    curve: Curve
    angles: Annotated[tuple[float, ...], Condition(bool, "one sensor or more")]

    @property
    def sensors(self) -> int:
        """Number l of sensors."""
        return len(self.angles)

    @property
    def alpha(self) -> Array:
        """Angles (l,) [rad] of the sensors off the heading."""
        return np.array(self.angles)

    def at(self, x: Array) -> tuple[Array, Array]:
        """Output h(x) (l,) [m] and its derivative h'(x) (l, 3) at x (3,); NaN outside the wall."""
        return self.along(x, STILL)

    def along(self, x: Array, motion: Array) -> tuple[Array, Array]:
        """Outputs y (K l,) [m], instant after instant, and their derivative (K l, 3) by x (3,) along a motion (K, 3).

        NaN where the robot is outside the wall.
        """
        y, J = outputs_along(self.curve.table, self.curve.polyline, np.asarray(x, np.float64), motion, self.alpha)
        return y, J

    def fit(self, y: Array, start: Array, motion: Array = STILL) -> Array | None:
        """Pose (3,) that reads y (K l,) [m] along a motion (K, 3), from ``start`` (3,); None if none is found."""
        start = np.asarray(start, np.float64)
        x, residual = fit_pose(self.curve.table, self.curve.polyline, motion, self.alpha, y, start, _FIT_STEPS)
        x[2] = wrapped(x[2])
        return x if residual <= _FITTED else None

    def rate(self, x: Array, u: tuple[float, float]) -> Array:
        """Output rate y' = L_f h (l,) [m/s] at x (3,) under the input u [m/s, rad/s]."""
        _, J = self.at(x)
        rate: Array = J @ np.array([u[0] * math.cos(x[2]), u[0] * math.sin(x[2]), u[1]])
        return rate


def motion_under(input_at: Input, duration: float, instants: int = 20) -> Array:
    """Motion (instants, 3) under an input: forward, left [m], turned [rad] at equal times up to ``duration`` [s].

    The first instant is 0; inputs are held in between, at their value in the middle. Raises ArgumentError for a
    duration that is not positive, or fewer than two instants.
    """
    if not (math.isfinite(duration) and duration > 0.0 and instants >= 2):
        raise ArgumentError(f"duration = {duration!r} s, instants = {instants!r}; allowed: > 0, and 2 or more")
    dt = duration / (instants - 1)
    x, motion = np.zeros(3), np.zeros((instants, 3))
    for k in range(1, instants):
        u_1, u_2 = input_at((k - 0.5) * dt)
        x = integrate(x, u_1, u_2, dt)
        motion[k] = x
    return motion


def pose_difference(a: Array, b: Array) -> Array:
    """Difference a - b (..., 3) [m, m, rad] of poses a, b (..., 3), the headings wrapped."""
    difference: Array = np.asarray(a, np.float64) - b
    difference[..., 2] = wrapped(difference[..., 2])
    return difference


def different_poses(poses: Array, tolerance: float) -> Array:
    """Different poses (k, 3): ``poses`` (n, 3) without those within ``tolerance`` of an earlier one."""
    kept: list[Array] = []
    for x in poses:
        if all(np.linalg.norm(pose_difference(x, other)) > tolerance for other in kept):
            kept.append(x)
    return np.array(kept).reshape(-1, 3)
