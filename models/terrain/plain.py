"""Level ground: over it the height of a flight is its clearance."""

from __future__ import annotations

import numpy as np

from mathnavi.models.terrain.height_field import HeightField

_NODES, _SPACING = 49, 20.0  # a side of 960 m


def plain(height: int = 100) -> HeightField:
    """Level ground of 960 m by 960 m, ``height`` [m] above sea level."""
    heights = np.full((_NODES, _NODES), float(height))
    return HeightField(heights, _SPACING, f"plain {height}", "made up by mathnavi.models.terrain.plain", "Apache-2.0")
