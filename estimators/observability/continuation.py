"""Curves F(x) = 0 of n - 1 equations in n unknowns, followed by pseudo-arclength continuation.

From a point x on the curve with the unit tangent t, F'(x) t = 0, the predictor is x + ds t; Newton's method brings it
back within the plane across the tangent,

    F(x) = 0,   t . (x - (x_0 + ds t)) = 0,

which also works where the curve turns back in a coordinate. The curve ends where it closes, or at the boundary of the
allowed set, which shortened steps approach. Steps are also shortened where the curve bends much within one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array

Equations = Callable[[Array], tuple[Array, Array]]
"""x (n,) to F (n - 1,) and F' (n - 1, n), which are not finite where x is not allowed"""

Difference = Callable[[Array, Array], Array]

_NEWTON = 12  # steps
_NEAR = 1e-5  # |F| of a start
_CONVERGED = 1e-12  # of |F| over the size of its unknowns
_NEAREST = 1e-8  # distance of the last point from the boundary, in units of the step
_STRAIGHT = 1.2  # a step is shortened where it is longer, or turns more, than it would nearly straight on
_LEAST_POINTS = 4  # of a closed curve


class End(Enum):
    """Reason why a curve ends; the value is its text for the user."""

    CLOSED = "it closes"
    BOUNDARY = "it leaves what is allowed"
    TOO_LONG = "it is longer than was asked for"


@dataclass(frozen=True)
class TracedCurve:
    """Points of a curve in their order; a closed one does not repeat its first point."""

    points: Array  # (k, n)
    ends: tuple[End, End]  # of the first and of the last point

    @property
    def closed(self) -> bool:
        """True if the curve closes."""
        return self.ends[0] is End.CLOSED


def subtract(a: Array, b: Array) -> Array:
    """Difference a - b (n,) of a, b (n,), if no unknown is an angle."""
    difference: Array = a - b
    return difference


def trace_curve(
    equations: Equations,
    start: Array,
    step: float = 0.01,
    longest: float = 1e3,
    difference: Difference = subtract,
) -> TracedCurve:
    """The curve through ``start`` (n,), a point on it to 1e-5, both ways, at points ``step`` apart.

    ``difference`` wraps the unknowns that are angles, so that a curve may close after a turn. Raises ArgumentError if
    the start is not on the curve, or if the step or the length is not positive.
    """
    if not (math.isfinite(step) and step > 0.0 and longest > 0.0):
        raise ArgumentError(f"step = {step!r}, longest = {longest!r}; allowed: positive numbers")
    nearby = on_curve(equations, start)
    if nearby is None:
        raise ArgumentError(f"start = {start.tolist()} is not on the curve; allowed: F = 0")
    start, tangent = nearby
    forward, end = _followed(equations, start, tangent, step, longest, difference)
    if end is End.CLOSED:
        return TracedCurve(forward, (end, end))
    backward, beginning = _followed(equations, start, -tangent, step, longest, difference)
    return TracedCurve(np.vstack([backward[:0:-1], forward]), (beginning, end))


def on_curve(equations: Equations, x: Array) -> tuple[Array, Array] | None:
    """The point of the curve next to x (n,), where F is zero to 1e-5, and the tangent at x; None if there is no such
    point.
    """
    F, J = equations(x)
    if not (np.isfinite(J).all() and np.abs(F).max() <= _NEAR):
        return None
    tangent = np.linalg.svd(J)[2][-1]
    point = corrected(equations, x, tangent)
    return None if point is None else (point, tangent)


def corrected(equations: Equations, point: Array, tangent: Array) -> Array | None:
    """The point (n,) of the curve in the plane across ``tangent`` (n,) through ``point``; None if none is found."""
    x = point
    for _ in range(_NEWTON):
        F, J = equations(x)
        if not (np.isfinite(F).all() and np.isfinite(J).all()):
            return None
        residual = np.append(F, tangent @ (x - point))
        if np.abs(residual).max() <= _CONVERGED * max(1.0, np.abs(x).max()):
            return x
        try:
            x = x - np.linalg.solve(np.vstack([J, tangent]), residual)
        except np.linalg.LinAlgError:
            return None
    return None


def _followed(
    equations: Equations, start: Array, tangent: Array, step: float, longest: float, difference: Difference
) -> tuple[Array, End]:
    """Points (k, n) from the start on along a tangent, and the reason why they end."""
    points, length = [start], 0.0
    while length < longest:
        x, ds = points[-1], step
        while (after := _next(equations, x, tangent, ds)) is None:
            ds *= 0.5
            if ds < _NEAREST * step:
                return np.array(points), End.BOUNDARY
        x, tangent = after
        if len(points) >= _LEAST_POINTS and _passes(points[-1], x, start, difference):
            return np.array(points), End.CLOSED
        points.append(x)
        length += ds
    return np.array(points), End.TOO_LONG


def _next(equations: Equations, x: Array, tangent: Array, ds: float) -> tuple[Array, Array] | None:
    """The next point and the tangent there; None if it was not found, or if it may belong to another branch."""
    found = corrected(equations, x + ds * tangent, tangent)
    if found is None or np.linalg.norm(found - x) > _STRAIGHT * ds:
        return None
    turned = np.linalg.svd(equations(found)[1])[2][-1]
    along = float(turned @ tangent)
    if abs(along) < 1.0 / _STRAIGHT:
        return None
    return found, turned * math.copysign(1.0, along)


def _passes(before: Array, after: Array, start: Array, difference: Difference) -> bool:
    """True if the start lies on the way from one point to the next."""
    way, to_start = difference(after, before), difference(start, before)
    share = float(way @ to_start) / float(way @ way)
    return 0.0 < share <= 1.0 and float(np.linalg.norm(to_start - share * way)) < 0.1 * float(np.linalg.norm(way))
