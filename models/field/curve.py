"""Closed smooth curves that wall in a field: theta : S^1 -> R^2 of Paper C, as a finite Fourier series

    theta(s) = sum_{k=0}^K a_k cos ks + b_k sin ks,   a_k, b_k in R^2 [m],

so that an ellipse is K = 1 and every derivative is exact. The curve is simple, regular and runs counter-clockwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import casadi
import numpy as np

from mathnavi.interfaces.errors import ArgumentError, FieldError, MissionError
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.wall import Wall, fixed

Coefficients = tuple[tuple[float, float, float, float], ...]

POINTS = 512  # of the polyline
_CHECKED = 256  # points at which a curve is checked to be simple
_LARGEST = 1e6  # [m]
_MOST_TURNS = 12  # order of rotational symmetry that is tried
_SAME = 1e-9  # of the size of the curve: two of its Fourier coefficients are the same


@dataclass(frozen=True)
class Curve(Wall):
    """A wall. ``coefficients`` are (a_x, b_x, a_y, b_y) [m] of k = 0, ..., K.

    Raises ValueError unless the curve is finite, of order 1 at least, regular, simple and counter-clockwise.
    """

    coefficients: Coefficients
    name: str = "curve"

    def __post_init__(self) -> None:
        table = np.array(self.coefficients, dtype=np.float64)
        if table.ndim != 2 or table.shape[0] < 2 or table.shape[1] != 4:
            raise ArgumentError(f"{self.name}: coefficients of shape {table.shape}; allowed: (K + 1, 4) with K >= 1")
        if not (np.isfinite(table).all() and np.abs(table).max() <= _LARGEST):
            raise ArgumentError(
                f"{self.name}: coefficients = {table.tolist()}; allowed: finite ones up to {_LARGEST:g}"
            )
        object.__setattr__(self, "coefficients", tuple(map(tuple, table.tolist())))  # lists cannot be hashed
        s = np.linspace(0.0, 2.0 * math.pi, 4 * POINTS)
        speed, change = (np.linalg.norm(values, axis=1) for values in (self.tangent(s), self.second_derivative(s)))
        if speed.min() <= change.max() * s[1]:  # it may vanish in between
            raise ArgumentError(f"{self.name}: the curve stands still or has a cusp; allowed: a regular curve")
        if crossing := _crossing(self.points(np.linspace(0.0, 2.0 * math.pi, _CHECKED, endpoint=False))):
            raise ArgumentError(f"{self.name}: the curve crosses itself near {crossing}; allowed: a simple curve")
        if self.area <= 0.0:
            raise ArgumentError(
                f"{self.name}: the curve runs clockwise; allowed: counter-clockwise, so negate every b_k"
            )

    # ---- the curve

    def points(self, s: Array) -> Array:
        """Points theta(s) (..., 2) [m] at parameters (...,)."""
        return self._series(s, 0)

    def tangent(self, s: Array) -> Array:
        """Derivative theta'(s) (..., 2) [m] at parameters (...,)."""
        return self._series(s, 1)

    def second_derivative(self, s: Array) -> Array:
        """Second derivative theta''(s) (..., 2) [m] at parameters (...,)."""
        return self._series(s, 2)

    def symbolic(self, s: casadi.SX) -> casadi.SX:
        """Point theta(s) (2,) as a CasADi expression."""
        x, y = casadi.SX(self.coefficients[0][0]), casadi.SX(self.coefficients[0][2])
        for k, (ax, bx, ay, by) in enumerate(self.coefficients[1:], start=1):
            c, sn = casadi.cos(k * s), casadi.sin(k * s)
            x, y = x + ax * c + bx * sn, y + ay * c + by * sn
        return casadi.vertcat(x, y)

    @cached_property
    def table(self) -> Array:
        """Coefficients (K + 1, 4) as the kernels take them."""
        return fixed(np.array(self.coefficients, dtype=np.float64))

    @cached_property
    def polyline(self) -> Array:
        """Points (n + 1, 2) [m] at s = 2 pi k / n."""
        return fixed(self.points(np.linspace(0.0, 2.0 * math.pi, POINTS + 1)))

    @cached_property
    def outlines(self) -> tuple[Array, ...]:
        """The polyline, as the only closed polygon."""
        return (self.polyline,)

    @cached_property
    def longest(self) -> float:
        """Longest distance [m] between two points of the polyline, of which every eighth is looked at."""
        corners = self.polyline[:-1:8]
        return float(np.linalg.norm(corners[:, None] - corners, axis=2).max())

    @property
    def is_ellipse(self) -> bool:
        """True for a curve of order K = 1."""
        return len(self.coefficients) == 2

    @cached_property
    def area(self) -> float:
        """Area [m^2] within the chords; negative where the curve runs clockwise."""
        x, y = self.polyline[:-1].T
        return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))

    # ---- symmetry

    @cached_property
    def symmetry(self) -> int:
        """Number of rotations about the centre that map the wall onto itself: 1 for the identity alone, 0 for a circle.

        A pose and its images under them are indistinguishable: from each the same input gives the same ranges. Counted
        are rotations w for which theta(s + sigma) = w theta(s), so a curve whose parameter runs at another pace on each
        of its equal parts has none.
        """
        c = self._complex()
        size = max(abs(value) for value in c.values())
        moved = {k: value for k, value in c.items() if k != 0 and abs(value) > _SAME * size}
        orders = list(moved)
        if len(orders) == 1:
            return 0
        # With w = e^{i 2 pi / m}, w theta(s) = theta(s + sigma) if w = e^{i k sigma} for every k that is there.
        spread = math.gcd(*(k - orders[0] for k in orders[1:]))
        return max(m for m in range(1, _MOST_TURNS + 1) if self._turns(m, orders[0], spread))

    def _turns(self, m: int, order: int, spread: int) -> bool:
        """True if k sigma = 2 pi / m modulo 2 pi for k = order + multiples of spread has a solution sigma."""
        # spread sigma = 2 pi j and order sigma = 2 pi / m modulo 2 pi: order j / spread = 1 / m modulo 1.
        return any((order * j * m - spread) % (spread * m) == 0 for j in range(spread))

    def _complex(self) -> dict[int, complex]:
        """theta_x + i theta_y = sum_k c_k e^{iks}."""
        c: dict[int, complex] = {}
        for k, (ax, bx, ay, by) in enumerate(self.coefficients):
            if k == 0:
                c[0] = complex(ax, ay)
                continue
            c[k] = 0.5 * complex(ax + by, ay - bx)
            c[-k] = 0.5 * complex(ax - by, ay + bx)
        return c

    @property
    def centre(self) -> Array:
        """Centre a_0 (2,) [m], which the rotations of ``symmetry`` keep."""
        return np.array([self.coefficients[0][0], self.coefficients[0][2]])

    def _series(self, s: Array, derivative: int) -> Array:
        s = np.asarray(s, dtype=np.float64)
        total = np.zeros((*s.shape, 2))
        for k, (ax, bx, ay, by) in enumerate(self.coefficients):
            if k == 0 and derivative:
                continue
            shift = 0.5 * math.pi * derivative  # cos and sin differentiate to themselves, a quarter on
            c, sn = k**derivative * np.cos(k * s + shift), k**derivative * np.sin(k * s + shift)
            total += np.stack([ax * c + bx * sn, ay * c + by * sn], axis=-1)
        return total


def _crossing(points: Array) -> str:
    """Place where a closed polygon crosses itself, or ""."""
    n = len(points)
    a, d = points, np.roll(points, -1, axis=0) - points
    side, other = np.triu_indices(n, 2)
    apart = (side > 0) | (other < n - 1)  # the last side and the first have a corner in common
    side, other = side[apart], other[apart]
    r, (dx, dy), (ex, ey) = (a[other] - a[side]).T, d[side].T, d[other].T
    cross = dx * ey - dy * ex
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (r[0] * ey - r[1] * ex) / cross
        w = (r[0] * dy - r[1] * dx) / cross
    hit = (t >= 0.0) & (t <= 1.0) & (w >= 0.0) & (w <= 1.0)
    if not hit.any():
        return ""
    first = int(np.argmax(hit))
    x, y = a[side[first]] + t[first] * d[side[first]]
    return f"({x:.3g}, {y:.3g})"


def smooth(wall: Wall, user: str, reason: str) -> Curve:
    """Return a wall that is a smooth curve; MissionError says that ``user`` needs one, and for what ``reason``."""
    if isinstance(wall, Curve):
        return wall
    raise MissionError(f"{wall.name} is a polygon, and {user} needs a smooth wall: {reason}; allowed: a closed curve")


# ---- curves by name


def ellipse(c_1: float, c_2: float) -> Curve:
    """Ellipse (c_1 cos s, c_2 sin s) with half-axes [m], Example C.1.

    Raises FieldError for a half-axis out of range.
    """
    for value, name in ((c_1, "c_1"), (c_2, "c_2")):
        if not (math.isfinite(value) and 0.0 < value <= _LARGEST):
            raise FieldError(f"half-axis {name} = {value!r}; allowed: a finite value > 0 and <= {_LARGEST:g}")
    return Curve(((0.0, 0.0, 0.0, 0.0), (c_1, 0.0, 0.0, c_2)), f"ellipse of {c_1:.4g} by {c_2:.4g} m")


EGG = Curve(((0.0, 0.0, 0.0, 0.0), (2.7, 0.0, 0.0, 1.7), (0.35, 0.0, 0.0, 0.22)), "egg")
"""convex curve, its own mirror image, without another symmetry"""

BEAN = Curve(((0.0, 0.0, 0.0, 0.0), (2.8, 0.0, 0.0, 1.6), (0.0, 0.0, -0.75, 0.0), (0.12, 0.0, 0.0, 0.05)), "bean")
"""curve that is not convex, nearly its own mirror image"""
