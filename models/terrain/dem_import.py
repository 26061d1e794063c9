"""Import of an elevation model: reads any supported file, writes a map file.

Read, crop, fill, resample, in this order: voids outside the crop do not matter, and no void spreads to its neighbours.

**GeoTIFFs**: one band of heights, in any coordinate system that rasterio knows.

Rows and columns are turned to north and east. A picture that is north-up and true to scale is read unchanged. A
rotated one is resampled onto a north-up grid of its own coordinate system; one whose projection stretches lengths by
more than 1 % (Web Mercator stretches them by 1 / cos(latitude)) onto a grid in degrees.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.checks import check_spares
from mathnavi.interfaces.errors import TerrainError
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.dem import (
    MOST_NODES,
    Box,
    Raster,
    check_nodes,
    cropped,
    existing,
    height_field,
    metres_per_degree,
    positive,
    read_hgt,
    read_npz,
    read_png,
    square_grid,
    within,
    write_npz,
)
from mathnavi.models.terrain.height_field import HeightField

UNSTATED_VOID = -32768  # where 16-bit heights state no void: SRTM's
STRETCH = 0.01  # of lengths on the ground that passes for true to scale
FARTHEST = (1e8, 1e8)  # [m] of any projection's coordinates east and north
FARTHEST_DEGREES = (720.0, 90.5)  # of longitude; of latitude, where the outermost nodes of a tile may be the poles
DEGREE = math.radians(1.0)
METRES = ("", "m", "metre", "meter", "metres", "meters")
WGS84 = "EPSG:4326"


def read_geotiff(path: Path, crop: Box | None = None, scale: float | None = None) -> Raster:
    """Read the heights of a GeoTIFF, or of the part within ``crop``.

    ``crop`` (west, south, east, north): [degrees], or [m] of a projection. ``scale`` [m per unit] of the heights;
    needed where the file states another unit than the metre. Raises TerrainError for a file that is damaged or has no
    place on the ground.
    """
    import rasterio
    from rasterio.errors import RasterioError, RasterioIOError

    try:
        # It warns of a missing place, which is an error below.
        with warnings.catch_warnings(action="ignore"), rasterio.open(path, driver="GTiff") as dataset:
            return _raster(dataset, path, crop, scale)
    except RasterioIOError as error:  # its cause says more than itself
        raise TerrainError(f"{path}: not a readable GeoTIFF ({_line(error.__cause__ or error)})") from None
    except RasterioError as error:
        raise TerrainError(f"{path}: not a readable GeoTIFF ({_line(error)})") from None


def _line(error: BaseException) -> str:
    return " ".join(str(error).split())


def _raster(dataset: Any, path: Path, crop: Box | None, scale: float | None) -> Raster:
    if dataset.count != 1:
        raise TerrainError(f"{path}: {dataset.count} bands; allowed: one, the heights")
    if np.dtype(dataset.dtypes[0]).kind not in "fiu":
        raise TerrainError(f"{path}: heights of the type {dataset.dtypes[0]}; allowed: real numbers")
    unit = str(dataset.units[0] or "")
    if scale is None and unit.lower() not in METRES:
        raise TerrainError(f"{path}: scale is missing; heights are in {unit!r}: say how many metres one is")
    crs, transform = dataset.crs, dataset.transform
    if crs is None or not (crs.is_geographic or crs.is_projected):
        raise TerrainError(f"{path}: no coordinate system on the ground (rio edit-info --crs writes one into the file)")
    corners = np.abs(_placed(dataset, np.array((0.0, 0.0, 1.0, 1.0)), np.array((0.0, 1.0, 0.0, 1.0))))
    unit = crs.units_factor[1] / (DEGREE if crs.is_geographic else 1.0)
    if not (
        abs(transform.determinant) > 0.0
        and (unit * corners.max(axis=1) < (FARTHEST_DEGREES if crs.is_geographic else FARTHEST)).all()
    ):
        raise _nowhere(dataset, path)
    degrees = crs.is_geographic and math.isclose(crs.units_factor[1], DEGREE, rel_tol=1e-9)
    kept = degrees or (crs.is_projected and _true_to_scale(dataset))
    if kept and transform.b == transform.d == 0.0 and transform.a > 0.0 and transform.e < 0.0:
        return _north_up(dataset, path, crop, degrees, scale)
    return _warped(dataset, path, crop, crs if kept else WGS84, degrees or not kept, scale)


def _nowhere(dataset: Any, path: Path) -> TerrainError:
    return TerrainError(f"{path}: its transform {tuple(dataset.transform)[:6]} places it nowhere on the ground")


def _placed(dataset: Any, columns: Array, rows: Array) -> Array:
    """Coordinates (2, n) of points of a picture, given as fractions of its width and height."""
    place = dataset.transform
    column, row = columns * dataset.width, rows * dataset.height
    return np.array((place.a * column + place.b * row + place.c, place.d * column + place.e * row + place.f))


def _true_to_scale(dataset: Any) -> bool:
    """True if the projection keeps lengths, up to STRETCH, at the picture's centre and corners."""
    from rasterio.warp import transform

    metre = dataset.crs.linear_units_factor[1]
    x, y = _placed(dataset, np.array((0.5, 0.0, 1.0, 0.0, 1.0)), np.array((0.5, 0.0, 0.0, 1.0, 1.0)))
    step = 1.0 / metre  # one metre
    east, north = np.array(
        transform(dataset.crs, WGS84, [*x, *(x + step), *x], [*y, *y, *(y + step)]), dtype=float
    ).reshape(2, 3, -1)
    if not (np.isfinite(east).all() and np.isfinite(north).all()):
        return False
    for place in range(len(x)):
        to_north, to_east = metres_per_degree(north[0, place])
        for moved in (1, 2):
            length = math.hypot(
                to_east * (east[moved, place] - east[0, place]), to_north * (north[moved, place] - north[0, place])
            )
            if abs(length - 1.0) > STRETCH:
                return False
    return True


def _north_up(dataset: Any, path: Path, crop: Box | None, degrees: bool, scale: float | None) -> Raster:
    unit = 1.0 if degrees else dataset.crs.linear_units_factor[1]
    transform = dataset.transform
    step_north, step_east = -transform.e * unit, transform.a * unit
    # Heights are those of the pixels' centres.
    west = (transform.c + 0.5 * transform.a) * unit
    south = (transform.f + (dataset.height - 0.5) * transform.e) * unit
    rows, columns = slice(0, dataset.height), slice(0, dataset.width)
    if crop is not None:
        rows, columns = within(crop, dataset.shape, (south, west), (step_north, step_east), path.stem)
    count = (rows.stop - rows.start) * (columns.stop - columns.start)
    check_nodes(count, str(path))
    window = ((dataset.height - rows.stop, dataset.height - rows.start), (columns.start, columns.stop))
    z = _heights(dataset, window, scale)[::-1]
    south, west = south + rows.start * step_north, west + columns.start * step_east
    latitude = south + 0.5 * (z.shape[0] - 1) * step_north if degrees else None
    return Raster(path.stem, z, step_north, step_east, latitude, south=south, west=west)


def _heights(dataset: Any, window: Sequence[Sequence[int]] | None, scale: float | None) -> Array:
    """Heights (rows, cols) [m] in the order of the file, NaN where void."""
    values = dataset.read(1, window=window, masked=True)
    void = np.ma.getmaskarray(values)
    if dataset.nodata is None and dataset.dtypes[0] == "int16":
        void = void | (values.data == UNSTATED_VOID)
    z = values.data.astype(np.float64) * dataset.scales[0] + dataset.offsets[0]
    z = np.where(void | ~np.isfinite(z), np.nan, z)
    return z if scale is None else z * scale


def _warped(dataset: Any, path: Path, crop: Box | None, target: Any, degrees: bool, scale: float | None) -> Raster:
    """Resample the picture, bilinearly, to a north-up grid of the coordinate system ``target``; void around it."""
    from rasterio.errors import CRSError
    from rasterio.transform import from_origin
    from rasterio.warp import Resampling, reproject

    check_nodes(dataset.width * dataset.height, str(path))
    try:
        (west, south, east, north), (step_north, step_east) = _grid_around(dataset, target, degrees)
    except CRSError as error:
        raise TerrainError(f"{path}: its coordinate system cannot be brought to degrees ({_line(error)})") from None
    extents = ((north - south) / step_north, (east - west) / step_east)
    if not all(1.0 <= extent <= MOST_NODES for extent in extents):
        raise TerrainError(
            f"{path}: its transform {tuple(dataset.transform)[:6]} places its pixels nowhere on the ground"
        )
    rows, columns = (math.ceil(extent - 1e-6) for extent in extents)
    check_nodes(rows * columns, str(path))
    z = np.full((rows, columns), np.nan)
    reproject(
        _heights(dataset, None, scale),
        z,
        src_transform=dataset.transform,
        src_crs=dataset.crs,
        src_nodata=np.nan,
        dst_transform=from_origin(west, north, step_east, step_north),
        dst_crs=target,
        dst_nodata=np.nan,
        resampling=Resampling.bilinear,
    )
    unit = 1.0 if degrees else dataset.crs.linear_units_factor[1]
    south, west = north - (rows - 0.5) * step_north, west + 0.5 * step_east  # centre of the south-west pixel
    latitude = south + 0.5 * (rows - 1) * step_north if degrees else None
    raster = Raster(
        path.stem, z[::-1], step_north * unit, step_east * unit, latitude, south=south * unit, west=west * unit
    )
    return cropped(raster, crop)


def _grid_around(dataset: Any, target: Any, degrees: bool) -> tuple[Box, tuple[float, float]]:
    """Box around a picture in the coordinates of ``target``, and steps (north, east): those that a pixel at the
    picture's centre has on the ground.
    """
    from rasterio.warp import transform

    share = np.linspace(0.0, 1.0, 21)  # along each border, which may be curved
    zero, one = np.zeros_like(share), np.ones_like(share)
    columns = np.concatenate((share, share, zero, one, (0.5, 0.5 + 1.0 / dataset.width, 0.5)))
    rows = np.concatenate((zero, one, share, share, (0.5, 0.5, 0.5 + 1.0 / dataset.height)))
    x, y = _placed(dataset, columns, rows)
    east, north = np.array(transform(dataset.crs, target, list(x), list(y)), dtype=float)
    to_north, to_east = metres_per_degree(north[-3]) if degrees else (1.0, 1.0)
    right = (to_east * (east[-2] - east[-3]), to_north * (north[-2] - north[-3]))
    down = (to_east * (east[-1] - east[-3]), to_north * (north[-1] - north[-3]))
    step = math.sqrt(abs(right[0] * down[1] - right[1] * down[0]))
    return (east.min(), north.min(), east.max(), north.max()), (step / to_north, step / to_east)


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
