"""Occupancy grids from laser scans at known poses, by counting rays (Hähnel, Burgard, Wolfram, Thrun: counting model).

A ray passes through the cells up to its end (Amanatides and Woo, 1987) and ends in one. Of a cell in which n rays ended
and through which m passed, n / (n + m) is how often it reflected: occupied where that is ``occupied`` or more, free
where it is less, unknown where fewer than ``least`` rays came. A ray without an echo counts nowhere.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.field.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

MOST_CELLS = 50_000_000
_BORDER = 2  # cells around the outermost ends
_OUTERMOST = 0.001  # share of the ends on either side that may lie outside the grid: single wrong ranges


def grid_of_scans(
    poses: Array,
    angles: Array,
    ranges: Array,
    *,
    resolution: float = 0.05,
    longest: float = math.inf,
    occupied: float = 0.25,
    least: int = 2,
    name: str = "map",
) -> OccupancyGrid:
    """Grid of scans with ``ranges`` (n, l) [m] at ``angles`` (l,) [rad] from ``poses`` (n, 3) [m, m, rad] of the laser.

    A range that is not positive, or not below ``longest`` [m], is one without an echo. Raises FieldError if no range
    has one, or if the grid would be too large.
    """
    known = np.isfinite(poses).all(axis=1, keepdims=True)
    usable = (ranges > 0.0) & (ranges < longest) & known
    if not usable.any():
        raise FieldError(
            f"{name}: no range of the scans is between 0 and {longest:g} m; allowed: a greater range_maximum"
        )
    beta = poses[:, 2:] + angles
    reach = np.where(usable, ranges, 0.0)
    ends = [(poses[:, j, None] + reach * turned)[usable] for j, turned in enumerate((np.cos(beta), np.sin(beta)))]
    low = np.array([np.quantile(each, _OUTERMOST) for each in ends])
    high = np.array([np.quantile(each, 1.0 - _OUTERMOST) for each in ends])
    low, high = np.minimum(low, poses[:, :2].min(axis=0)), np.maximum(high, poses[:, :2].max(axis=0))
    # Whole cells from zero on, so that maps of the same place have the same cells.
    first = np.floor(low / resolution) - _BORDER
    columns, rows = (np.ceil(high / resolution) + _BORDER - first).astype(int).tolist()
    if columns * rows > MOST_CELLS:
        raise FieldError(
            f"{name}: {columns} x {rows} cells; allowed: at most {MOST_CELLS} in all, with a coarser resolution"
        )
    origin = first * resolution
    ended, passed = np.zeros((rows, columns), np.int64), np.zeros((rows, columns), np.int64)
    count_rays(ended, passed, (poses[:, :2] - origin) / resolution, beta, reach / resolution)
    total = ended + passed
    cells = np.where(total < least, UNKNOWN, np.where(ended >= occupied * total, OCCUPIED, FREE)).astype(np.uint8)
    return OccupancyGrid(cells, resolution, (float(origin[0]), float(origin[1]), 0.0), name)


@njit(cache=True, nogil=True)
def count_rays(ended: Integers, passed: Integers, places: Array, beta: Array, reach: Array) -> None:
    """Count, in place, the rays that end in and pass through cells (rows, columns).

    They start at ``places`` (n, 2) [cells], along ``beta`` (n, l) [rad], and are as long as ``reach`` (n, l) [cells];
    one of length 0 does not count.
    """
    for k in range(len(places)):
        for i in range(beta.shape[1]):
            if reach[k, i] > 0.0:
                _count(ended, passed, places[k, 0], places[k, 1], beta[k, i], reach[k, i])


@inner_njit(nogil=True)
def _count(ended: Integers, passed: Integers, x: float, y: float, beta: float, reach: float) -> None:
    rows, columns = ended.shape
    ex, ey = math.cos(beta), math.sin(beta)
    i, j = math.floor(x), math.floor(y)
    last_i, last_j = math.floor(x + reach * ex), math.floor(y + reach * ey)
    step_i, step_j = (1 if ex > 0.0 else -1), (1 if ey > 0.0 else -1)
    next_i = ((i + (step_i > 0)) - x) / ex if ex != 0.0 else math.inf
    next_j = ((j + (step_j > 0)) - y) / ey if ey != 0.0 else math.inf
    from_i = abs(1.0 / ex) if ex != 0.0 else math.inf
    from_j = abs(1.0 / ey) if ey != 0.0 else math.inf
    for _ in range(abs(last_i - i) + abs(last_j - j)):
        if 0 <= i < columns and 0 <= j < rows:
            passed[j, i] += 1
        if next_i < next_j:
            i += step_i
            next_i += from_i
        else:
            j += step_j
            next_j += from_j
    if 0 <= last_i < columns and 0 <= last_j < rows:
        ended[last_j, last_i] += 1
