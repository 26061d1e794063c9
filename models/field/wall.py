"""A wall around a field: what a closed smooth curve and a polygon with holes have in common."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.kernels import WallShape, cast_rays, is_inside, wall_distance

Ring = tuple[tuple[float, float], ...]
"""corners (x, y) [m] of a closed polygon, the first of which is not repeated"""


class Wall(ABC):
    """A wall, the points within it, and the rays that end on it."""

    name: str

    @property
    @abstractmethod
    def table(self) -> Array:
        """Table of coefficients (K + 1, 4) or of segments (m, 8), as the kernels take it."""

    @property
    @abstractmethod
    def polyline(self) -> Array:
        """Points (n + 1, 2) [m] of the wall; of a polygon its corners, ring after ring."""

    @property
    @abstractmethod
    def outlines(self) -> tuple[Array, ...]:
        """Closed polygons (n + 1, 2) [m] of the wall, the outer one first, each ending where it begins."""

    @property
    @abstractmethod
    def area(self) -> float:
        """Area [m^2] within."""

    @property
    @abstractmethod
    def centre(self) -> Array:
        """Centre (2,) [m] of the rotations of ``symmetry``."""

    @property
    @abstractmethod
    def symmetry(self) -> int:
        """Number of rotations about the centre that map the wall onto itself: 1 for the identity alone, 0 for a
        circle.
        """

    @property
    @abstractmethod
    def longest(self) -> float:
        """Longest distance [m] between two points of the wall."""

    @property
    def wall(self) -> WallShape:
        """Table and polyline together, as the kernels take them."""
        return self.table, self.polyline

    def contains(self, p: Array, margin: float = 0.0) -> bool:
        """True if a point (2,) [m] is within the wall, and no nearer to it than ``margin`` [m]."""
        if not is_inside(self.table, self.polyline, float(p[0]), float(p[1])):
            return False
        return margin <= 0.0 or self.distance(p) >= margin

    def distance(self, p: Array) -> float:
        """Distance [m] from a point (2,), or from the position of a pose (3,), to the wall, or to a curve's chords."""
        return float(wall_distance(self.table, self.polyline, float(p[0]), float(p[1])))

    def ranges(self, pose: Array, angles: Array) -> tuple[Array, Array]:
        """Ranges rho (l,) [m] and ray ends s (l,) of sensors at ``angles`` (l,) [rad] from a pose (3,), (C.4)."""
        rho, s = cast_rays(self.table, self.polyline, np.asarray(pose, np.float64), np.asarray(angles, np.float64))
        return rho, s

    def draw(self, rng: np.random.Generator, margin: float = 0.0) -> Array:
        """Draw a pose (3,) [m, m, rad], uniform over the points within that keep ``margin`` [m], and over headings.

        Raises ArgumentError if there seems to be no such point.
        """
        low, high = self.polyline.min(axis=0), self.polyline.max(axis=0)
        for _ in range(10_000):
            p = rng.uniform(low, high)
            if self.contains(p, margin):
                return np.array([*p, rng.uniform(-math.pi, math.pi)])
        raise ArgumentError(f"{self.name}: no point keeps {margin!r} m from the wall; allowed: a smaller margin")

    def images(self, pose: Array) -> Array:
        """Poses (m, 3) indistinguishable from a pose (3,) [m, m, rad], which comes first; in a circle only that."""
        turns = 2.0 * math.pi * np.arange(max(self.symmetry, 1)) / max(self.symmetry, 1)
        offset = pose[:2] - self.centre
        c, s = np.cos(turns), np.sin(turns)
        return np.column_stack(
            [
                self.centre[0] + c * offset[0] - s * offset[1],
                self.centre[1] + s * offset[0] + c * offset[1],
                pose[2] + turns,
            ]
        )


def fixed(array: Array) -> Array:
    """Make an array read-only; returns it."""
    array.flags.writeable = False
    return array
