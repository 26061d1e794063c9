"""Pictures that are turned, or lie in a projection that stretches lengths: where the nodes of a north-up grid are."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from mathnavi.interfaces.errors import TerrainError
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.dem import MOST_NODES
from mathnavi.models.terrain.ellipsoid import Ellipsoid
from mathnavi.models.terrain.raster import Box
from mathnavi.models.terrain.vertical import parts_of

STRETCH = 0.01  # of lengths on the ground that passes for true to scale
_CLOSE = 1e-3  # [pixels] between the place of a node and what is interpolated
_BORDER = 1e-2  # [pixels] beside the outermost ones that belongs to them: borders are curved
_COARSEST = 64  # nodes between two whose places are computed


@dataclass(frozen=True, eq=False)
class NorthUpGrid:
    """A north-up grid over a picture, in the coordinates of ``system``."""

    picture: Any  # its coordinate system
    transform: Any  # from its columns and rows to its coordinates
    shape: tuple[int, int]  # its rows and columns
    system: Any
    box: Box  # of the outermost nodes
    steps: tuple[float, float]  # north, east

    @property
    def nodes(self) -> tuple[int, int]:
        """Nodes from south to north and from west to east."""
        west, south, east, north = self.box
        return int((north - south) / self.steps[0] + 1e-6) + 1, int((east - west) / self.steps[1] + 1e-6) + 1

    def places(self, east: Array, north: Array) -> tuple[Array, Array]:
        """Rows and columns (m, n) of the picture, fractions among them, at coordinates east (n,) and north (m,).

        They are computed at some nodes and interpolated between, within ``_CLOSE`` at the middles.
        """
        stride = _COARSEST
        while stride > 1:
            some_north, some_east = _some(len(north), stride), _some(len(east), stride)
            known = self._exact(east[some_east], north[some_north])
            if self._interpolates(east, north, some_east, some_north, known):
                found = [_between(values, some_north, some_east, north, east) for values in known]
                break
            stride //= 2
        else:
            found = list(self._exact(east, north))
        row, column = (_to_border(values, count - 1.0) for values, count in zip(found, self.shape, strict=True))
        return row, column

    def _interpolates(self, east: Array, north: Array, some_east: Array, some_north: Array, known: Any) -> bool:
        """Whether places in the middle of the known ones are those that are interpolated there."""
        middle_east, middle_north = _middles(some_east), _middles(some_north)
        if not (len(middle_east) and len(middle_north)):
            return False
        for exact, values in zip(self._exact(east[middle_east], north[middle_north]), known, strict=True):
            found = _between(values, some_north, some_east, north, east)[np.ix_(middle_north, middle_east)]
            if not (np.abs(found - exact) < _CLOSE).all():
                return False
        return True

    def _exact(self, east: Array, north: Array) -> tuple[Array, Array]:
        x, y = np.meshgrid(east, north)
        x, y = _transformed(self.system, self.picture, x.ravel(), y.ravel())
        column, row = _applied(~self.transform, x, y)
        shape = (len(north), len(east))
        return np.reshape(row, shape) - 0.5, np.reshape(column, shape) - 0.5  # of the pixels' centres


def _to_border(places: Array, last: float) -> Array:
    inside: Array = np.clip(places, 0.0, last)
    return np.where(np.abs(inside - places) < _BORDER, inside, places)


def _some(count: int, stride: int) -> Array:
    return np.unique(np.append(np.arange(0, count, stride), count - 1))


def _middles(some: Array) -> Array:
    return np.unique((some[1:] + some[:-1]) // 2)


def _between(values: Array, rows: Array, columns: Array, north: Array, east: Array) -> Array:
    """Values (m, n) at all nodes from those at some rows and columns of them, bilinearly."""
    along = np.stack([np.interp(east, east[columns], line) for line in values])
    j = np.clip(np.searchsorted(rows, np.arange(len(north)), side="right") - 1, 0, len(rows) - 2)
    span = north[rows[j + 1]] - north[rows[j]]
    share = ((north - north[rows[j]]) / span)[:, None]
    found: Array = along[j] * (1.0 - share) + along[j + 1] * share
    return found


def _transformed(source: Any, target: Any, x: Array, y: Array) -> Array:
    from rasterio.warp import transform

    return np.array(transform(source, target, list(x), list(y)), dtype=float)


def base_of(crs: Any) -> Any:
    """Geographic coordinate system, in degrees, in which a projection is defined; WGS 84 for one in other angles."""
    from rasterio.crs import CRS

    across = parts_of(crs.to_dict(projjson=True))[0]
    return CRS.from_user_input(json.dumps(across["base_crs"])) if "base_crs" in across else CRS.from_epsg(4326)


def _points(dataset: Any, columns: Array, rows: Array) -> tuple[Array, Array]:
    """Coordinates of points of a picture, given as fractions of its width and height."""
    return _applied(dataset.transform, columns * dataset.width, rows * dataset.height)


def corners_of(dataset: Any) -> Array:
    """Coordinates (2, 4) of the corners of a picture."""
    return np.array(_points(dataset, np.array((0.0, 0.0, 1.0, 1.0)), np.array((0.0, 1.0, 0.0, 1.0))))


def _applied(transform: Any, x: Array, y: Array) -> tuple[Array, Array]:
    return (
        transform.a * x + transform.b * y + transform.c,
        transform.d * x + transform.e * y + transform.f,
    )


def true_to_scale(dataset: Any, ellipsoid: Ellipsoid) -> bool:
    """True if the projection keeps lengths, up to STRETCH, at the picture's centre and corners."""
    metre = dataset.crs.linear_units_factor[1]
    x, y = _points(dataset, np.array((0.5, 0.0, 1.0, 0.0, 1.0)), np.array((0.5, 0.0, 0.0, 1.0, 1.0)))
    step = 1.0 / metre  # one metre
    lines = np.concatenate((x, x + step, x)), np.concatenate((y, y, y + step))
    east, north = _transformed(dataset.crs, base_of(dataset.crs), *lines).reshape(2, 3, -1)
    if not (np.isfinite(east).all() and np.isfinite(north).all()):
        return False
    for place in range(len(x)):
        to_north, to_east = ellipsoid.metres_per_degree(north[0, place])
        for moved in (1, 2):
            length = math.hypot(
                to_east * (east[moved, place] - east[0, place]), to_north * (north[moved, place] - north[0, place])
            )
            if abs(length - 1.0) > STRETCH:
                return False
    return True


def located(dataset: Any, ellipsoid: Ellipsoid, degrees: bool, kept: bool, where: str) -> NorthUpGrid:
    """North-up grid around a picture, or within it where its sides run north and east but for less than two pixels.

    Its step is the shorter side that a pixel at the picture's centre has on the ground. Raises TerrainError for a
    picture that cannot be brought to it.
    """
    from rasterio.errors import CRSError

    system = dataset.crs if kept else base_of(dataset.crs)
    share = np.linspace(0.0, 1.0, 21)  # along each border, which may be curved
    low_x, high_x, low_y, high_y = (
        *(0.5 / dataset.width, 1.0 - 0.5 / dataset.width),
        *(0.5 / dataset.height, 1.0 - 0.5 / dataset.height),
    )
    across, down = low_x + share * (high_x - low_x), low_y + share * (high_y - low_y)
    one = np.ones_like(share)
    columns = np.concatenate((across, across, low_x * one, high_x * one, (0.5, 0.5 + 1.0 / dataset.width, 0.5)))
    rows = np.concatenate((low_y * one, high_y * one, down, down, (0.5, 0.5, 0.5 + 1.0 / dataset.height)))
    try:
        east, north = _transformed(dataset.crs, system, *_points(dataset, columns, rows))
    except CRSError as error:
        text = " ".join(str(error).split())[:200]
        raise TerrainError(f"{where}: its coordinate system cannot be brought to degrees ({text})") from None
    to_north, to_east = ellipsoid.metres_per_degree(north[-3]) if degrees else (1.0, 1.0)
    right = (to_east * (east[-2] - east[-3]), to_north * (north[-2] - north[-3]))
    lower = (to_east * (east[-1] - east[-3]), to_north * (north[-1] - north[-3]))
    step = min(math.hypot(*right), math.hypot(*lower))
    steps = (step / to_north, step / to_east)
    borders = [np.array(values[:84]).reshape(4, 21) for values in (east, north)]
    if degrees and np.abs(np.diff(borders[0], axis=1)).max() > 180.0:
        raise TerrainError(
            f"{where}: it crosses the meridian where longitudes begin again, or holds a pole; allowed: a part beside "
            "it, or a projection that is true to scale there, to which gdalwarp brings it"
        )
    west, east_end = _ends(borders[0], steps[1])
    south, north_end = _ends(borders[1], steps[0])
    extents = ((north_end - south) / steps[0], (east_end - west) / steps[1])
    if not all(extent <= MOST_NODES for extent in extents):
        raise TerrainError(
            f"{where}: its transform {tuple(dataset.transform)[:6]} places its pixels nowhere on the ground"
        )
    if min(extents) < 1.0:
        raise TerrainError(
            f"{where}: {dataset.height} x {dataset.width} heights, turned or stretched, hold less than 2 x 2 nodes "
            "from south to north and from west to east"
        )
    return NorthUpGrid(dataset.crs, dataset.transform, dataset.shape, system, (west, south, east_end, north_end), steps)


def _ends(borders: Array, step: float) -> tuple[float, float]:
    """Lowest and highest coordinate of four borders: of the inside where the outermost two are nearly straight."""
    means = borders.mean(axis=1)
    low, high = borders[means.argmin()], borders[means.argmax()]
    straight = max(np.ptp(low), np.ptp(high)) < 2.0 * step
    return (float(low.max()), float(high.min())) if straight else (float(borders.min()), float(borders.max()))
