"""Exact least distance of two plans for all future time.

Two plans are arcs of constant acceleration, then rest. Between two neighbouring breakpoints of either, with s in [0, 1]
the part of that interval that has passed, their relative position is

    Delta(s) = C + B s + A s^2,

so |Delta|^2 is a quartic. It is least at an end of the interval or where the cubic

    g(s) = Delta . Delta' = C.B + (B.B + 2 C.A) s + 3 A.B s^2 + 2 A.A s^3

goes from negative to positive. As its leading coefficient is not negative, g rises up to the smaller root of g', a
quadratic, and from the larger one on, and nowhere else has |Delta|^2 a minimum. On each of these two parts g has one
root at most, which Newton's method finds in a bracket: no degree degenerates, and at a nearly double root of g, where
|Delta|^2 hardly changes, the roots of g' are tried too.

An interval is passed over where boxes suffice: Delta stays within the convex hull of C, C + B / 2 and C + B + A, so its
distance from zero is at least that of their axis-aligned box. The whole plans have boxes as well, in several frames
about the vertical, for a plan that crosses the map askew fills the box along its axes badly.

Before its start a plan stands where it begins and after its end it rests for ever where it ends, as
``mathnavi.models.aerial.dynamics.state_at`` has it. A plan that takes over from another at its start is not flown
before: the caller passes that time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from mathnavi.interfaces.checks import check
from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.kernels import arc_at

Vector = tuple[float, float, float]


def _turned(angle: float) -> Array:
    """(3, 3) the axes of the map, turned about the vertical by an angle [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


_FRAMES = np.array([_turned(k * math.pi / 8.0) for k in range(4)])  # (F, 3, 3) in which plans have boxes
_STEPS = 80  # of Newton's method at most; a triple root takes as many
_RESOLUTION = 1e-15  # of s


@dataclass(frozen=True, eq=False)
class PlannedTrajectory:
    """Trajectory of a plan, copied to read-only arrays, with a box around the whole.

    ArgumentError for arrays that do not fit or are not finite: there is no other trajectory, also in a message.
    """

    t: Array  # (K + 1,) [s] absolute, increasing
    x: Array  # (K + 1, 6) [m, m/s] map frame, states at t; K = 0 stands still
    u: Array  # (K, 3) [m/s^2] held over [t[k], t[k + 1]]
    boxes: Array = field(init=False)  # (2, F, 3) [m] lowest and highest corners of the box in each of ``_FRAMES``
    begin: float = field(init=False)  # [s] t[0]
    speed: float = field(init=False)  # [m/s] greatest

    def __post_init__(self) -> None:
        t, x, u = (np.array(values, dtype=np.float64, order="C") for values in (self.t, self.x, self.u))
        arcs = t.size - 1
        if arcs < 0 or t.shape != (arcs + 1,) or x.shape != (arcs + 1, 6) or u.shape != (arcs, 3):
            shapes = f"t {t.shape}, x {x.shape}, u {u.shape}"
            raise ArgumentError(f"{shapes}; allowed: (K + 1,), (K + 1, 6), (K, 3) with K >= 0")
        if not (np.isfinite(t).all() and np.isfinite(x).all() and np.isfinite(u).all()):
            raise ArgumentError("t, x or u is not finite; allowed: finite values")
        if not (np.diff(t) > 0.0).all():
            raise ArgumentError("t does not increase; allowed: increasing times")
        p, v, h = x[:, :3], x[:, 3:], np.diff(t)[:, np.newaxis]
        middle = p[:-1] + 0.5 * h * v[:-1]  # with both ends, its hull holds the arc
        hull = np.vstack([p, middle, middle + 0.5 * h * (v[:-1] + h * u)])
        for values in (t, x, u):
            values.setflags(write=False)
        turned = hull @ _FRAMES  # (F, ..., 3)
        boxes = np.array([turned.min(axis=1), turned.max(axis=1)])
        speed = math.sqrt(float((v * v).sum(axis=1).max()))
        made = {"t": t, "x": x, "u": u, "boxes": boxes, "begin": float(t[0]), "speed": speed}
        for name, value in made.items():
            object.__setattr__(self, name, value)

    @staticmethod
    def from_plan(plan: Plan | PlannedTrajectory) -> PlannedTrajectory:
        """Make the trajectory of a plan; ArgumentError for a failure or arrays that do not fit or are not finite."""
        if isinstance(plan, PlannedTrajectory):
            return plan
        if not plan.ok:
            raise ArgumentError(f"status = {plan.status.name}; allowed: OK")
        return PlannedTrajectory(plan.t, plan.x, plan.u)


def least_distance(plan_a: Plan | PlannedTrajectory, plan_b: Plan | PlannedTrajectory, t: float) -> float:
    """Least distance min |p_a(s) - p_b(s)| [m] over s in [t, infinity).

    Raises ValueError for what ``PlannedTrajectory.from_plan`` refuses.
    """
    check(t, "t", -math.inf)
    a, b = PlannedTrajectory.from_plan(plan_a), PlannedTrajectory.from_plan(plan_b)
    return math.sqrt(_least_squared(a.t, a.x, a.u, b.t, b.x, b.u, float(t), math.inf))


def clear(plan_a: Plan | PlannedTrajectory, plan_b: Plan | PlannedTrajectory, distance: float, t: float) -> bool:
    """True if |p_a(s) - p_b(s)| >= distance [m] for all s in [t, infinity); no roots where boxes suffice.

    ValueError for what ``PlannedTrajectory.from_plan`` refuses and for a negative distance.
    """
    check(distance, "distance", 0.0)
    check(t, "t", -math.inf)
    a, b = PlannedTrajectory.from_plan(plan_a), PlannedTrajectory.from_plan(plan_b)
    return all(clear_of_each(a, [b], np.array([distance], dtype=np.float64), np.array([t], dtype=np.float64)))


def clear_of_each(
    plan: PlannedTrajectory, others: Sequence[PlannedTrajectory], distances: Array, times: Array
) -> list[bool]:
    """True, for each other plan, if |p(s) - p_k(s)| >= distances[k] [m] for all s in [times[k], infinity), (n,) each.

    For most plans of a large fleet the boxes decide, for all of them at once.
    """
    if not others:
        return []
    squared = distances * distances
    boxes = np.concatenate([other.boxes for other in others]).reshape(-1, *plan.boxes.shape)
    gaps = np.maximum(np.maximum(boxes[:, 0] - plan.boxes[1], plan.boxes[0] - boxes[:, 1]), 0.0)
    apart = np.einsum("kfi,kfi->kf", gaps, gaps).max(axis=1)
    clear_by_box = apart > squared * (1.0 + 1e-9)  # rounding of a box decides nothing
    found: list[bool] = clear_by_box.tolist()
    for k in np.flatnonzero(~clear_by_box).tolist():
        b, cap = others[k], float(squared[k])
        found[k] = _least_squared(plan.t, plan.x, plan.u, b.t, b.x, b.u, float(times[k]), cap) >= cap
    return found


@inner_njit(nogil=True, error_model="numpy")
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True, error_model="numpy")
def _at(C: Vector, B: Vector, A: Vector, s: float) -> Vector:
    """C + B s + A s^2."""
    return C[0] + s * (B[0] + s * A[0]), C[1] + s * (B[1] + s * A[1]), C[2] + s * (B[2] + s * A[2])


@njit(cache=True, nogil=True, error_model="numpy")
def _motion(breaks: Array, x: Array, u: Array, k: int, t: float) -> tuple[Vector, Vector, Vector]:
    """Position, velocity and acceleration of arc k at t; at rest before the first and after the last."""
    zero = (0.0, 0.0, 0.0)
    if k < 0 or k >= len(u):
        row = 0 if k < 0 else len(u)
        return (x[row, 0], x[row, 1], x[row, 2]), zero, zero
    s = t - breaks[k]
    a = (u[k, 0], u[k, 1], u[k, 2])
    v = (x[k, 3], x[k, 4], x[k, 5])
    p = _at((x[k, 0], x[k, 1], x[k, 2]), v, (0.5 * a[0], 0.5 * a[1], 0.5 * a[2]), s)
    return p, (v[0] + s * a[0], v[1] + s * a[1], v[2] + s * a[2]), a


@inner_njit(nogil=True, error_model="numpy")
def _box_squared(C: Vector, B: Vector, A: Vector) -> float:
    """Squared distance of zero from the box around the hull of C + B s + A s^2, 0 <= s <= 1."""
    total = 0.0
    for i in range(3):
        middle, end = C[i] + 0.5 * B[i], C[i] + B[i] + A[i]
        gap = max(min(C[i], middle, end), -max(C[i], middle, end), 0.0)
        total += gap * gap
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def _rate(C: Vector, B: Vector, A: Vector, s: float) -> tuple[float, float]:
    """g and g' at s, from the vectors: the cubic's coefficients would cancel."""
    delta = _at(C, B, A, s)
    slope = (B[0] + 2.0 * s * A[0], B[1] + 2.0 * s * A[1], B[2] + 2.0 * s * A[2])
    return _dot(delta, slope), _dot(slope, slope) + 2.0 * _dot(A, delta)


@inner_njit(nogil=True, error_model="numpy")
def _least_where_rising(C: Vector, B: Vector, A: Vector, low: float, high: float) -> float:
    """Least |Delta|^2 on [low, high], where g rises: at the one root of g, or at an end."""
    here, there = _at(C, B, A, low), _at(C, B, A, high)
    least = min(_dot(here, here), _dot(there, there))
    if not (_rate(C, B, A, low)[0] < 0.0 < _rate(C, B, A, high)[0]):
        return least
    s = 0.5 * (low + high)
    for _ in range(_STEPS):
        g, slope = _rate(C, B, A, s)
        if g > 0.0:
            high = s
        else:
            low = s
        after = s - g / slope
        if not low <= after <= high:  # nor is NaN
            after = 0.5 * (low + high)
        moved = abs(after - s)
        s = after
        if moved <= _RESOLUTION:
            break
    met = _at(C, B, A, s)
    return min(least, _dot(met, met))


@inner_njit(nogil=True, error_model="numpy")
def _least_on_interval(C: Vector, B: Vector, A: Vector) -> float:
    """Least |C + B s + A s^2|^2 over 0 <= s <= 1."""
    c0, c1, c2 = _dot(B, B) + 2.0 * _dot(C, A), 6.0 * _dot(A, B), 6.0 * _dot(A, A)  # of g'
    discriminant = c1 * c1 - 4.0 * c2 * c0
    if not discriminant > 0.0:
        return _least_where_rising(C, B, A, 0.0, 1.0)
    z = -0.5 * (c1 + math.copysign(math.sqrt(discriminant), c1))  # not 0
    one, other = z / c2, c0 / z
    first, second = min(max(min(one, other), 0.0), 1.0), min(max(max(one, other), 0.0), 1.0)
    return min(_least_where_rising(C, B, A, 0.0, first), _least_where_rising(C, B, A, second, 1.0))


@njit(cache=True, nogil=True, error_model="numpy")
def _least_squared(
    t_a: Array, x_a: Array, u_a: Array, t_b: Array, x_b: Array, u_b: Array, t: float, cap: float
) -> float:
    """Least |p_a - p_b|^2 over [t, infinity), or ``cap`` if that is less."""
    i, j = arc_at(t_a, t), arc_at(t_b, t)
    least = cap
    while True:
        p_a, v_a, a_a = _motion(t_a, x_a, u_a, i, t)
        p_b, v_b, a_b = _motion(t_b, x_b, u_b, j, t)
        C = (p_a[0] - p_b[0], p_a[1] - p_b[1], p_a[2] - p_b[2])
        if i >= len(u_a) and j >= len(u_b):
            return min(least, _dot(C, C))
        end_a = t_a[i + 1] if i < len(u_a) else math.inf
        end_b = t_b[j + 1] if j < len(u_b) else math.inf
        end = min(end_a, end_b)
        h = end - t
        q = 0.5 * h * h
        B = (h * (v_a[0] - v_b[0]), h * (v_a[1] - v_b[1]), h * (v_a[2] - v_b[2]))
        A = (q * (a_a[0] - a_b[0]), q * (a_a[1] - a_b[1]), q * (a_a[2] - a_b[2]))
        if _box_squared(C, B, A) < least:
            least = min(least, _least_on_interval(C, B, A))
        t = end
        i += end_a == end
        j += end_b == end
