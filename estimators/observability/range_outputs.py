"""The output map h of a unicycle with range sensors, y = h(x), with its derivative and along motions.

    y_i = rho(p, phi + alpha_i),   i = 1, ..., l                                                   (thesis C.4)

A pose is x = (p, phi) [m, m, rad]. Poses are compared with a radian counted as a metre, angles by their wrapped
difference.

Outputs of range sensors along a motion, compiled, and the pose that fits readings.

A motion is the unicycle's path under a given input, in its initial frame: d_k = (forward, left) [m] and the turn c_k
[rad] at the instants k = 0, ..., K - 1. From the pose x = (p, phi) the robot comes to (p + R_phi d_k, phi + c_k), as if
sensors were mounted along a rigid body, and reads

    y_{k i}(x) = rho(p + R_phi d_k, phi + c_k + alpha_i).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated

import numpy as np

from mathnavi.interfaces.bounds import Condition, configuration
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.models.field.curve import Curve, smooth
from mathnavi.models.field.kernels import cast_ray, is_inside, range_gradient
from mathnavi.models.unicycle.kernels import integrate

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
    """Output map h of sensors at ``angles`` (l,) [rad] off the heading within a wall.

    Raises MissionError for a polygon.
    """

    curve: Curve
    angles: Annotated[tuple[float, ...], Condition(bool, "one sensor or more")]

    def __post_init__(self) -> None:
        smooth(self.curve, "a feasible set", "it is a curve by the implicit function theorem, so h has a derivative")

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
