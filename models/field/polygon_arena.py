"""Geoms of a polygon: the triangles that are sensed, and boxes behind its segments, which are drawn and collide.

A box lies behind its segment, in what is solid, so no ray meets it before the wall. Where what is solid is thinner than
a wall is drawn, or ends in a sharp corner, the box is thinner, or ends before the corner; what is thinner than a
millimetre has none.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Array
from mathnavi.models.field.polygon import Polygon

_THINNEST = 5e-4  # [m] of a box
_ROOM = math.radians(210.0)  # angle of what is solid at a corner, above which boxes are longer than their segments


@dataclass(frozen=True, eq=False)
class WallBox:
    """A box behind a segment, seen from above."""

    middle: Array  # (2,) [m]
    along: Array  # (2,) unit vector
    length: float  # [m]
    thickness: float  # [m]


def triangles(segments: Array, low: float, high: float) -> Array:
    """Triangles (2 n, 3, 3) [m] on segments (n, 4), from a height ``low`` to ``high`` [m]."""
    a, b, n = segments[:, :2], segments[:, 2:], len(segments)
    under = [np.column_stack([p, np.full(n, low)]) for p in (a, b)]
    over = [np.column_stack([p, np.full(n, high)]) for p in (a, b)]
    return np.concatenate([np.stack([under[0], under[1], over[0]], 1), np.stack([under[1], over[1], over[0]], 1)])


def boxes_behind(wall: Polygon, thickness: float, gap: float) -> Iterator[WallBox]:
    """Boxes of at most a ``thickness`` [m] that begin a ``gap`` [m] behind the segments."""
    for ring in wall.outlines:
        sides = np.diff(ring, axis=0)
        lengths = np.linalg.norm(sides, axis=1)
        headings = np.arctan2(sides[:, 1], sides[:, 0])
        turns = np.roll(headings, -1) - headings  # at the end of each, to the left
        solid = math.pi + (turns + math.pi) % (2.0 * math.pi) - math.pi  # angle behind the corner
        for k, length in enumerate(lengths):
            along = sides[k] / length
            box = _box(wall, ring[k], along, float(length), (float(solid[k - 1]), float(solid[k])), thickness, gap)
            if box is not None:
                yield box


def _box(
    wall: Polygon, a: Array, along: Array, length: float, solid: tuple[float, float], thickness: float, gap: float
) -> WallBox | None:
    """The thickest box behind one segment, by halving; ``solid`` are the angles [rad] behind its two corners."""
    behind = np.array([along[1], -along[0]])
    axes = np.column_stack([along, behind])
    first, last = (wall.segments[:, :2] - a) @ axes, (wall.segments[:, 2:] - a) @ axes
    while thickness >= _THINNEST:
        begin, end = -_beyond(solid[0], thickness, gap), length + _beyond(solid[1], thickness, gap)
        if end > begin and not _is_met(first, last, (begin, gap), (end, gap + thickness)).any():
            middle = a + 0.5 * (begin + end) * along + (gap + 0.5 * thickness) * behind
            return WallBox(middle, along, end - begin, thickness)
        thickness *= 0.5
    return None


def _beyond(solid: float, thickness: float, gap: float) -> float:
    """How far [m] a box goes beyond a corner; negative where it ends before it."""
    if solid > _ROOM:
        return thickness
    if solid >= math.pi:
        return 0.0
    slope = math.cos(solid) / math.sin(solid)
    return -max(0.0, gap / math.sin(solid) + max(gap * slope, (gap + thickness) * slope))


def _is_met(first: Array, last: Array, low: tuple[float, float], high: tuple[float, float]) -> NDArray[np.bool_]:
    """True (n,) for the segments that meet a rectangle (Liang and Barsky, 1984)."""
    begin, end = np.zeros(len(first)), np.ones(len(first))
    for j in range(2):
        d = last[:, j] - first[:, j]
        with np.errstate(divide="ignore", invalid="ignore"):
            one, other = (low[j] - first[:, j]) / d, (high[j] - first[:, j]) / d
        level = d == 0.0
        within = (first[:, j] > low[j]) & (first[:, j] < high[j])
        begin = np.maximum(begin, np.where(level, np.where(within, 0.0, 2.0), np.minimum(one, other)))
        end = np.minimum(end, np.where(level, 1.0, np.maximum(one, other)))
    met: NDArray[np.bool_] = begin < end
    return met
