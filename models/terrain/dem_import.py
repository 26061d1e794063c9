"""Import of an elevation model: reads any supported file, writes a map file.

Read, crop, fill, resample, in this order: voids outside the crop do not matter, and no void spreads to its neighbours.

Nodes a fixed angle apart are not a fixed distance apart. They are resampled bilinearly onto a square grid of local
equirectangular metres: east and north as on the file's ellipsoid at the latitude of the centre. Over one degree the
true distance east differs from that by less than 1 % at 45 degrees of latitude, 2 % at 60; where it is more, the source
of the map says how much.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from mathnavi.interfaces.checks import check_spares
from mathnavi.interfaces.errors import TerrainError
from mathnavi.models.terrain.dem import checked_scale, existing, read_npz, read_png, write_npz
from mathnavi.models.terrain.height_field import WALL, HeightField
from mathnavi.models.terrain.raster import Box, Raster, cropped
from mathnavi.models.terrain.raster_file import FORMATS, read_raster
from mathnavi.models.terrain.resampling import rises, rounded_up, square_grid
from mathnavi.models.terrain.voids import GROUND, check_ground, check_voids, filled

PACKED = (".zip", ".gz")
_CLOSE = 0.02  # of lengths east that passes for true


def import_dem(
    path: str | Path,
    out: str | Path,
    spacing: float | None = None,
    scale: float | None = None,
    crop: Box | None = None,
    fill: bool = False,
    resample: float | None = None,
    nodata: float | None = None,
    heights: tuple[float, float] | None = None,
    void_error: float | None = None,
) -> HeightField:
    """Read the elevation model ``path``, write it as the map ``out`` (``.npz``) and return the map.

    ``spacing`` [m]: between the pixels of a PNG, which does not state it; not for any other file.
    ``scale`` [m per unit]: for a PNG, where it is needed, and for a raster file whose heights are not in the unit that
    it states.
    ``crop`` (west, south, east, north): keep what is within; in degrees for a raster file in degrees, in metres of its
    projection for another one, in metres from the south-west node for PNG and ``.npz``.
    ``fill``: fill voids from the heights around them, at most 100 nodes away.
    ``resample`` [m]: between the nodes of the map; the smaller step of the file without it.
    ``nodata``: value in the file that stands for a void, in addition to the one that it states.
    ``heights`` (low, high) [m]: range of heights that are ground; -500 to 9000 m on Earth without it.
    ``void_error`` [m]: how far the ground may be above what is filled; without it nothing relies on what is filled.

    The map's ``above`` bounds how far the file rises above it, since it is resampled. Raises TerrainError for a file
    that is malformed or has heights that no ground has, FileNotFoundError for one that does not exist.
    """
    path = existing(path)
    check_spares(out, [path])
    _check_words(heights, nodata, void_error, fill)
    raster = _read(path, spacing, scale, crop, nodata, heights)
    if fill:
        raster = filled(raster, math.inf if void_error is None else void_error)
    grid = square_grid(raster, resample)
    outside = (grid.row < 0.0) | (grid.row > raster.z.shape[0] - 1.0) | (grid.column < 0.0)
    check_voids(grid.z, raster, outside | (grid.column > raster.z.shape[1] - 1.0))
    grid = rounded_up(grid)
    source = "; ".join(filter(None, (raster.source, raster.taken, _off_at_ends(raster))))
    above = rises(raster, grid)
    terrain = HeightField(grid.z, grid.spacing, raster.name, source, raster.licence, above, raster.datum)
    write_npz(terrain, out)
    return read_npz(out)


def _off_at_ends(raster: Raster) -> str:
    """Say how wrong lengths east are at the ends of a raster in degrees; "" if they are within ``_CLOSE``."""
    if raster.latitude is None:
        return ""
    _, south, _, north = raster.box
    middle, *ends = (raster.ellipsoid.metres_per_degree(latitude)[1] for latitude in (raster.latitude, south, north))
    off = max(abs(end / middle - 1.0) for end in ends)
    return f"lengths east are off by {100.0 * off:.2g} % at its north or south end" if off > _CLOSE else ""


def _check_words(
    heights: tuple[float, float] | None, nodata: float | None, void_error: float | None, fill: bool
) -> None:
    if heights is not None and not (math.isfinite(heights[0]) and heights[0] < heights[1] < math.inf):
        raise TerrainError(f"heights = {heights[0]} {heights[1]} m; allowed: a finite lowest and a greater highest")
    if nodata is not None and math.isnan(nodata):
        raise TerrainError("nodata = nan; allowed: a number, NaN is void without it")
    if void_error is not None and not (math.isfinite(void_error) and void_error >= 0.0):
        raise TerrainError(f"void_error = {void_error} m; allowed: a finite number of at least 0")
    if void_error is not None and not fill:
        raise TerrainError(f"void_error = {void_error} m, but nothing is filled; allowed: together with --fill")


def _read(
    path: Path,
    spacing: float | None,
    scale: float | None,
    crop: Box | None,
    nodata: float | None,
    heights: tuple[float, float] | None,
) -> Raster:
    suffix = path.suffix.lower()
    if suffix == ".png":
        if spacing is None or scale is None:
            raise TerrainError(f"{path}: a PNG needs both spacing [m] and scale [m per unit], it states neither")
        raster = read_png(path, spacing, scale, nodata)
        check_ground(raster.z / scale, raster.z, spacing, heights or GROUND, str(path), south_up=True)
        return cropped(raster, crop)
    if suffix not in (*FORMATS, *PACKED, ".npz"):
        allowed = ", ".join((".png", ".npz", *FORMATS, *PACKED))
        in_python = "; in Python an array by HeightField and write_npz" if suffix == ".npy" else ""
        raise TerrainError(f"{path}: the ending {suffix!r} is not known; allowed: {allowed}{in_python}")
    if spacing is not None:
        raise TerrainError(f"spacing is {spacing}; {path} states its own, --resample changes it")
    if suffix != ".npz":
        return read_raster(path, crop, None if scale is None else checked_scale(scale), nodata, heights)
    for name, value in (("scale", scale), ("nodata", nodata)):
        if value is not None:
            raise TerrainError(f"{name} is {value}; {path} is in metres and takes none")
    terrain = read_npz(path)
    upper = terrain.highest.z
    whole = Raster(
        terrain.name, terrain.z, terrain.spacing, terrain.spacing, source=terrain.source, licence=terrain.licence,
        datum=terrain.datum, upper=None if terrain.above is None else np.where(upper == WALL, np.inf, upper),
    )  # fmt: skip
    return cropped(whole, crop)
