"""Arrows, outlines and other line drawings that change from moment to moment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.renders.palette import Colour
from mathnavi.renders.scene.elements import Layer, Lines

HEAD, SPREAD = 0.22, 0.4  # of an arrow: length of its head, and half of its width in that


def sequence(
    layer: Layer,
    frames: Sequence[Sequence[Array]],
    starts: Array,
    end: float,
    width: float,
    *,
    colour: Colour | None = None,
    dashed: bool = False,
    opacities: Sequence[float] | None = None,
    times: Sequence[Array] | None = None,
) -> list[Lines]:
    """Polylines (m, 3) of frames that follow each other at times (k,) [s]; nothing where there is no polyline.

    With ``times``, (m,) [s] of the points of each polyline, only what is ahead is shown.
    """
    polylines = [each for frame in frames for each in frame]
    if not polylines:
        return []
    own = Lines(
        layer, np.vstack(polylines), np.cumsum([0, *map(len, polylines)]), colour or layer.colour, width, dashed,
        frames=np.cumsum([0, *map(len, frames)]), starts=starts, end=end,
        opacities=None if opacities is None else np.array(opacities),
    )  # fmt: skip
    return [own if times is None else replace(own, times=np.concatenate(times), cut="ahead")]


def arrow(start: Array, vector: Array) -> list[Array]:
    """Shaft and head of an arrow (3,) from a point; nothing where it has no length."""
    length = float(np.linalg.norm(vector))
    if not np.isfinite(length) or length < 1e-9:
        return []
    along = vector / length
    side = np.cross(along, (0.0, 0.0, 1.0) if abs(along[2]) < 0.9 else (1.0, 0.0, 0.0))
    side /= np.linalg.norm(side)
    tip, back = start + vector, start + (1.0 - HEAD) * vector
    half = SPREAD * HEAD * length * side
    return [np.array([start, tip]), np.array([back + half, tip, back - half])]


def lifted(places: Array, height: float) -> Array:
    """(n, 3) points of places (n, 2) at a height [m]."""
    return np.column_stack([places, np.full(len(places), height)])


def thinned_rows(count: int, most: int) -> Array:
    """Return at most ``most`` of ``count`` indices, evenly spread, including the first and the last."""
    rows: Array = np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))
    return rows
