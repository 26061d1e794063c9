"""Walls of an occupancy grid, traced along its cells and simplified.

The walls are the border of the largest area of free cells that are joined by their sides; what is not free ends a ray.
A cell by whose corner alone two free cells touch makes the border touch itself, so one of these two counts as occupied.
Holes smaller than a limit are left out. Each ring is simplified (Douglas and Peucker, 1973): no point of the border is
farther from the simplified one than ``deviation``, and where simplified sides would cross they keep more corners. With
deviation 0 the walls are the sides of the cells themselves, and rays end exactly there.

So a range differs from that to the cells by at most deviation / sin gamma, gamma the angle between ray and wall, unless
the ray passes an end of a wall nearer than the deviation; the cells differ from the building by what their side allows.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mathnavi.interfaces.errors import ArgumentError, FieldError
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.occupancy_grid import FREE, UNKNOWN, OccupancyGrid
from mathnavi.models.field.polygon import Polygon, crossed_sides

_Flags = NDArray[np.bool_]
_Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Traced:
    """Walls traced from a grid, and what that took."""

    walls: Polygon
    deviation: float  # [m] largest distance of the border of the cells from the walls
    left_out: float  # [m^2] free, but not joined to the rest
    holes_left_out: int  # smaller than the limit
    closed: int  # free cells that count as occupied, so that the border does not touch itself


def traced(
    grid: OccupancyGrid, deviation: float | None = None, smallest_hole: float = 0.01, *, unknown_is_free: bool = False
) -> Traced:
    """Trace the walls of a grid to a ``deviation`` [m], a cell if not given; ``smallest_hole`` is in m^2.

    Raises FieldError for a deviation or a limit that is negative, and for a grid without an area to be in.
    """
    deviation = grid.resolution if deviation is None else deviation
    for value, name in ((deviation, "deviation"), (smallest_hole, "smallest_hole")):
        if not (np.isfinite(value) and value >= 0.0):
            raise FieldError(f"{name} = {value!r}; allowed: a finite value >= 0")
    free = grid.cells == FREE
    if unknown_is_free:
        free |= grid.cells == UNKNOWN
    free, left_out = _largest(np.pad(free, 1))
    if not free.any():
        raise FieldError(f"{grid.name}: no free cells; allowed: a map with an area that is free")
    closed = 0
    while (touching := _touching(free)).any():
        free &= ~touching
        closed += int(touching.sum())
        free, more = _largest(free)
        left_out += more
    rings = _borders(free)
    areas = [abs(_area(ring)) * grid.resolution**2 for ring in rings]
    outer = int(np.argmax(areas))
    kept = [ring for k, ring in enumerate(rings) if k != outer and areas[k] >= smallest_hole]
    chains = [np.asarray(ring - 1, np.float64) for ring in (rings[outer], *kept)]  # less what was padded
    simplified, largest = _simplified(chains, deviation / grid.resolution)
    corners = tuple(tuple((float(x), float(y)) for x, y in grid.points(ring)) for ring in simplified)
    try:
        walls = Polygon(corners, grid.name)
    except ArgumentError as error:
        raise FieldError(f"{grid.name}: {error}") from None
    small = len(rings) - 1 - len(kept)
    return Traced(walls, largest * grid.resolution, left_out * grid.resolution**2, small, closed)


def _largest(free: _Flags) -> tuple[_Flags, int]:
    """The largest area of cells that are joined by their sides, and how many cells are not in it."""
    labels, count = ndimage.label(free)
    if count < 2:
        return free, 0
    sizes = np.bincount(labels.ravel())[1:]
    return labels == 1 + int(np.argmax(sizes)), int(sizes.sum() - sizes.max())


def _touching(free: _Flags) -> _Flags:
    """The upper ones of two free cells that touch by a corner alone."""
    a, b, c, d = free[:-1, :-1], free[:-1, 1:], free[1:, :-1], free[1:, 1:]
    found = np.zeros_like(free)
    found[1:, 1:] |= a & d & ~b & ~c
    found[1:, :-1] |= b & c & ~a & ~d
    return found


def _borders(free: _Flags) -> list[_Indices]:
    """Rings of corners (n, 2), in columns and rows: the ends of straight sides, the free cells on the left."""
    rows, columns = free.shape
    row, column = np.nonzero(free)
    starts, ends = [], []
    for (d_row, d_column), first, last in (
        ((-1, 0), (0, 0), (1, 0)), ((0, 1), (1, 0), (1, 1)), ((1, 0), (1, 1), (0, 1)), ((0, -1), (0, 1), (0, 0)),
    ):  # fmt: skip
        side = ~free[row + d_row, column + d_column]
        x, y = column[side], row[side]
        starts.append((y + first[1]) * (columns + 1) + x + first[0])
        ends.append((y + last[1]) * (columns + 1) + x + last[0])
    after = np.full((rows + 1) * (columns + 1), -1, dtype=np.intp)
    after[np.concatenate(starts)] = np.concatenate(ends)
    rings = []
    for begin in np.sort(np.concatenate(starts)):
        ring, k = [], int(begin)
        while after[k] >= 0:
            ring.append(k)
            after[k], k = -1, int(after[k])
        if ring:
            nodes = np.array(ring)
            corners = np.column_stack([nodes % (columns + 1), nodes // (columns + 1)])
            bends = (np.roll(corners, 1, axis=0) - corners + np.roll(corners, -1, axis=0) - corners).any(axis=1)
            rings.append(corners[bends])
    return rings


def _area(ring: _Indices) -> float:
    x, y = ring.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


# ---- the simplification


class _Chain:
    """A closed chain of corners (n, 2), of which some are kept; the others are replaced by sides between these."""

    def __init__(self, corners: Array) -> None:
        self.corners = corners
        self._known: dict[tuple[int, int], tuple[float, int]] = {}
        farthest = int(np.argmax(np.linalg.norm(corners - corners[0], axis=1)))
        self.kept = [0, farthest]
        distances = [self.farthest(side) for side in range(2)]
        self.keep([max(distances)[1]])  # a ring has three corners

    @property
    def ring(self) -> Array:
        """Corners (n, 2) that are kept."""
        ring: Array = self.corners[self.kept]
        return ring

    def keep(self, more: Iterable[int]) -> bool:
        """Keep ``more`` corners; True if there was one that had not been kept."""
        before = len(self.kept)
        self.kept = sorted({*self.kept, *more})
        return len(self.kept) > before

    def farthest(self, side: int) -> tuple[float, int]:
        """Distance of the corner that is farthest from the side that replaces it, and its index; 0 and a corner that
        is kept where the side replaces none.
        """
        first, last = self.kept[side], self.kept[(side + 1) % len(self.kept)]
        if (first, last) not in self._known:
            between = np.arange(first + 1, last if last > first else last + len(self.corners)) % len(self.corners)
            self._known[first, last] = (0.0, first) if not len(between) else self._far(first, last, between)
        return self._known[first, last]

    def _far(self, first: int, last: int, between: _Indices) -> tuple[float, int]:
        a, d, p = self.corners[first], self.corners[last] - self.corners[first], self.corners[between]
        along = np.clip((p - a) @ d / (d @ d), 0.0, 1.0)
        distance = np.linalg.norm(a + along[:, None] * d - p, axis=1)
        k = int(np.argmax(distance))
        return float(distance[k]), int(between[k])


def _simplified(borders: list[Array], tolerance: float) -> tuple[list[Array], float]:
    """Rings (n, 2) with fewer corners, and the largest distance of one that is left out; both in cells."""
    chains = [_Chain(border) for border in borders]
    while True:
        changed = False
        for chain in chains:
            far = [chain.farthest(side) for side in range(len(chain.kept))]
            changed |= chain.keep(k for distance, k in far if distance > tolerance)
        if changed:
            continue
        for chain, sides in zip(chains, crossed_sides([chain.ring for chain in chains]), strict=True):
            changed |= chain.keep([chain.farthest(int(side))[1] for side in sides])
        if not changed:
            break
    left_out = [chain.farthest(side)[0] for chain in chains for side in range(len(chain.kept))]
    return [chain.ring for chain in chains], max(left_out)
