"""Colours of the ground: height tints, rock on steep slopes, snow on high gentle ones, and shade from the north-west.

Shade is Lambert's law on the normal of a smooth surface through the nodes, with the slopes exaggerated, mixed with the
height above the surroundings, so that ridges stand out from valleys wherever the light comes from.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from PIL import Image
from scipy import ndimage

from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.palette import Picture

EXAGGERATION = 1.7  # of heights where a whole map is seen from afar or from above
SUN_AZIMUTH = np.radians(315.0)  # from the north-west, as on printed maps
SUN_ELEVATION = np.radians(42.0)
SNOW_LINE_LEAST = 2200.0  # [m] no snow below, however low the map
SNOW = np.array([0.86, 0.885, 0.93])  # leaves room for the sunlit side to be whiter
SHADOW = np.array([0.30, 0.36, 0.52])  # what shade multiplies the colours by: bluish, never black


@dataclass(frozen=True, eq=False)
class GroundStyle:
    """Colours of a kind of ground."""

    tints: Array  # (k, 4) share of the map's range of heights, red, green, blue
    rock: Array | None = None  # (3,) of steep slopes; None where the tints are those of rock
    ambient: float = 0.18  # light that comes from everywhere


MOUNTAINS = GroundStyle(
    np.array(
        [
            [0.00, 0.36, 0.43, 0.27],
            [0.12, 0.50, 0.53, 0.33],
            [0.26, 0.66, 0.61, 0.42],
            [0.42, 0.64, 0.53, 0.38],
            [0.60, 0.53, 0.44, 0.36],
            [0.80, 0.50, 0.46, 0.43],
            [1.00, 0.62, 0.60, 0.58],
        ]
    ),
    np.array([0.44, 0.39, 0.35]),
)
# Sand and scrub on the floor, beds of red and pale sandstone, juniper on the plateau.
SANDSTONE = GroundStyle(
    np.array(
        [
            [0.00, 0.42, 0.44, 0.25],
            [0.03, 0.56, 0.52, 0.32],
            [0.06, 0.80, 0.64, 0.44],
            [0.13, 0.72, 0.43, 0.28],
            [0.20, 0.64, 0.33, 0.21],
            [0.22, 0.84, 0.62, 0.44],
            [0.25, 0.86, 0.66, 0.48],
            [0.27, 0.68, 0.36, 0.23],
            [0.38, 0.76, 0.44, 0.28],
            [0.41, 0.60, 0.29, 0.19],
            [0.44, 0.82, 0.54, 0.36],
            [0.52, 0.72, 0.39, 0.25],
            [0.54, 0.89, 0.72, 0.54],
            [0.57, 0.87, 0.68, 0.50],
            [0.59, 0.66, 0.35, 0.23],
            [0.68, 0.78, 0.49, 0.33],
            [0.74, 0.85, 0.64, 0.46],
            [0.80, 0.70, 0.56, 0.38],
            [0.86, 0.55, 0.52, 0.34],
            [0.93, 0.62, 0.56, 0.38],
            [1.00, 0.74, 0.64, 0.47],
        ]
    ),
    ambient=0.42,
)
STYLES = {"canyon": SANDSTONE}  # by the first word of a terrain's name; mountains otherwise


def resampled(terrain: HeightField, size: int, order: int) -> Array:
    """(rows, cols) heights [m], row 0 south, the longer side ``size`` nodes; order 1 on the grid's edges, 3 smooth.

    Those of order 3 lie between the heights of the nodes about them: a step in the ground causes no ripples next to it.
    """
    rows, cols = terrain.z.shape
    longest = max(rows, cols) - 1
    shape = [max(2, round((size - 1) * (n - 1) / longest) + 1) for n in (rows, cols)]
    axes = [np.linspace(0.0, n - 1, m) for n, m in zip((rows, cols), shape, strict=True)]
    grid = np.meshgrid(*axes, indexing="ij")
    heights: Array = ndimage.map_coordinates(
        terrain.z,
        grid,
        order=order,
        mode="nearest",
        prefilter=False,  # which a surface through all nodes would need
    )
    return heights


def tints(terrain: HeightField, heights: Array) -> Array:
    """(..., 3) colours of the ground at heights (...) [m], as they are without rock, snow and shade."""
    low, high = float(terrain.z.min()), float(terrain.z.max())
    share = np.clip((heights - low) / max(high - low, 1.0), 0.0, 1.0)
    own = _style(terrain).tints
    return np.stack([np.interp(share, own[:, 0], own[:, k]) for k in (1, 2, 3)], axis=-1)


def _style(terrain: HeightField) -> GroundStyle:
    return STYLES.get(terrain.name.partition(" ")[0], MOUNTAINS)


@lru_cache(maxsize=4)  # figures and pages over one terrain show it again and again
def relief(terrain: HeightField, size: int) -> Picture:
    """(rows, cols, 3) picture of the ground seen from above, row 0 NORTH, the longer side ``size`` pixels."""
    z = resampled(terrain, size, order=3)
    spacing = terrain.depth / (z.shape[0] - 1)
    north, east = np.gradient(z, spacing)
    low, high = float(terrain.z.min()), float(terrain.z.max())
    height = np.clip((z - low) / max(high - low, 1.0), 0.0, 1.0)
    style, colour = _style(terrain), tints(terrain, z)

    slope = np.hypot(east, north)
    roughness = np.clip(np.percentile(slope, 95), 0.05, 1.0)  # flat maps get their relief, too
    if style.rock is not None:
        colour = _mix(colour, style.rock, _step(slope, 0.55, 1.1) * _step(height, 0.15, 0.45))
    snow_line = max(SNOW_LINE_LEAST, low + 0.50 * (high - low))
    depth = 0.10 * (high - low) + 100.0
    facing_south = np.clip(north, -0.6, 0.6)  # uphill to the north: the sun melts these slopes first
    snow = _step((z - snow_line) / depth + 0.5 - slope - 0.6 * facing_south, -0.5, 0.6)
    colour = _mix(colour, SNOW, snow)

    steep = 1.1 / roughness  # slopes drawn steeper until the 95th percentile stands at 48 degrees
    normal = np.stack([-steep * east, -steep * north, np.ones_like(z)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    sun = np.array(
        [
            np.sin(SUN_AZIMUTH) * np.cos(SUN_ELEVATION),
            np.cos(SUN_AZIMUTH) * np.cos(SUN_ELEVATION),
            np.sin(SUN_ELEVATION),
        ]
    )
    lit = np.clip(normal @ sun, 0.0, None) / np.sin(SUN_ELEVATION)  # 1 on level ground
    prominence = z - ndimage.gaussian_filter(z, 0.02 * size, mode="nearest")
    openness = np.clip(prominence / max(2.0 * float(prominence.std()), 1.0), -1.0, 1.0)
    light = np.clip((0.98 - style.ambient) * lit + style.ambient + 0.12 * openness, 0.0, 1.35)[..., None]
    shaded = colour * np.where(light < 1.0, SHADOW + (1.0 - SHADOW) * light, 1.0 + 0.45 * (light - 1.0))
    picture: Picture = (255.0 * np.clip(shaded[::-1], 0.0, 1.0)).astype(np.uint8)
    picture.flags.writeable = False  # for it is shared
    return picture


def roughened(picture: Picture, detail: int, contrast: float) -> Picture:
    """The picture ``detail`` times as fine, with a made-up roughness of the brightness in four octaves.

    The roughness says nothing about the ground, but a camera that flies over it needs something to move past.
    """
    shape = (picture.shape[1] * detail, picture.shape[0] * detail)
    fine = np.asarray(Image.fromarray(picture).resize(shape, Image.Resampling.BICUBIC))
    random = np.random.default_rng(0)
    noise = np.zeros(fine.shape[:2], np.float32)
    for octave in (1, 2, 4, 8):
        grid = random.standard_normal([n // octave + 2 for n in fine.shape[:2]], dtype=np.float32)
        enlarged = Image.fromarray(grid).resize(shape, Image.Resampling.BICUBIC)
        noise += np.asarray(enlarged) / 2.0
    brightness = 1.0 + contrast * noise
    rough = np.empty(fine.shape, np.uint8)
    for channel in range(3):  # one at a time: a picture of 4100 x 4100 in floating point is large
        changed = fine[..., channel] * brightness
        rough[..., channel] = np.clip(changed, 0.0, 255.0, out=changed)
    return rough


def _mix(colour: Array, other: Array, share: Array) -> Array:
    mixed: Array = colour + share[..., None] * (other - colour)
    return mixed


def _step(value: Array, low: float, high: float) -> Array:
    """0 below ``low``, 1 above ``high``, a cubic between."""
    s = np.clip((value - low) / (high - low), 0.0, 1.0)
    smooth: Array = s * s * (3.0 - 2.0 * s)
    return smooth
