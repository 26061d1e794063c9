"""The ground: a height field made of triangles, the same ones that MuJoCo collides with.

Map frame: x [m] east and y [m] north of the south-west corner, z [m] above sea level. Node (i, j) stands at
(i, j) * spacing with the height z[j, i]; every cell is cut along its diagonal (i, j)-(i + 1, j + 1). A plan is accepted
only on these triangles: a smooth interpolation of the same nodes is up to tens of metres off them.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mathnavi.interfaces.boundary import locked
from mathnavi.interfaces.checks import plain_name
from mathnavi.interfaces.errors import ArgumentError, FieldError, TerrainError
from mathnavi.interfaces.short_tables import Row, html_table, short_table
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain import kernels
from mathnavi.models.terrain.kernels import Booleans, arc_clearance

_LONGEST_TEXT = 1000  # [characters] of a source or a licence
HIGHEST = 1e6  # [m] above or below sea level: a greater value is not a height
WALL = 3e4  # [m] height of the ground where none is known


@dataclass(frozen=True, eq=False, repr=False)
class HeightField:
    """A rectangular map of heights on a square grid, linear on each triangle.

    From your own array of heights (rows, cols) [m], whose row 0 is the south edge and column 0 the west edge:

        heights = np.loadtxt("heights.csv", delimiter=",")[::-1]  # a table whose first line is the north edge
        terrain = HeightField(heights, spacing=30.0, name="mine")

    Raises TerrainError for heights or a spacing that make no map.
    """

    z: Array  # (rows, cols) [m] above sea level; row 0 south, column 0 west; read-only
    spacing: float  # [m] between neighbouring nodes, both ways
    name: str = "unnamed"
    source: str = ""
    licence: str = ""
    above: NDArray[np.floating[Any]] | None = None
    """(rows - 1, cols - 1, 2) [m] by which the ground that was surveyed may rise above the triangles of each cell, that
    south-east of the diagonal first; inf where a void was filled by a guess; None if z is the ground; read-only"""
    datum: str = ""  # what the heights are measured from, as the file says it; empty if it does not

    def __post_init__(self) -> None:
        self._check_texts()
        try:
            z = np.array(self.z, dtype=np.float64, order="C")
        except (TypeError, ValueError) as error:
            raise TerrainError(f"terrain {self.name!r}: z is not a rectangle of numbers ({error})") from None
        if z.ndim != 2 or min(z.shape) < 2:
            raise TerrainError(f"terrain {self.name!r}: z has shape {z.shape}; allowed: (rows, cols), each at least 2")
        if not np.isfinite(z).all():
            row, column = np.argwhere(~np.isfinite(z))[0]
            raise TerrainError(
                f"terrain {self.name!r}: {np.count_nonzero(~np.isfinite(z))} heights are not finite, "
                f"the first is {z[row, column]} at row {row}, column {column}"
            )
        if max(highest := float(z.max()), -(lowest := float(z.min()))) > HIGHEST:
            raise TerrainError(
                f"terrain {self.name!r}: heights from {lowest:g} to {highest:g} m; allowed: {-HIGHEST:g} to {HIGHEST:g}"
            )
        spacing = float(self.spacing)
        if not (math.isfinite(spacing) and spacing > 0.0):
            raise TerrainError(f"terrain {self.name!r}: spacing is {spacing} m; allowed: a finite number above 0")
        object.__setattr__(self, "z", locked(z))
        object.__setattr__(self, "spacing", spacing)
        if self.above is not None:
            object.__setattr__(self, "above", self._checked_above(self.above))

    def _checked_above(self, above: ArrayLike) -> NDArray[np.float32] | None:
        """``above`` as an array; None if it is zero everywhere."""
        rises = np.array(above, dtype=np.float32, order="C")
        shape = (self.z.shape[0] - 1, self.z.shape[1] - 1, 2)
        if rises.shape != shape or not (rises >= 0.0).all():
            what = f"has shape {rises.shape}" if rises.shape != shape else "has a value that is no number of at least 0"
            raise TerrainError(f"terrain {self.name!r}: above {what}; allowed: {shape}, each 0 or more, or inf")
        return locked(rises) if rises.any() else None

    def _check_texts(self) -> None:
        """Raise TerrainError for a name that cannot be part of a path, and a source or licence of more than a line."""
        try:
            plain_name(self.name, "name")
        except FieldError as error:
            raise TerrainError(f"terrain: {error}") from None
        for label in ("source", "licence", "datum"):
            text = getattr(self, label)
            if not (isinstance(text, str) and len(text) <= _LONGEST_TEXT and (text.isprintable() or not text)):
                raise TerrainError(
                    f"terrain {self.name!r}: {label} = {text!r:.120}; allowed: one line of at most {_LONGEST_TEXT} "
                    "printable characters"
                )

    def __reduce__(self) -> tuple[type[HeightField], tuple[object, ...]]:
        # Pickle forgets that an array is read-only; the constructor restores it in the worker.
        return HeightField, tuple(getattr(self, each.name) for each in fields(self))

    def _table(self) -> tuple[str, list[Row]]:
        """Title and rows of the table that represents the terrain."""
        rows, columns = self.z.shape
        return f"terrain {self.name!r}", [
            ("shape", f"{rows} x {columns}", "nodes"),
            ("spacing", f"{self.spacing:g}", "m"),
            ("heights", f"{self.z.min():.1f} to {self.z.max():.1f}", "m"),
        ]

    def __repr__(self) -> str:
        return short_table(*self._table())

    def _repr_html_(self) -> str:
        return html_table(*self._table())

    @property
    def width(self) -> float:
        """Extent [m] from west to east."""
        return float((self.z.shape[1] - 1) * self.spacing)

    @property
    def depth(self) -> float:
        """Extent [m] from south to north."""
        return float((self.z.shape[0] - 1) * self.spacing)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of shape, spacing and heights, in hexadecimal: equal if and only if the ground is."""
        shape_and_spacing = np.array([*self.z.shape, self.spacing], dtype="<f8").tobytes()
        above = b"" if self.above is None else self.above.astype("<f4").tobytes()
        return hashlib.sha256(shape_and_spacing + self.z.astype("<f8").tobytes() + above).hexdigest()

    @cached_property
    def highest(self) -> HeightField:
        """Ground that what was surveyed is nowhere above: each node raised by the most that ``above`` has around it.

        Where a void was filled it is ``WALL`` [m] high: no height is known there. What relies on the ground, a plan and
        its certificate, relies on this one; it is the terrain itself if z is the ground.
        """
        if self.above is None:
            return self
        rise = np.zeros_like(self.z)
        lower, upper = np.moveaxis(self.above.astype(np.float64), -1, 0)  # triangles south-east and north-west
        for half, corners in ((lower, ((0, 0), (0, 1), (1, 1))), (upper, ((0, 0), (1, 0), (1, 1)))):
            for north, east in corners:
                nodes = rise[north : north + half.shape[0], east : east + half.shape[1]]
                np.maximum(nodes, half, out=nodes)
        return replace(self, z=np.where(np.isinf(rise), WALL, self.z + np.where(np.isinf(rise), 0.0, rise)), above=None)

    def walled(self, x: ArrayLike, y: ArrayLike) -> Booleans:
        """True (...,) where x, y (...,) [m] lie in a cell with a wall: no height is known there (``highest``)."""
        east, north = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        i = np.clip((east / self.spacing).astype(int), 0, self.z.shape[1] - 2)
        j = np.clip((north / self.spacing).astype(int), 0, self.z.shape[0] - 2)
        corners = self.z[j, i], self.z[j, i + 1], self.z[j + 1, i], self.z[j + 1, i + 1]
        found: Booleans = np.maximum.reduce(corners) >= WALL
        return found

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Height of the ground (...,) [m] at x, y (...,) [m], map frame, any shapes that broadcast; NaN off the map."""
        return self._surface(x, y)[..., 0]

    def gradient(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Slopes dH/dx and dH/dy (..., 2) of the triangle at x, y (...,) [m]; NaN off the map.

        On a diagonal it is the triangle south-east of it, on another edge the one to the east or north.
        """
        return self._surface(x, y)[..., 1:]

    def normal(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Unit normal (..., 3) of the triangle at x, y (...,) [m], upwards; NaN off the map."""
        gradient = self.gradient(x, y)
        upward = np.concatenate([-gradient, np.ones((*gradient.shape[:-1], 1))], axis=-1)
        normal: Array = upward / np.linalg.norm(upward, axis=-1, keepdims=True)
        return normal

    def contains(self, x: ArrayLike, y: ArrayLike) -> Booleans:
        """True (...,) where x, y (...,) [m] lie on the map, its border included."""
        east, north = np.asarray(x, np.float64), np.asarray(y, np.float64)
        inside: Booleans = (east >= 0.0) & (east <= self.width) & (north >= 0.0) & (north <= self.depth)
        return inside

    def arc_clearance(self, p: ArrayLike, v: ArrayLike, a: ArrayLike, duration: float) -> float:
        """Least height above ground [m] of the arc p + v t + a t^2 / 2, 0 <= t <= duration [s]; exact.

        p (3,) [m], v (3,) [m/s], a (3,) [m/s^2], map frame. -inf if the arc leaves the map anywhere, or if an argument
        is not finite. Raises ValueError for another shape.
        """
        p, v, a = _vector("p", p), _vector("v", v), _vector("a", a)
        return arc_clearance(self.z, self.spacing, p, v, a, float(duration))

    def path_clearance(self, p: ArrayLike, v: ArrayLike, a: ArrayLike, duration: ArrayLike) -> Array:
        """``arc_clearance`` (K,) [m] of K arcs: p (K, 3) [m], v (K, 3) [m/s], a (K, 3) [m/s^2], duration (K,) [s]."""
        p, v, a = _rows("p", p), _rows("v", v), _rows("a", a)
        times = np.array(duration, dtype=np.float64, order="C")
        if not times.shape == p.shape[:1] == v.shape[:1] == a.shape[:1]:
            raise ArgumentError(
                f"p {p.shape}, v {v.shape}, a {a.shape} and duration {times.shape} disagree on the number of arcs"
            )
        result: Array = kernels.path_clearance(self.z, self.spacing, p, v, a, times)
        return result

    def line_of_sight(self, p: ArrayLike, q: ArrayLike) -> bool:
        """True if the straight segment between p and q (3,) [m] is clear of the ground; symmetric in p and q.

        A segment that touches the ground within a micrometre is clear, so that a point resting on the ground can see
        and be seen. A segment that leaves the map is not clear: what stands there is not known.
        """
        return kernels.sight(self.z, self.spacing, _vector("p", p), _vector("q", q))

    def visible(self, p: ArrayLike, points: ArrayLike) -> Booleans:
        """``line_of_sight`` (n,) between p (3,) [m] and each of the points (n, 3) [m]."""
        return kernels.sights(self.z, self.spacing, _vector("p", p), _rows("points", points))

    def inflated(self, horizontal: float, vertical: float) -> HeightField:
        """Ground at least ``vertical`` [m] above the ``highest`` ground within ``horizontal`` [m] of each point.

        Every node is raised by vertical + horizontal * G, G the steepest triangle in the (2n + 2) x (2n + 2) cells
        around the node, n = ceil(horizontal / spacing), at least 1. The corners of a triangle then agree on the (2n +
        1) x (2n + 1) cells around its cell, which contain every point within n spacings. Raises ArgumentError for a
        negative margin.
        """
        if not (math.isfinite(horizontal) and horizontal >= 0.0):
            raise ArgumentError(f"horizontal is {horizontal} m; allowed: a finite number of at least 0")
        if not (math.isfinite(vertical) and vertical >= 0.0):
            raise ArgumentError(f"vertical is {vertical} m; allowed: a finite number of at least 0")
        ground = self.highest.z
        east, north = np.diff(ground, axis=1), np.diff(ground, axis=0)
        below_diagonal = np.hypot(east[:-1], north[:, 1:])
        above_diagonal = np.hypot(east[1:], north[:, :-1])
        n = max(1, math.ceil(min(horizontal, max(self.width, self.depth)) / self.spacing))
        around_node = np.maximum(below_diagonal, above_diagonal) / self.spacing
        for axis in range(2):
            beyond = [(0, 0), (0, 0)]
            beyond[axis] = (n + 1, n + 1)  # no cells beyond the border
            padded = np.pad(around_node, beyond)
            around_node = np.lib.stride_tricks.sliding_window_view(padded, 2 * n + 2, axis=axis).max(axis=-1)
        raised = np.minimum(ground + vertical + horizontal * around_node, HIGHEST)  # walls are steep
        return replace(self, z=raised, above=None)

    def _surface(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Height and gradient (..., 3)."""
        east, north = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        points: Array = kernels.surface(self.z, self.spacing, east.flatten(), north.flatten())
        return points.reshape(*east.shape, 3)


def _vector(name: str, value: ArrayLike) -> Array:
    vector = np.array(value, dtype=np.float64, order="C")
    if vector.shape != (3,):
        raise ArgumentError(f"{name} has shape {vector.shape}; allowed: (3,)")
    return vector


def _rows(name: str, value: ArrayLike) -> Array:
    rows = np.array(value, dtype=np.float64, order="C")
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise ArgumentError(f"{name} has shape {rows.shape}; allowed: (n, 3)")
    return rows
