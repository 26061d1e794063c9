"""Import of an elevation model: reads any supported file, writes a map file.

Read, crop, fill, resample, in this order: voids outside the crop do not matter, and no void spreads to its neighbours.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from mathnavi.interfaces.checks import check_spares
from mathnavi.interfaces.errors import TerrainError
from mathnavi.models.terrain.dem import (
    Box,
    Raster,
    cropped,
    existing,
    height_field,
    positive,
    read_hgt,
    read_npz,
    read_png,
    square_grid,
    write_npz,
)
from mathnavi.models.terrain.geotiff import read_geotiff
from mathnavi.models.terrain.height_field import HeightField

REACH = 100  # nodes from which a void is filled


def import_dem(
    path: str | Path,
    out: str | Path,
    spacing: float | None = None,
    scale: float | None = None,
    crop: Box | None = None,
    fill: bool = False,
    resample: float | None = None,
) -> HeightField:
    """Read the elevation model ``path``, write it as the map ``out`` (``.npz``) and return the map.

    ``spacing`` [m]: between the pixels of a PNG, which does not state it; not for any other file.
    ``scale`` [m per unit]: for a PNG, where it is needed, and for a GeoTIFF whose heights are not in metres.
    ``crop`` (west, south, east, north): keep what is within; in degrees for ``.hgt`` and a GeoTIFF in degrees, in
    metres of its projection for another GeoTIFF, in metres from the south-west node for PNG and ``.npz``.
    ``fill``: fill voids from the heights around them, at most 100 nodes away.
    ``resample`` [m]: between the nodes of the map; those of the file (its rows, where these are angles) without it.
    """
    path = existing(path)
    check_spares(out, [path])
    raster = _read(path, spacing, scale, crop)
    terrain = height_field(square_grid(_filled(raster) if fill else raster, resample))
    write_npz(terrain, out)
    return read_npz(out)


def _filled(raster: Raster) -> Raster:
    """Fill voids by the heights around them, weighted by inverse distance; the source states the number of voids."""
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
    return replace(raster, z=np.where(void, z, raster.z), source=source)


def _read(path: Path, spacing: float | None, scale: float | None, crop: Box | None) -> Raster:
    suffix = path.suffix.lower()
    if suffix == ".png":
        if spacing is None or scale is None:
            raise TerrainError(f"{path}: a PNG needs both spacing [m] and scale [m per unit], it states neither")
        return cropped(read_png(path, spacing, scale), crop)
    if suffix not in (".hgt", ".tif", ".tiff", ".npz"):
        raise TerrainError(f"{path}: the ending {suffix!r} is not known; allowed: .png, .hgt, .tif, .tiff, .npz")
    if spacing is not None:
        raise TerrainError(f"spacing is {spacing}; {path} states its own, --resample changes it")
    if suffix in (".tif", ".tiff"):
        return read_geotiff(path, crop, None if scale is None else positive("scale", scale, "m per unit"))
    if scale is not None:
        raise TerrainError(f"scale is {scale}; {path} is in metres and takes none")
    if suffix == ".hgt":
        return cropped(read_hgt(path), crop)
    terrain = read_npz(path)
    whole = Raster(
        terrain.name, terrain.z, terrain.spacing, terrain.spacing, source=terrain.source, licence=terrain.licence
    )
    return cropped(whole, crop)
