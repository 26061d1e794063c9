"""Occupancy grids: cells that are free, occupied or unknown."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array

FREE, OCCUPIED, UNKNOWN = 0, 1, 2
"""states of a cell"""

Cells = NDArray[np.uint8]

FINEST, COARSEST = 1e-3, 10.0
"""bounds [m] of the side of a cell"""


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """States of cells (rows, columns), row 0 the lowest y, in their own axes, whose ``origin`` is in the map's.

    Raises ArgumentError for a side, an origin or states that are not allowed.
    """

    cells: Cells
    resolution: float  # [m] side of a cell
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m, m, rad] corner of cell (0, 0), and where x points
    name: str = "map"

    def __post_init__(self) -> None:
        if self.cells.ndim != 2 or not self.cells.size:
            raise ArgumentError(f"{self.name}: cells of shape {self.cells.shape}; allowed: (rows, columns)")
        if not FINEST <= self.resolution <= COARSEST:
            raise ArgumentError(f"{self.name}: resolution = {self.resolution!r}; allowed: {FINEST:g} to {COARSEST:g} m")
        if not all(map(math.isfinite, self.origin)):
            raise ArgumentError(f"{self.name}: origin = {self.origin!r}; allowed: finite x, y [m] and yaw [rad]")

    def area(self, state: int) -> float:
        """Area [m^2] of the cells of a state."""
        return float((self.cells == state).sum()) * self.resolution**2

    def points(self, corners: Array) -> Array:
        """Points (n, 2) [m] of the map of ``corners`` (n, 2), counted in columns and rows."""
        x, y, yaw = self.origin
        c, s = math.cos(yaw), math.sin(yaw)
        placed: Array = self.resolution * (corners @ np.array([[c, s], [-s, c]])) + np.array([x, y])
        return placed
