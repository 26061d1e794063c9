"""Hills set on a terrain: ground that is there and not on the map, or ground for a test."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.interfaces.checks import check
from mathnavi.sim.interfaces.errors import TerrainError

_LARGEST = 1e6


@dataclass(frozen=True)
class Hill:
    """The ground is raised by ``height`` (1 + cos(pi r / ``radius``)) / 2 at a distance r < ``radius`` of its top."""

    x: float  # [m] east, map frame
    y: float  # [m] north, map frame
    radius: float  # [m]
    height: float  # [m]

    def __post_init__(self) -> None:
        for name in ("x", "y"):
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"hill: {name} = {getattr(self, name)!r}; allowed: a finite number")
        for name in ("radius", "height"):
            check(getattr(self, name), f"hill: {name}", 0.0, _LARGEST, open_low=True)


@lru_cache(maxsize=4)
def with_hills(terrain: HeightField, hills: tuple[Hill, ...]) -> HeightField:
    """Terrain with hills set on it; the same object without any.

    Raises TerrainError for a hill whose top is off the map.
    """
    if not hills:
        return terrain
    rows, columns = terrain.z.shape
    x, y = np.meshgrid(np.arange(columns) * terrain.spacing, np.arange(rows) * terrain.spacing)
    z = terrain.z.copy()
    for hill in hills:
        if not terrain.contains(hill.x, hill.y):
            raise TerrainError(
                f"hill: ({hill.x}, {hill.y}) m is not on the terrain {terrain.name!r}; "
                f"allowed: 0 to {terrain.width:g} m east and 0 to {terrain.depth:g} m north"
            )
        distance = np.minimum(np.hypot(x - hill.x, y - hill.y) / hill.radius, 1.0)
        z += 0.5 * hill.height * (1.0 + np.cos(np.pi * distance))
    return HeightField(z, terrain.spacing, terrain.name, terrain.source, terrain.licence)


def hills_of(rows: Sequence[Sequence[float]]) -> tuple[Hill, ...]:
    """Hills from rows of x, y, radius and height [m]."""
    return tuple(Hill(*map(float, row)) for row in rows)
