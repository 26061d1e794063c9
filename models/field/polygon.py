"""Walls of buildings: a polygon with holes, which are tables, pillars or the blocks between corridors."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import ConvexHull, cKDTree

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.field.polygon_kernels import crossings, is_within_segments, segment_table
from mathnavi.models.field.wall import Ring, Wall, fixed

MOST_CORNERS = 200_000
_LARGEST = 1e4  # [m]
_A_CELL = 1.0  # cells of the grid to a segment, about
_FEWEST, _MOST = 8, 1024  # cells of the grid along the longer side
_BORDER = 1e-3  # of the longer side: the grid beyond the wall
_MOST_TURNS = 12  # order of rotational symmetry that is tried
_ALONG, _BESIDE = 0.5 / math.sqrt(1.03), 0.25 / math.sqrt(1.07)  # of a side: where a point within a ring is looked for
_SAME = 1e-9  # of the size: two corners are the same


@dataclass(frozen=True)
class Polygon(Wall):
    """A wall of straight segments. ``rings`` are the corners [m] of the outer ring and of the holes in it.

    Rings may run either way, and may repeat their first corner at the end. Raises ArgumentError, which names the ring
    (0 is the outer one) and the place, unless rings have three corners or more, all finite and each different from the
    next, no two segments cross or touch, and each hole is within the outer ring and in no other hole.
    """

    rings: tuple[Ring, ...]
    name: str = "polygon"

    def __post_init__(self) -> None:
        if not self.rings:
            raise ArgumentError(f"{self.name}: no rings; allowed: the outer one, and holes")
        for number, ring in enumerate(self.rings):
            self._check_ring(number, np.array(ring, dtype=np.float64))
        rings = tuple(tuple((float(x), float(y)) for x, y in ring) for ring in self.rings)
        object.__setattr__(self, "rings", rings)  # lists and arrays cannot be hashed
        if (count := sum(map(len, self._corners))) > MOST_CORNERS:
            raise ArgumentError(f"{self.name}: {count} corners; allowed: up to {MOST_CORNERS}")
        self._check_crossings()
        self._check_holes()

    # ---- the checks

    def _check_ring(self, number: int, corners: Array) -> None:
        where = f"{self.name}: ring {number}"
        if corners.ndim != 2 or corners.shape[1] != 2:
            raise ArgumentError(f"{where}: corners of shape {corners.shape}; allowed: (n, 2)")
        wrong = ~(np.abs(corners) <= _LARGEST).all(axis=1)
        if wrong.any():
            k = int(np.argmax(wrong))
            raise ArgumentError(
                f"{where}: corner {k} = {_place(corners[k])}; allowed: finite ones up to {_LARGEST:g} m"
            )
        corners = _open(corners)
        if len(corners) < 3:
            raise ArgumentError(f"{where}: {len(corners)} corners; allowed: 3 or more")
        same = (corners == np.roll(corners, -1, axis=0)).all(axis=1)
        if same.any():
            k = int(np.argmax(same))
            raise ArgumentError(f"{where}: corner {k} = {_place(corners[k])} twice in a row; allowed: different ones")

    def _check_crossings(self) -> None:
        met = crossings(self.table, self._follows)
        k = int(np.argmax(met >= 0))
        if (other := int(met[k])) < 0:
            return
        rings = sorted({self._ring_of(k), self._ring_of(other)})
        a, b = self.segments[k], self.segments[other]
        near = _place(_meeting(a, b))
        if len(rings) == 1:
            raise ArgumentError(
                f"{self.name}: ring {rings[0]} crosses or touches itself near {near}; allowed: a simple ring"
            )
        raise ArgumentError(
            f"{self.name}: rings {rings[0]} and {rings[1]} cross or touch near {near}; allowed: rings apart"
        )

    def _check_holes(self) -> None:
        # No segments cross, so a ring is within another one if its first corner is. The parity of all other rings
        # around it: inside the outer ring and no hole.
        if len(self.rings) == 1:
            return
        outer = _table(_segments(self._corners[:1]))
        holes = _table(_segments(self._corners[1:]))
        for number, corners in enumerate(self._corners[1:], start=1):
            x, y = self.rings[number][0]
            where = f"{self.name}: ring {number} at {_place(self.rings[number][0])}"
            if not is_within_segments(outer, float(x), float(y)):
                raise ArgumentError(f"{where} is outside ring 0; allowed: holes within it")
            inner = _inner_point(corners)
            if not is_within_segments(holes, *inner):
                raise ArgumentError(
                    f"{where} is within another hole, or holds one; allowed: holes apart from each other"
                )

    # ---- the segments

    @cached_property
    def _corners(self) -> tuple[Array, ...]:
        """Corners (n, 2) [m] of each ring, the outer one counter-clockwise, holes clockwise."""
        found = []
        for number, ring in enumerate(self.rings):
            corners = _open(np.array(ring, dtype=np.float64))
            found.append(corners if (_area(corners) > 0.0) == (number == 0) else corners[::-1])
        return tuple(found)

    @cached_property
    def _spans(self) -> tuple[tuple[int, int], ...]:
        """First segment and number of segments of each ring."""
        sizes = [len(corners) for corners in self._corners]
        return tuple(zip(np.cumsum([0, *sizes[:-1]]).tolist(), sizes, strict=True))

    @cached_property
    def _follows(self) -> Integers:
        """Segment (n,) that follows each."""
        return np.concatenate([first + np.roll(np.arange(n), -1) for first, n in self._spans])

    def _ring_of(self, k: int) -> int:
        return max(number for number, (first, _) in enumerate(self._spans) if first <= k)

    @cached_property
    def segments(self) -> Array:
        """Segments (n, 4) [m]: the corners x_a, y_a, x_b, y_b of each, the inside on its left."""
        return fixed(_segments(self._corners))

    @cached_property
    def table(self) -> Array:
        """Table of segments (m, 8), with the grid through which they are found."""
        return fixed(_table(self.segments))

    @cached_property
    def polyline(self) -> Array:
        """Corners (n + 1, 2) [m], ring after ring, the first of which is repeated at the end."""
        return fixed(np.vstack([*self._corners, self._corners[0][:1]]))

    @cached_property
    def outlines(self) -> tuple[Array, ...]:
        """Closed polygons (n + 1, 2) [m] of the wall, the outer one first, each ending where it begins."""
        return tuple(fixed(np.vstack([corners, corners[:1]])) for corners in self._corners)

    @cached_property
    def area(self) -> float:
        """Area [m^2] within the outer ring less that of the holes."""
        return sum(_area(corners) for corners in self._corners)

    @cached_property
    def longest(self) -> float:
        """Longest distance [m] between two points of the wall."""
        corners = self._corners[0]
        hull = corners[ConvexHull(corners).vertices]
        return float(max(np.linalg.norm(hull - corner, axis=1).max() for corner in hull))

    # ---- symmetry

    @cached_property
    def centre(self) -> Array:
        """Centre of area (2,) [m], which the rotations of ``symmetry`` keep."""
        origin, moment = self._corners[0][0], np.zeros(2)
        for corners in self._corners:
            a = corners - origin
            b = np.roll(a, -1, axis=0)
            cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
            moment += ((a + b) * cross[:, None]).sum(axis=0) / 6.0
        return fixed(origin + moment / self.area)

    @cached_property
    def symmetry(self) -> int:
        """Number of rotations about the centre that map the wall onto itself: 1 for the identity alone.

        They map corners to corners; a corner on a straight side counts as one.
        """
        corners = np.vstack(self._corners) - self.centre
        tree, size = cKDTree(corners), float(np.abs(corners).max())
        for m in range(_MOST_TURNS, 1, -1):
            c, s = math.cos(2.0 * math.pi / m), math.sin(2.0 * math.pi / m)
            far, image = tree.query(corners @ np.array([[c, s], [-s, c]]))
            if far.max() <= _SAME * size and self._keeps_order(image):
                return m
        return 1

    def _keeps_order(self, image: Array) -> bool:
        """True if successive corners have successive ``image`` corners (n,)."""
        return bool((image[self._follows] == self._follows[image]).all())


def crossed_sides(rings: Sequence[Array]) -> list[Integers]:
    """Numbers of the sides of each ring (n, 2) [m] that meet another side, but for common corners."""
    spans = np.cumsum([0, *map(len, rings)])
    follows = np.concatenate(
        [first + np.roll(np.arange(len(ring)), -1) for first, ring in zip(spans[:-1], rings, strict=True)]
    )
    met = crossings(_table(_segments(tuple(rings))), follows) >= 0
    return [np.flatnonzero(met[first:last]) for first, last in itertools.pairwise(spans)]


def _open(corners: Array) -> Array:
    """Corners (n, 2) without a repetition of the first one at the end."""
    return corners[:-1] if len(corners) > 1 and (corners[0] == corners[-1]).all() else corners


def _segments(rings: tuple[Array, ...]) -> Array:
    return np.vstack([np.column_stack([corners, np.roll(corners, -1, axis=0)]) for corners in rings])


def _table(segments: Array) -> Array:
    """Table of segments (n, 4), with a grid of about as many cells as there are segments, or more in a small wall."""
    points = segments.reshape(-1, 2)
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    longer = float(size.max())
    border = _BORDER * longer
    cells = math.sqrt(_A_CELL * len(segments) * longer**2 / max(float(np.prod(size)), 0.01 * longer**2))
    cell = longer / min(max(cells, _FEWEST), _MOST)
    columns, rows = (math.ceil((side + 2.0 * border) / cell) for side in size)
    low_x, low_y = (low - border).tolist()
    table: Array = segment_table(np.ascontiguousarray(segments), low_x, low_y, cell, columns, rows)
    return table


def _area(corners: Array) -> float:
    """Area [m^2] of a ring (n, 2), negative where it runs clockwise."""
    x, y = (corners - corners[0]).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _inner_point(corners: Array) -> tuple[float, float]:
    """A point within a ring (n, 2), not on it: next to its longest side.

    Corners of traced walls lie on a grid, so the place is off any such grid.
    """
    a, along = corners, np.roll(corners, -1, axis=0) - corners
    length = np.linalg.norm(along, axis=1)
    k = int(np.argmax(length))
    table, left = _table(_segments((corners,))), np.array([-along[k, 1], along[k, 0]])
    inset = _BESIDE
    while inset > 1e-12:
        for sign in (1.0, -1.0):
            x, y = a[k] + _ALONG * along[k] + sign * inset * left
            if is_within_segments(table, x, y):
                return float(x), float(y)
        inset *= 0.5
    return float(a[k, 0]), float(a[k, 1])


def _meeting(a: Array, b: Array) -> Array:
    """Place (2,) near which two segments (4,) meet."""
    d, e, r = a[2:] - a[:2], b[2:] - b[:2], b[:2] - a[:2]
    cross = d[0] * e[1] - d[1] * e[0]
    if cross == 0.0:
        return b[:2] if abs((b[:2] - a[:2]) @ d) <= d @ d else a[:2]
    meeting: Array = a[:2] + (r[0] * e[1] - r[1] * e[0]) / cross * d
    return meeting


def _place(p: Array | tuple[float, float]) -> str:
    return f"({p[0]:.4g}, {p[1]:.4g})"
