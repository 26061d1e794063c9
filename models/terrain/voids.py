"""Voids of an elevation model: nodes without a height, stated or not, and how they are filled.

A file says which value stands for a void, or it does not. What it does not say is never guessed: heights that no ground
has are refused, by value, number and place, until the user says what they are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.errors import TerrainError
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.raster import Raster

GROUND = (-500.0, 9000.0)  # [m] heights on Earth, from the shore of the Dead Sea to the top of the Himalaya
CUSTOMARY = (-32768.0, -32767.0, -9999.0, -99999.0, 32767.0, 65535.0, 9999.0, 99999.0, -3.4028234663852886e38)
"""values that stand for voids in many files: where another body allows any height, they need a word of the user"""
REACH = 100  # nodes from which a void is filled
_FEWEST = 4  # nodes of one value that may be a plateau
_RELIEF = 10  # different heights elsewhere, of which most of the map is made: with less, anything may be ground
_CLIFF = 3.0  # times the largest step elsewhere: all about a plateau, it is no ground

Booleans = NDArray[np.bool_]


def check_ground(
    values: Array, z: Array, step: float, allowed: tuple[float, float] | None, where: str, south_up: bool = False
) -> None:
    """Raise TerrainError for heights that no ground has, with their value in the file, their number and the first.

    ``values`` (rows, cols) are the file's, ``z`` [m] the heights that they state, NaN where void, ``step`` [m] the
    smallest distance of nodes. ``allowed`` [m] is the range of heights; None on a body whose range is not known, where
    customary values of voids are refused. ``south_up``: row 0 is south.
    """
    low, high = allowed or (-np.inf, np.inf)
    odd = (z < low) | (z > high) if allowed else np.isin(values, np.array(CUSTOMARY)) & ~np.isnan(z)
    if odd.any():
        kinds, counts = np.unique(values[odd], return_counts=True)
        raise TerrainError(_refusal(values, odd, float(kinds[counts.argmax()]), where, south_up, allowed))
    if (plateau := _walled(z, step)) is not None:
        value = float(values[z == plateau].flat[0])
        raise TerrainError(
            _refusal(values, z == plateau, value, where, south_up, None, "a plateau with cliffs about it")
        )


def _refusal(
    values: Array,
    odd: Booleans,
    value: float,
    where: str,
    south_up: bool,
    allowed: tuple[float, float] | None,
    what: str = "",
) -> str:
    same = odd & (values == value)
    row, column = np.argwhere(same)[0] if south_up else np.argwhere(same[::-1])[0]
    others = int(np.count_nonzero(odd & ~same))
    count = f"{np.count_nonzero(same)} heights are {value:.10g}" + (f" and {others} more are odd" if others else "")
    why = f", {what}" if what else ""
    limits = f"allowed: {allowed[0]:g} to {allowed[1]:g} m; " if allowed else ""
    return (
        f"{where}: {count}{why}, the first at row {row} from the south, column {column} from the west; {limits}"
        f"--nodata {value:.10g} makes them voids, --heights LOW HIGH [m] says that they are ground"
    )


def _walled(z: Array, step: float) -> float | None:
    """Height [m] of a plateau of which every step to its surroundings is a cliff; None without one."""
    north, east = np.abs(np.diff(z, axis=0)), np.abs(np.diff(z, axis=1))
    for height in _ends_of_steepest(z, north, east):  # if there is such a plateau, it is one of these
        inside = z == height
        borders = np.concatenate((north[inside[:-1] != inside[1:]], east[inside[:, :-1] != inside[:, 1:]]))
        elsewhere = np.concatenate((north[~inside[:-1] & ~inside[1:]], east[~inside[:, :-1] & ~inside[:, 1:]]))
        lowest, largest = np.nanmin(borders, initial=np.inf), np.nanmax(elsewhere, initial=0.0)
        if not max(_CLIFF * largest, step) < lowest < np.inf:
            continue
        known = z[~np.isnan(z)]
        if _FEWEST <= np.count_nonzero(inside) < 0.5 * known.size and np.unique(known[known != height]).size >= _RELIEF:
            return height
    return None


def _ends_of_steepest(z: Array, north: Array, east: Array) -> tuple[float, ...]:
    """Heights [m] at both ends of the largest step."""
    along, across = np.nan_to_num(north, nan=-1.0), np.nan_to_num(east, nan=-1.0)
    if along.max(initial=-1.0) >= across.max(initial=-1.0):
        row, column = np.unravel_index(int(along.argmax()), along.shape)
        return float(z[row, column]), float(z[row + 1, column])
    row, column = np.unravel_index(int(across.argmax()), across.shape)
    return float(z[row, column]), float(z[row, column + 1])


def filled(raster: Raster, error: float = np.inf) -> Raster:
    """Fill voids by the heights around them, weighted by inverse distance; the source states the number of voids.

    The ground may be ``error`` [m] above what is filled: inf where that is not known. Raises TerrainError for voids
    more than ``REACH`` nodes from any height.
    """
    void = np.isnan(raster.z)
    if not void.any():
        return raster
    from rasterio.fill import fillnodata  # slow to import

    unfilled = -1e30
    z = fillnodata(np.where(void, unfilled, raster.z), mask=~void, max_search_distance=REACH)
    left = int(np.count_nonzero(z < 0.5 * unfilled))
    if left:
        raise TerrainError(
            f"{raster.name}: {left} voids are more than {REACH} nodes from any height and cannot be filled; "
            f"--crop keeps a part without; the file reaches from {raster.reach}"
        )
    count = int(void.sum())
    note = f"{count} of {void.size} heights ({100.0 * count / void.size:.2g} %) were void and filled from those around"
    source = f"{raster.source}; {note}" if raster.source else note
    z = np.where(void, z, raster.z)
    return replace(raster, z=z, source=source, upper=np.where(void, z + error, z))


def check_voids(z: Array, raster: Raster, outside: Booleans) -> None:
    """Raise TerrainError if heights (m, n) of the map of a raster are void, ``outside`` (m, n) it or within."""
    void = np.isnan(z)
    if not void.any():
        return
    row, column = np.argwhere(void)[0]
    beyond = int(np.count_nonzero(void & outside))
    how = (
        f"{beyond} of them lie beside the turned picture; --crop keeps a part without; the box around it reaches from "
        f"{raster.reach}"
        if beyond
        else "--crop keeps a part without, --fill fills them"
    )
    raise TerrainError(
        f"{raster.name}: {np.count_nonzero(void)} heights are void or NaN, the first at row {row} from the south, "
        f"column {column} from the west; {how}"
    )
