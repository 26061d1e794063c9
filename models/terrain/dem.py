"""Digital elevation models: files in, height fields out.

A map file is an ``.npz`` with ``z`` (rows, cols) [m], row 0 south, column 0 west, and ``meta``, a JSON object with
``spacing_m`` and, if known, ``name``, ``source`` and ``licence``. Everything else is brought into that form once:

- 16-bit PNG: row 0 is north; the caller says the spacing [m] and the scale [m per unit].
- SRTM ``.hgt``: big-endian int16 [m], 1201 or 3601 nodes each way over one degree, row 0 north, void -32768. The name,
  N42E080.hgt for one, states the south-west corner.
- GeoTIFF: one band [m]; in degrees, or projected in metres. With rasterio (the extra ``dem``) any that it reads,
  without it those that pillow decodes, placed by a pixel scale.

Nodes a fixed angle apart are not a fixed distance apart. They are resampled bilinearly onto a square grid of local
equirectangular metres: east and north as on the WGS84 ellipsoid at the latitude of the centre. Over one degree the
true distance east differs from that by less than 1 % at 45 degrees of latitude, 2 % at 60.
"""

from __future__ import annotations

import importlib.util
import io
import json
import math
import re
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates

from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.interfaces.bounds import Positive, configuration
from mathnavi.sim.interfaces.checks import check_spares
from mathnavi.sim.interfaces.errors import TerrainError
from mathnavi.sim.interfaces.reading import arrays as reading
from mathnavi.sim.interfaces.reading.files import decoded
from mathnavi.sim.interfaces.reading.pictures import read_picture
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.interfaces.writing import write_bytes

HGT_NODES = (1201, 3601)
HGT_VOID = -32768
MOST_NODES = 25_000_000  # of a map

WGS84_RADIUS = 6378137.0  # [m] equatorial
WGS84_ECCENTRICITY_SQUARED = 0.00669437999014

# TIFF tags and GeoTIFF keys (OGC 19-008r4)
TIFF_SAMPLES_PER_PIXEL = 277
TIFF_PIXEL_SCALE = 33550
TIFF_GEO_KEYS = 34735
TIFF_TIE_POINT = 33922
TIFF_NODATA = 42113
KEY_MODEL_TYPE = 1024
KEY_LINEAR_UNIT = 3076
MODEL_PROJECTED, MODEL_GEOGRAPHIC = 1, 2
UNIT_METRE = 9001


@dataclass(frozen=True, eq=False)
class Raster:
    """Heights as a file states them, voids included."""

    name: str
    z: Array  # (rows, cols) [m], row 0 south, column 0 west; NaN where void
    step_north: float  # between rows, [m], or [degrees] if there is a latitude
    step_east: float  # between columns
    latitude: float | None = None  # [degrees] of the centre, if the steps are angles
    source: str = ""
    licence: str = ""


@configuration
class MapDocument:
    """The JSON object ``meta`` of a map file."""

    spacing_m: Positive
    name: str | None = None  # that of the file if there is none
    source: str = ""
    licence: str = ""


def metres_per_degree(latitude: float) -> tuple[float, float]:
    """Lengths (north, east) [m] of one degree of latitude and of longitude on the WGS84 ellipsoid at ``latitude``
    [degrees].
    """
    sine, cosine = math.sin(math.radians(latitude)), math.cos(math.radians(latitude))
    w = math.sqrt(1.0 - WGS84_ECCENTRICITY_SQUARED * sine**2)
    north = WGS84_RADIUS * (1.0 - WGS84_ECCENTRICITY_SQUARED) / w**3  # radius of curvature of the meridian
    east = WGS84_RADIUS / w * cosine
    return math.radians(north), math.radians(east)


def square_grid(raster: Raster, spacing: float | None = None) -> Raster:
    """Resample ``raster`` to metres with equal steps ``spacing`` [m] both ways; without one, the steps north are kept.

    Bilinear from the south-west node on, so the result ends less than one step short of the north and east borders. A
    node next to a void is void. Raises TerrainError for a spacing that leaves fewer than 2 x 2 nodes.
    """
    to_north, to_east = (1.0, 1.0) if raster.latitude is None else metres_per_degree(raster.latitude)
    step_north, step_east = raster.step_north * to_north, raster.step_east * to_east
    spacing = step_north if spacing is None else _positive("spacing", spacing, "m")
    if max(abs(step_north - spacing), abs(step_east - spacing)) <= 1e-9 * spacing:
        return replace(raster, step_north=spacing, step_east=spacing, latitude=None)
    extents = [(count - 1) * step for count, step in zip(raster.z.shape, (step_north, step_east), strict=True)]
    if max(extents) > MOST_NODES * spacing:
        raise TerrainError(f"{raster.name}: spacing is {spacing} m; allowed: at most {MOST_NODES} nodes")
    # Rounding must not cost the last row where the steps divide the side.
    rows, columns = (math.floor(extent / spacing + 1e-9) + 1 for extent in extents)
    if min(rows, columns) < 2:
        raise TerrainError(
            f"{raster.name}: spacing is {spacing} m, which leaves {rows} x {columns} nodes; allowed: at least 2 x 2"
        )
    check_nodes(rows * columns, f"{raster.name}: spacing is {spacing} m")
    row = np.minimum(np.arange(rows) * (spacing / step_north), raster.z.shape[0] - 1)
    column = np.minimum(np.arange(columns) * (spacing / step_east), raster.z.shape[1] - 1)
    z = map_coordinates(raster.z, np.meshgrid(row, column, indexing="ij"), order=1, mode="nearest")
    return replace(raster, z=z, step_north=spacing, step_east=spacing, latitude=None)


def height_field(raster: Raster) -> HeightField:
    """Height field of a square grid in metres.

    Raises TerrainError if it still has voids.
    """
    void = np.isnan(raster.z)
    if void.any():
        row, column = np.argwhere(void)[0]
        raise TerrainError(
            f"{raster.name}: {np.count_nonzero(void)} heights are void or NaN, the first at row {row} from the south, "
            f"column {column} from the west; crop them away or fill them"
        )
    return HeightField(raster.z, raster.step_north, raster.name, raster.source, raster.licence)


def read_npz(path: str | Path) -> HeightField:
    """Read the map in an ``.npz`` file.

    Raises TerrainError for a file that is malformed, FileNotFoundError for none.
    """
    path = _existing(path)
    entries = reading.read_npz(path, TerrainError, kinds=reading.NUMBERS_AND_TEXTS, names=("z", "meta"))
    for name in ("z", "meta"):
        if name not in entries:
            raise TerrainError(
                f"{path}: {name} is missing; a map has z (rows, cols) [m] and meta (JSON with spacing_m)"
            )
    z = entries["z"]
    if z.dtype.kind not in "fiu":
        raise TerrainError(f"{path}: z has the type {z.dtype}; allowed: real numbers, float32 as a rule")
    check_nodes(z.size, str(path))
    meta: MapDocument = decoded(_text(entries["meta"], path), MapDocument, f"{path}: meta", TerrainError)
    try:
        return HeightField(z, meta.spacing_m, path.stem if meta.name is None else meta.name, meta.source, meta.licence)
    except ValueError as error:
        raise TerrainError(f"{path}: {error}") from None


def _text(entry: Array, path: Path) -> str:
    try:
        return str(entry)
    except ValueError as error:  # a number that is no character
        raise TerrainError(f"{path}: meta is no text ({error})") from None


def check_nodes(count: int, where: str) -> None:
    """Raise TerrainError for more nodes than a map may have."""
    if count > MOST_NODES:
        raise TerrainError(f"{where}: {count} nodes; allowed: at most {MOST_NODES}, coarser or cropped")


def write_npz(terrain: HeightField, path: str | Path) -> None:
    """Write ``terrain`` as an ``.npz`` file, heights in float32; a file appears only when it is whole."""
    path = Path(path)
    if path.suffix != ".npz":
        raise TerrainError(f"{path}: a map is written as .npz")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: the folder {path.parent} does not exist")
    meta = {
        "spacing_m": terrain.spacing,
        "name": terrain.name,
        "source": terrain.source,
        "licence": terrain.licence,
    }
    block = io.BytesIO()
    np.savez_compressed(block, z=terrain.z.astype(np.float32), meta=np.array(json.dumps(meta)))
    write_bytes(path, block.getvalue())


def read_png(path: str | Path, spacing: float, scale: float) -> Raster:
    """Read a 16-bit grey picture: nodes ``spacing`` [m] apart, ``scale`` [m] per unit; row 0 is north."""
    path = _existing(path)
    spacing, scale = _positive("spacing", spacing, "m"), _positive("scale", scale, "m per unit")
    image, values = read_picture(path, TerrainError)
    if image.mode not in ("I;16", "I;16B", "I;16L"):
        raise TerrainError(f"{path}: the picture has the mode {image.mode}; allowed: 16-bit grey (I;16)")
    return Raster(path.stem, scale * values[::-1], spacing, spacing)


def read_hgt(path: str | Path) -> Raster:
    """Read an SRTM tile; its name states the south-west corner."""
    path = _existing(path)
    corner = re.fullmatch(r"([NS])(\d{2})([EW])(\d{3})", path.stem, re.IGNORECASE)
    if corner is None:
        raise TerrainError(f"{path}: the name must state the south-west corner, as N42E080.hgt does")
    size = path.stat().st_size
    nodes = next((count for count in HGT_NODES if 2 * count**2 == size), None)
    if nodes is None:
        allowed = " or ".join(f"{2 * count**2} ({count} x {count})" for count in HGT_NODES)
        raise TerrainError(f"{path}: {size} bytes are not a whole square tile; allowed: {allowed}")
    values = reading.read_raw(path, ">i2", (nodes, nodes), TerrainError)
    z = np.where(values == HGT_VOID, np.nan, values.astype(np.float64))[::-1]
    latitude = int(corner[2]) * (1 if corner[1].upper() == "N" else -1) + 0.5
    step = 1.0 / (nodes - 1)
    return Raster(path.stem, z, step, step, latitude, source="SRTM")


def read_geotiff(path: str | Path) -> Raster:
    """Read a GeoTIFF with one band of heights in metres."""
    path = _existing(path)
    if importlib.util.find_spec("rasterio") is not None:
        return _read_with_rasterio(path)
    return _read_with_pillow(path)


def import_dem(
    path: str | Path,
    out: str | Path,
    spacing: float | None = None,
    scale: float | None = None,
    crop: tuple[int, int, int] | None = None,
) -> HeightField:
    """Read the elevation model ``path``, write it as the map ``out`` (``.npz``) and return what was written.

    ``spacing`` [m]: between the nodes of the result; a PNG does not say its own, so there it is needed and states it.
    ``scale`` [m per unit]: for a PNG, where it is needed, and for a GeoTIFF whose unit is not the metre.
    ``crop`` (row, column, size): keep size x size nodes of the result, from ``row`` of the south and ``column`` of the
    west on; voids outside do no harm.
    """
    path = _existing(path)
    check_spares(out, [path])
    suffix = path.suffix.lower()
    if suffix == ".png":
        if spacing is None or scale is None:
            raise TerrainError(f"{path}: a PNG needs both spacing [m] and scale [m per unit], it states neither")
        raster = read_png(path, spacing, scale)
    elif suffix == ".hgt":
        if scale is not None:
            raise TerrainError(f"{path}: scale is {scale}; an .hgt file is in metres and takes none")
        raster = read_hgt(path)
    elif suffix in (".tif", ".tiff"):
        raster = read_geotiff(path)
        raster = replace(raster, z=raster.z * (1.0 if scale is None else _positive("scale", scale, "m per unit")))
    elif suffix == ".npz":
        if scale is not None:
            raise TerrainError(f"{path}: scale is {scale}; an .npz map is in metres and takes none")
        terrain = read_npz(path)
        raster = Raster(
            terrain.name, terrain.z, terrain.spacing, terrain.spacing, source=terrain.source, licence=terrain.licence
        )
    else:
        raise TerrainError(f"{path}: the ending {suffix!r} is not known; allowed: .png, .hgt, .tif, .tiff, .npz")
    raster = square_grid(raster, spacing)
    if crop is not None:
        raster = replace(raster, z=_cropped(raster, crop))
    write_npz(height_field(raster), out)
    return read_npz(out)


def _cropped(raster: Raster, crop: tuple[int, int, int]) -> Array:
    row, column, size = crop
    rows, columns = raster.z.shape
    if size < 2 or row < 0 or column < 0 or row + size > rows or column + size > columns:
        raise TerrainError(
            f"{raster.name}: crop (row {row}, column {column}, size {size}) is not within {rows} rows and "
            f"{columns} columns; allowed sizes are 2 to {min(rows, columns)}"
        )
    return raster.z[row : row + size, column : column + size]


def _read_with_rasterio(path: Path) -> Raster:
    import rasterio

    try:
        # It warns of a missing place, which is an error below.
        with warnings.catch_warnings(action="ignore"), rasterio.open(path, driver="GTiff") as dataset:
            check_nodes(dataset.width * dataset.height, str(path))
            bands, transform, crs = dataset.count, dataset.transform, dataset.crs
            values = dataset.read(1, masked=True)
    except rasterio.errors.RasterioError as error:
        raise TerrainError(f"{path}: not a readable GeoTIFF ({error})") from None
    if bands != 1:
        raise TerrainError(f"{path}: {bands} bands; allowed: one, the heights")
    if crs is None:
        raise TerrainError(f"{path}: no coordinate system; allowed: degrees (geographic) and metres (projected)")
    if transform.b or transform.d or transform.e >= 0.0:
        raise TerrainError(f"{path}: the picture is rotated or its row 0 is not north; bring it north-up with gdalwarp")
    if not crs.is_geographic and crs.linear_units_factor[1] != 1.0:
        raise TerrainError(f"{path}: projected in {crs.linear_units}; allowed: metres, re-projected with gdalwarp")
    z = np.ma.filled(values.astype(np.float64), np.nan)[::-1]
    latitude = transform.f + 0.5 * z.shape[0] * transform.e if crs.is_geographic else None
    return Raster(path.stem, z, -transform.e, transform.a, latitude)


def _read_with_pillow(path: Path) -> Raster:
    advice = "install the extra: pip install -e '.[dem]', or convert the file with gdal_translate"
    try:
        image, values = read_picture(path, TerrainError)
    except ValueError as error:
        raise TerrainError(f"{error}; rasterio may: {advice}") from None
    if not image.mode.startswith(("I", "F")):
        raise TerrainError(f"{path}: the picture has the mode {image.mode}; allowed: one band of heights")
    tags: dict[int, Any] = dict(image.getexif())
    if tags.get(TIFF_SAMPLES_PER_PIXEL, 1) != 1:
        raise TerrainError(f"{path}: {tags[TIFF_SAMPLES_PER_PIXEL]} bands; allowed: one, the heights")
    if TIFF_PIXEL_SCALE not in tags or TIFF_TIE_POINT not in tags or TIFF_GEO_KEYS not in tags:
        raise TerrainError(f"{path}: no pixel scale, tie point and coordinate system that pillow could read; {advice}")
    # A header of 4 numbers, then 4 for each key: (key, where it is stored, count, value).
    directory = np.asarray(tags[TIFF_GEO_KEYS], dtype=np.int64)[4:].reshape(-1, 4)
    keys = {int(key): int(value) for key, _, _, value in directory}
    model = keys.get(KEY_MODEL_TYPE)
    if model not in (MODEL_PROJECTED, MODEL_GEOGRAPHIC):
        raise TerrainError(f"{path}: model type {model}; allowed: 1 (projected) and 2 (geographic)")
    unit = keys.get(KEY_LINEAR_UNIT)
    if model == MODEL_PROJECTED and unit != UNIT_METRE:
        raise TerrainError(f"{path}: projected in the unit {unit}; allowed: {UNIT_METRE}, metres; {advice}")
    if TIFF_NODATA in tags:
        text = str(tags[TIFF_NODATA]).strip("\0 ")
        try:
            nodata = float(text)
        except ValueError:
            raise TerrainError(f"{path}: the no-data value is {text!r}; allowed: a number") from None
        values = np.where(values == nodata, np.nan, values)
    step_east, step_north = (float(step) for step in tags[TIFF_PIXEL_SCALE][:2])
    tie_row, tie_north = float(tags[TIFF_TIE_POINT][1]), float(tags[TIFF_TIE_POINT][4])
    centre = tie_north + (tie_row - 0.5 * values.shape[0]) * step_north
    return Raster(
        path.stem,
        values[::-1],
        _positive("the pixel scale north", step_north, "m or degrees"),
        _positive("the pixel scale east", step_east, "m or degrees"),
        centre if model == MODEL_GEOGRAPHIC else None,
    )


def _existing(path: str | Path) -> Path:
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path}: no such file")
    return path


def _positive(name: str, value: float, unit: str) -> float:
    if not (math.isfinite(value) and value > 0.0):
        raise TerrainError(f"{name} is {value} {unit}; allowed: a finite number above 0")
    return float(value)
