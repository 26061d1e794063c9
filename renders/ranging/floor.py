"""The floor of a field, painted: light within the wall, with lines to see how far things are, darker outside."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from mathnavi.interfaces.signals import Array
from mathnavi.models.field.wall import Wall
from mathnavi.renders.palette import Colour, Picture

Flags = NDArray[np.bool_]

BORDER = 0.4  # [m] beyond the wall; farther out there is the backdrop
PIXELS_PER_METRE = 160
MOST_PIXELS = 4096  # along the longer side
LINES = ((0.5, 0.004, 0.35), (1.0, 0.006, 0.7))  # [m] from line to line, half their width [m], how strong they are
INSIDE, OUTSIDE, RULED = (247.0, 245.0, 239.0), (186.0, 195.0, 205.0), (206.0, 204.0, 197.0)
SHADE = 0.10  # [m] from the wall within which the floor is darker


def extent(curve: Wall) -> tuple[Array, Array]:
    """Centre and half of the sides (2,) [m] of what is painted."""
    low, high = curve.polyline.min(axis=0), curve.polyline.max(axis=0)
    return 0.5 * (low + high), 0.5 * (high - low) + BORDER


def floor_picture(curve: Wall) -> Picture:
    """(height, width, 3), the first row at the greatest x_2."""
    centre, half = extent(curve)
    per_metre = min(PIXELS_PER_METRE, MOST_PIXELS / (2.0 * float(half.max())))
    columns, rows = (math.ceil(2.0 * side * per_metre) for side in half)
    x = centre[0] + half[0] * (2.0 * np.arange(columns) + 1.0 - columns) / columns
    y = centre[1] - half[1] * (2.0 * np.arange(rows) + 1.0 - rows) / rows
    within = _within(curve, x, y)
    picture = np.where(within[..., None], np.array(INSIDE), np.array(OUTSIDE))
    for step, half_width, strength in LINES:
        lines = _near(y, step, half_width)[:, None] | _near(x, step, half_width)[None, :]
        picture += strength * (lines & within)[..., None] * (np.array(RULED) - picture)
    to_wall = distance_transform_edt(within) / per_metre
    picture *= 1.0 - 0.16 * np.where(within, np.exp(-to_wall / SHADE), 0.0)[..., None]
    clipped: Picture = np.clip(np.round(picture), 0.0, 255.0).astype(np.uint8)
    return clipped


def pale(colour: Colour, strength: float) -> Colour:
    """Return a colour of a strength from 0 to 1 on the floor: opaque, so that lines do not darken where they meet."""
    r, g, b = (ground / 255.0 + strength * (own - ground / 255.0) for own, ground in zip(colour, INSIDE, strict=True))
    return r, g, b


def _within(curve: Wall, x: Array, y: Array) -> Flags:
    """(rows, columns) which pixels are within the wall, by the crossings of each row."""
    a = np.vstack([outline[:-1] for outline in curve.outlines])
    b = np.vstack([outline[1:] for outline in curve.outlines])
    within = np.zeros((len(y), len(x)), dtype=bool)
    for row, height in enumerate(y):
        crossing = (a[:, 1] > height) != (b[:, 1] > height)
        at = a[crossing, 0] + (height - a[crossing, 1]) / (b - a)[crossing, 1] * (b - a)[crossing, 0]
        within[row] = np.searchsorted(np.sort(at), x) % 2 == 1
    return within


def _near(values: Array, step: float, half_width: float) -> Flags:
    """Mask of the pixels that lie on a line."""
    near: Flags = np.abs(values / step - np.round(values / step)) * step < half_width
    return near
