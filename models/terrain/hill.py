"""Hills added to a terrain: ground that is missing on the map, or ground for a test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Annotated

import numpy as np
from annotated_types import Le

from mathnavi.interfaces.bounds import Finite, Positive, configuration
from mathnavi.interfaces.errors import TerrainError
from mathnavi.models.terrain.height_field import HeightField

_LARGEST = 1e6


@configuration(prefix="hill: ")
class Hill:
    """Hill that raises the ground by ``height`` (1 + cos(pi r / ``radius``)) / 2 at r < ``radius`` from its top."""

    x: Finite  # [m] east, map frame
    y: Finite  # [m] north, map frame
    radius: Annotated[Positive, Le(_LARGEST)]  # [m]
    height: Annotated[Positive, Le(_LARGEST)]  # [m]


@lru_cache(maxsize=4)
def with_hills(terrain: HeightField, hills: tuple[Hill, ...]) -> HeightField:
    """Add hills to a terrain; returns the same object without any.

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
    return replace(terrain, z=z)


def hills_of(rows: Sequence[Sequence[float]]) -> tuple[Hill, ...]:
    """Hills from rows of x, y, radius and height [m]."""
    return tuple(Hill(*map(float, row)) for row in rows)
