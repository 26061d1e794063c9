"""Elevation models brought to square grids, and what that loses.

The ground of a file is bilinear between its nodes; that of a map is linear on triangles. So the ground of the file may
rise above a triangle. Over each triangle T, in the rows and columns of the file,

    rise(T) = max(0, max over the nodes k of the cells that meet T's box: z_k - plane_T(k))

bounds how far: on a cell, a bilinear height minus the plane of T is bilinear, and the largest at a corner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.errors import TerrainError
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.dem import MOST_NODES, check_nodes, positive
from mathnavi.models.terrain.raster import Raster

_ROUNDING = 1e-9  # [nodes]


@dataclass(frozen=True, eq=False)
class SquareGrid:
    """Heights of a raster on a square grid, and the places of its nodes in the raster."""

    z: Array  # (m, n) [m], row 0 south; NaN where void
    spacing: float  # [m]
    row: Array  # (m, n), or broadcastable to it; of the raster, fractions among them
    column: Array
    resampled: bool  # whether the nodes are others than the raster's


def square_grid(raster: Raster, spacing: float | None = None) -> SquareGrid:
    """Resample ``raster`` to metres with equal steps ``spacing`` [m] both ways; its smaller step if None.

    Bilinear from the south-west node on, so the result ends less than one step short of the north and east borders. A
    node next to a void is void, and so is one that lies outside the raster. Raises TerrainError for a spacing that
    leaves fewer than 2 x 2 nodes, or more than a map may have.
    """
    to_north, to_east = raster.metres
    step_north, step_east = raster.step_north * to_north, raster.step_east * to_east
    given = "" if spacing is None else f"resample = {spacing} m, "
    spacing = min(step_north, step_east) if spacing is None else positive("resample", spacing, "m")
    if raster.locate is None and max(abs(step_north - spacing), abs(step_east - spacing)) <= 1e-9 * spacing:
        check_nodes(raster.z.size, f"{given}{raster.name}")
        rows, columns = raster.z.shape
        return SquareGrid(raster.z, spacing, _steps(rows, 1.0, rows)[:, None], _steps(columns, 1.0, columns), False)
    extents = [(count - 1) * step for count, step in zip(raster.nodes, (step_north, step_east), strict=True)]
    if max(extents) > MOST_NODES * spacing:
        raise TerrainError(f"resample = {spacing} m; allowed: at most {MOST_NODES} nodes of {raster.name}")
    # Rounding must not cost the last row where the steps divide the side.
    rows, columns = (math.floor(extent / spacing + 1e-9) + 1 for extent in extents)
    if min(rows, columns) < 2:
        raise TerrainError(
            f"resample = {spacing} m leaves {rows} x {columns} nodes of {raster.name}; allowed: at least 2 x 2"
        )
    check_nodes(rows * columns, f"{given}{raster.name} at {spacing:.4g} m")
    if raster.locate is None:
        row = _steps(rows, spacing / step_north, raster.z.shape[0])[:, None]
        column = _steps(columns, spacing / step_east, raster.z.shape[1])
    else:
        east, north = np.arange(columns) * spacing / to_east, np.arange(rows) * spacing / to_north
        row, column = raster.locate(raster.west + east, raster.south + north)
    return SquareGrid(bilinear(raster.z, row, column), spacing, row, column, resampled=True)


def _steps(count: int, step: float, nodes: int) -> Array:
    """Places of nodes ``step`` apart; rounding must not leave the last of the raster's."""
    places: Array = np.minimum(np.arange(count) * step, nodes - 1.0)
    return places


def bilinear(z: Array, row: Array, column: Array) -> Array:
    """Heights (m, n) [m] of a grid at rows and columns that broadcast to (m, n), fractions of a cell among them, by its
    four nodes; NaN outside of it, and next to a void.
    """
    rows, columns = z.shape
    outside = ~((row >= 0.0) & (row <= rows - 1.0)) | ~((column >= 0.0) & (column <= columns - 1.0))
    i = np.clip(np.nan_to_num(row), 0.0, rows - 1.0).astype(int)
    j = np.clip(np.nan_to_num(column), 0.0, columns - 1.0).astype(int)
    above, left = 1.0 - (row - i), 1.0 - (column - j)  # weights
    below, right = 1.0 - above, 1.0 - left
    k, m = np.minimum(i + 1, rows - 1), np.minimum(j + 1, columns - 1)
    heights: Array = z[i, j] * above * left + z[i, m] * above * right
    heights += z[k, j] * below * left
    heights += z[k, m] * below * right
    return np.where(outside, np.nan, heights) if outside.any() else heights


def rises(raster: Raster, grid: SquareGrid) -> NDArray[np.float32] | None:
    """How far (m - 1, n - 1, 2) [m] the ground of the raster may rise above the triangles of the grid's cells, that
    south-east of the diagonal first; None if it is the same ground.
    """
    if not grid.resampled:
        if raster.upper is None:
            return None
        node = raster.upper - grid.z
        ends = np.maximum(node[:-1, :-1], node[1:, 1:])  # of the diagonals
        return _rounded_up(np.stack((np.maximum(ends, node[:-1, 1:]), np.maximum(ends, node[1:, :-1])), axis=-1))
    found = np.empty((grid.z.shape[0] - 1, grid.z.shape[1] - 1, 2))
    row, column = np.broadcast_to(grid.row, grid.z.shape), np.broadcast_to(grid.column, grid.z.shape)
    _rises(grid.z, raster.z if raster.upper is None else raster.upper, row, column, found)
    return _rounded_up(found)


def _rounded_up(values: Array) -> NDArray[np.float32]:
    """Single precision, from which nothing is lost."""
    found = np.maximum(values, 0.0).astype(np.float32)
    return np.where(found < values, np.nextafter(found, np.float32(np.inf)), found)


def rounded_up(grid: SquareGrid) -> SquareGrid:
    """The grid with heights in single precision, as maps are written, none of them lower."""
    z = grid.z.astype(np.float32)
    z = np.where(z < grid.z, np.nextafter(z, np.float32(np.inf)), z)
    return replace(grid, z=z.astype(np.float64))


@njit(cache=True)
def _rises(z: Array, source: Array, row: Array, column: Array, found: Array) -> None:
    """Fill ``found`` as ``rises`` says."""
    rows, columns = source.shape
    for j in range(z.shape[0] - 1):
        for i in range(z.shape[1] - 1):
            for half in range(2):
                # South-west node, north-east node, and the one between them.
                b_j, b_i = (j, i + 1) if half == 0 else (j + 1, i)
                r_0, c_0, h_0 = row[j, i], column[j, i], z[j, i]
                r_1, c_1, h_1 = row[b_j, b_i] - r_0, column[b_j, b_i] - c_0, z[b_j, b_i] - h_0
                r_2, c_2, h_2 = row[j + 1, i + 1] - r_0, column[j + 1, i + 1] - c_0, z[j + 1, i + 1] - h_0
                determinant = r_1 * c_2 - r_2 * c_1
                by_row, by_column = (h_1 * c_2 - h_2 * c_1) / determinant, (r_1 * h_2 - r_2 * h_1) / determinant
                south = max(0, math.floor(r_0 + min(0.0, r_1, r_2) + _ROUNDING))
                north = min(rows - 1, math.ceil(r_0 + max(0.0, r_1, r_2) - _ROUNDING))
                west = max(0, math.floor(c_0 + min(0.0, c_1, c_2) + _ROUNDING))
                east = min(columns - 1, math.ceil(c_0 + max(0.0, c_1, c_2) - _ROUNDING))
                highest = 0.0
                for r in range(south, north + 1):
                    for c in range(west, east + 1):
                        above = source[r, c] - (h_0 + by_row * (r - r_0) + by_column * (c - c_0))
                        if above > highest:
                            highest = above
                found[j, i, half] = highest
