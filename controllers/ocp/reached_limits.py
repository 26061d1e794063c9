"""Limits that a solution is on, and multipliers that have the wrong sign for them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mathnavi.controllers.ocp.multipliers import NamedValues
from mathnavi.controllers.ocp.problem_functions import Interval
from mathnavi.controllers.ocp.solution_view import SolutionView
from mathnavi.interfaces.signals import Array

TOUCHING = 1e-4  # of the range, the size or the scale: how near a limit counts as on it
_NEGLIGIBLE = 1e-3  # share of the other terms below which a multiplier says nothing
_SMALL = 1e-9

Flags = NDArray[np.bool_]


def touched(values: Array, limits: Interval, scale: Array) -> Flags:
    """True (..., n) where values (..., n) are on one of their limits, to a share of their scale (n,)."""
    near = TOUCHING * scale
    on: Flags = (values - limits.lower <= near) | (limits.upper - values <= near)
    return on


def constraint_sizes(values: Array, limits: Interval) -> Array:
    """Sizes (n,) of constraints: of their limits and of the values (..., n) that they take."""
    finite = [np.abs(np.where(np.isfinite(limit), limit, 0.0)) for limit in limits]
    own = np.abs(values).max(axis=tuple(range(values.ndim - 1)), initial=0.0)
    sizes: Array = np.maximum(np.maximum(*finite), np.maximum(own, _SMALL))
    return sizes


def wrong_signs(own: NamedValues, values: Array, limits: Interval, scale: Array, size: float) -> float:
    """The largest multiplier of a wrong sign, or of a limit that does not hold, over the largest of its kind.

    Multipliers are compared as shares of the cost, times the scale of what they limit; ``size`` is the magnitude that
    these are compared with.
    """
    near = 10.0 * TOUCHING * scale
    wrong = _beyond(own.values, values - limits.lower <= near, limits.upper - values <= near)
    largest = max(float(np.abs(own.values * scale).max(initial=0.0)), _NEGLIGIBLE * size)
    return float(np.abs(wrong * scale).max(initial=0.0)) / largest


def _beyond(values: Array, at_upper: Flags, at_lower: Flags) -> Array:
    """Values where they should be 0, inside; the positive ones at an upper, the negative ones at a lower limit."""
    outside = [at_upper & at_lower, at_upper, at_lower]
    parts = [np.zeros_like(values), np.maximum(values, 0.0), np.minimum(values, 0.0)]
    return np.select(outside, parts, values)


def path_values(solution: SolutionView) -> Array:
    """Values (N - 1, k, nd) of the path constraints at the scheme's points."""
    times = solution.point_times.ravel()
    x, u = solution.inner.reshape(len(times), -1), solution.u.reshape(len(times), -1)
    p = np.tile(solution.parameters[:, None], (1, len(times)))
    values = solution.problem.path.map(len(times))(x.T, u.T, times[None, :], p)
    return np.array(values.full()).T.reshape(*solution.point_times.shape, -1)
