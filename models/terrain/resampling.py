"""Elevation models brought to square grids, and what that loses.

The ground of a file is bilinear between its nodes; that of a map is linear on triangles. So the ground of the file may
rise above a triangle T, by

    rise(T) = max(0, max over p in T: file(p) - map(p)).

On the part of T within one cell of the file the difference is bilinear. It has no maximum inside, where it is a saddle,
nor on a line of the file's grid, where it is linear: the largest value is at a node of the file within T, or on an edge
of T, where it is quadratic from one crossing of the grid to the next. Both are computed exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.errors import TerrainError
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.dem import MOST_NODES, check_nodes, positive
from mathnavi.models.terrain.height_field import HIGHEST
from mathnavi.models.terrain.raster import Raster

_ROUNDING = 1e-9  # [nodes]
_CURVED = 2e-3  # [nodes] by which places between those of three nodes may miss the plane through them
_UNKNOWN = 1e30  # [m] in place of infinity, of which no share can be taken
Node = tuple[float, float, float]  # row, column, height [m]


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
        row, column = (
            _steps(rows, spacing / step_north, raster.z.shape[0])[:, None],
            _steps(columns, spacing / step_east, raster.z.shape[1]),
        )
    else:
        east = raster.west + np.arange(columns, dtype=np.float64) * spacing / to_east
        north = raster.south + np.arange(rows, dtype=np.float64) * spacing / to_north
        row, column = raster.locate(east, north)
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
    slack = 0.0 if raster.locate is None else _CURVED
    source = raster.z if raster.upper is None else np.minimum(raster.upper, _UNKNOWN)
    _rises(grid.z, source, row, column, slack, found)
    return _rounded_up(np.where(found > HIGHEST, np.inf, found))


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
def _rises(z: Array, source: Array, row: Array, column: Array, slack: float, found: Array) -> None:
    """Fill ``found`` as ``rises`` says; ``slack`` [pixels] is the error of ``row`` and ``column``."""
    for j in range(z.shape[0] - 1):
        for i in range(z.shape[1] - 1):
            for half in range(2):
                # South-west node, the one between, north-east node.
                b_j, b_i = (j, i + 1) if half == 0 else (j + 1, i)
                a = (row[j, i], column[j, i], z[j, i])
                b = (row[b_j, b_i], column[b_j, b_i], z[b_j, b_i])
                c = (row[j + 1, i + 1], column[j + 1, i + 1], z[j + 1, i + 1])
                highest = max(_on_edge(source, a, b), _on_edge(source, b, c), _on_edge(source, a, c))
                within, span = _at_nodes(source, a, b, c)
                found[j, i, half] = max(highest, within, 0.0) + slack * span


@inner_njit()
def _on_edge(source: Array, a: Node, b: Node) -> float:
    """Largest height [m] of the file above an edge from a to b (row, column, height), from crossing to crossing."""
    highest, begun = -np.inf, 0.0
    while begun < 1.0:
        end = min(_next(a[0], b[0], begun), _next(a[1], b[1], begun))
        middle = 0.5 * (begun + end)
        i = min(max(math.floor(a[0] + middle * (b[0] - a[0])), 0), source.shape[0] - 2)
        j = min(max(math.floor(a[1] + middle * (b[1] - a[1])), 0), source.shape[1] - 2)
        first, half, last = (
            _above(source, i, j, a, b, begun), _above(source, i, j, a, b, middle), _above(source, i, j, a, b, end),
        )  # fmt: skip
        highest = max(highest, first, last)
        square, linear = 2.0 * (first + last) - 4.0 * half, 4.0 * half - 3.0 * first - last
        if square < 0.0 < linear < -2.0 * square:
            highest = max(highest, first - 0.25 * linear * linear / square)
        begun = end
    return highest


@inner_njit()
def _next(a: float, b: float, share: float) -> float:
    """Share of the way from a to b at which the next whole number is crossed after ``share``; 1 if none is."""
    if a == b:
        return 1.0
    at = a + share * (b - a)
    whole = math.floor(at + _ROUNDING) + 1.0 if b > a else math.ceil(at - _ROUNDING) - 1.0
    crossed = (whole - a) / (b - a)
    return min(max(crossed, share + _ROUNDING), 1.0)


@inner_njit()
def _above(source: Array, i: int, j: int, a: Node, b: Node, share: float) -> float:
    """Height [m] of the file, as in its cell i, j, above the way from a to b, at a share of it."""
    r, c = a[0] + share * (b[0] - a[0]) - i, a[1] + share * (b[1] - a[1]) - j
    west, east = (
        source[i, j] * (1.0 - r) + source[i + 1, j] * r,
        source[i, j + 1] * (1.0 - r) + source[i + 1, j + 1] * r,
    )
    above: float = west * (1.0 - c) + east * c - a[2] - share * (b[2] - a[2])
    return above


@inner_njit()
def _at_nodes(source: Array, a: Node, b: Node, c: Node) -> tuple[float, float]:
    """Largest height [m] of the file's nodes within the triangle a, b, c above it, and the range [m] of those about."""
    r_1, c_1, h_1 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    r_2, c_2, h_2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    determinant = r_1 * c_2 - r_2 * c_1
    highest, low, high = -np.inf, np.inf, -np.inf
    for r in range(
        max(0, math.floor(min(a[0], b[0], c[0]))), min(source.shape[0], math.ceil(max(a[0], b[0], c[0])) + 1)
    ):
        for k in range(
            max(0, math.floor(min(a[1], b[1], c[1]))), min(source.shape[1], math.ceil(max(a[1], b[1], c[1])) + 1)
        ):
            low, high = min(low, source[r, k]), max(high, source[r, k])
            along = ((r - a[0]) * c_2 - (k - a[1]) * r_2) / determinant
            across = (r_1 * (k - a[1]) - c_1 * (r - a[0])) / determinant
            if along >= -_ROUNDING and across >= -_ROUNDING and along + across <= 1.0 + _ROUNDING:
                highest = max(highest, source[r, k] - a[2] - along * h_1 - across * h_2)
    return highest, high - low
