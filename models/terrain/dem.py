"""Digital elevation models: reads files, makes height fields.

A map file is an ``.npz`` with ``z`` (rows, cols) [m], row 0 south, column 0 west, and ``meta``, a JSON object with
``spacing_m`` and, if known, ``name``, ``source`` and ``licence``. Other files are converted to that form once:

- 16-bit PNG: row 0 is north; the caller states the spacing [m] and the scale [m per unit].
- SRTM ``.hgt``: big-endian int16 [m], 1201 or 3601 nodes each way over one degree, row 0 north, void -32768. The name,
  for instance N42E080.hgt, states the south-west corner.
- GeoTIFF: see ``dem_import``.

Nodes a fixed angle apart are not a fixed distance apart. They are resampled bilinearly onto a square grid of local
equirectangular metres: east and north as on the WGS84 ellipsoid at the latitude of the centre. Over one degree the
true distance east differs from that by less than 1 % at 45 degrees of latitude, 2 % at 60.
"""

from __future__ import annotations

import io
import json
import math
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.errors import TerrainError
from mathnavi.interfaces.reading import arrays as reading
from mathnavi.interfaces.reading.files import decoded
from mathnavi.interfaces.signals import Array
from mathnavi.interfaces.writing import write_bytes
from mathnavi.models.terrain.height_field import HeightField

HGT_NODES = (1201, 3601)
HGT_VOID = -32768
MOST_NODES = 25_000_000  # of a map

WGS84_RADIUS = 6378137.0  # [m] equatorial
WGS84_ECCENTRICITY_SQUARED = 0.00669437999014

Box = tuple[float, float, float, float]  # west, south, east, north


@dataclass(frozen=True, eq=False)
class Raster:
    """Heights of a file, voids included."""

    name: str
    z: Array  # (rows, cols) [m], row 0 south, column 0 west; NaN where void
    step_north: float  # between rows, [m], or [degrees] if there is a latitude
    step_east: float  # between columns
    latitude: float | None = None  # [degrees] of the centre, if the steps are angles
    source: str = ""
    licence: str = ""
    south: float = 0.0  # coordinates of the south-west node, in the unit of the steps
    west: float = 0.0

    @property
    def reach(self) -> str:
        """Text of the west, south, east and north borders, in the unit of the steps."""
        rows, columns = self.z.shape
        north, east = self.south + (rows - 1) * self.step_north, self.west + (columns - 1) * self.step_east
        return f"west {self.west:.10g}, south {self.south:.10g} to east {east:.10g}, north {north:.10g}"


@configuration
class MapDocument:
    """The JSON object ``meta`` of a map file."""

    spacing_m: Positive
    name: str | None = None  # the name of the file if not given
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


def within(
    crop: Box, shape: tuple[int, int], corner: tuple[float, float], steps: tuple[float, float], name: str
) -> tuple[slice, slice]:
    """Rows and columns of the nodes within ``crop``, of a grid of ``shape`` whose south-west node is at ``corner``
    (south, west), with ``steps`` (north, east), all in one unit.

    Raises TerrainError for a box that is not within the grid, or has fewer than 2 x 2 nodes.
    """
    west, south, east, north = crop
    parts = []
    for first, last, origin, step, count in zip(
        (south, west), (north, east), corner, steps, shape, strict=True
    ):  # half a step outside still belongs to the outermost node
        low, high = (first - origin) / step, (last - origin) / step
        if not (-0.5 - 1e-6 <= low < high <= count - 0.5 + 1e-6):
            box = (corner[1], corner[0], corner[1] + (shape[1] - 1) * steps[1], corner[0] + (shape[0] - 1) * steps[0])
            raise TerrainError(
                f"crop = {_numbers(crop)}: west, south, east, north of a part of {name}; "
                f"allowed: within {_numbers(box)}"
            )
        parts.append(slice(max(0, math.ceil(low - 1e-6)), min(count - 1, math.floor(high + 1e-6)) + 1))
    rows, columns = parts
    counts = [part.stop - part.start for part in parts]
    if min(counts) < 2:
        raise TerrainError(
            f"crop = {_numbers(crop)}: {counts[0]} x {counts[1]} nodes of {name}; allowed: at least 2 x 2"
        )
    return rows, columns


def cropped(raster: Raster, crop: Box | None) -> Raster:
    """Keep the part of ``raster`` within ``crop``, in the unit of its steps; all of it if None."""
    if crop is None:
        return raster
    corner, steps = (raster.south, raster.west), (raster.step_north, raster.step_east)
    rows, columns = within(crop, raster.z.shape, corner, steps, raster.name)
    south = raster.south + rows.start * raster.step_north
    z = raster.z[rows, columns]
    return replace(
        raster,
        z=z,
        south=south,
        west=raster.west + columns.start * raster.step_east,
        latitude=None if raster.latitude is None else south + 0.5 * (z.shape[0] - 1) * raster.step_north,
    )


def _numbers(box: Box) -> str:
    return " ".join(f"{value:.10g}" for value in box)


def square_grid(raster: Raster, spacing: float | None = None) -> Raster:
    """Resample ``raster`` to metres with equal steps ``spacing`` [m] both ways; the steps north if None.

    Bilinear from the south-west node on, so the result ends less than one step short of the north and east borders. A
    node next to a void is void. Raises TerrainError for a spacing that leaves fewer than 2 x 2 nodes.
    """
    to_north, to_east = (1.0, 1.0) if raster.latitude is None else metres_per_degree(raster.latitude)
    step_north, step_east = raster.step_north * to_north, raster.step_east * to_east
    spacing = step_north if spacing is None else positive("resample", spacing, "m")
    if max(abs(step_north - spacing), abs(step_east - spacing)) <= 1e-9 * spacing:
        return replace(raster, step_north=spacing, step_east=spacing, latitude=None)
    extents = [(count - 1) * step for count, step in zip(raster.z.shape, (step_north, step_east), strict=True)]
    if max(extents) > MOST_NODES * spacing:
        raise TerrainError(f"resample = {spacing} m; allowed: at most {MOST_NODES} nodes of {raster.name}")
    # Rounding must not cost the last row where the steps divide the side.
    rows, columns = (math.floor(extent / spacing + 1e-9) + 1 for extent in extents)
    if min(rows, columns) < 2:
        raise TerrainError(
            f"resample = {spacing} m leaves {rows} x {columns} nodes of {raster.name}; allowed: at least 2 x 2"
        )
    check_nodes(rows * columns, f"resample = {spacing} m, {raster.name}")
    row = np.minimum(np.arange(rows) * (spacing / step_north), raster.z.shape[0] - 1)
    column = np.minimum(np.arange(columns) * (spacing / step_east), raster.z.shape[1] - 1)
    z = _bilinear(raster.z, row, column)
    return replace(raster, z=z, step_north=spacing, step_east=spacing, latitude=None)


def _bilinear(z: Array, row: Array, column: Array) -> Array:
    """Heights (m, n) [m] at rows (m,) and columns (n,) of a grid, fractions of a cell among them, by its four nodes."""
    i, j = row.astype(int), column.astype(int)
    above, left = 1.0 - (row - i)[:, None], 1.0 - (column - j)  # weights
    below, right = 1.0 - above, 1.0 - left
    k, m = np.minimum(i + 1, len(z) - 1), np.minimum(j + 1, z.shape[1] - 1)
    heights: Array = z[np.ix_(i, j)] * above * left + z[np.ix_(i, m)] * above * right
    heights += z[np.ix_(k, j)] * below * left
    heights += z[np.ix_(k, m)] * below * right
    return heights


def height_field(raster: Raster) -> HeightField:
    """Height field of a square grid in metres.

    Raises TerrainError if it still has voids.
    """
    void = np.isnan(raster.z)
    if void.any():
        row, column = np.argwhere(void)[0]
        raise TerrainError(
            f"{raster.name}: {np.count_nonzero(void)} heights are void or NaN, the first at row {row} from the south, "
            f"column {column} from the west; --crop keeps a part without, --fill fills them"
        )
    return HeightField(raster.z, raster.step_north, raster.name, raster.source, raster.licence)


def read_npz(path: str | Path) -> HeightField:
    """Read the map in an ``.npz`` file.

    Raises TerrainError for a file that is malformed, FileNotFoundError for a file that does not exist.
    """
    path = existing(path)
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
    """Write ``terrain`` as an ``.npz`` file, heights in float32; the file appears only when it is complete."""
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
    path = existing(path)
    spacing, scale = positive("spacing", spacing, "m"), positive("scale", scale, "m per unit")
    from mathnavi.interfaces.reading.pictures import read_picture  # pillow takes a while to import

    image, values = read_picture(path, TerrainError)
    if image.mode not in ("I;16", "I;16B", "I;16L"):
        raise TerrainError(f"{path}: the picture has the mode {image.mode}; allowed: 16-bit grey (I;16)")
    return Raster(path.stem, scale * values[::-1], spacing, spacing)


def read_hgt(path: str | Path) -> Raster:
    """Read an SRTM tile; its name states the south-west corner."""
    path = existing(path)
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
    west = float(corner[4]) * (1 if corner[3].upper() == "E" else -1)
    return Raster(path.stem, z, step, step, latitude, source="SRTM", south=latitude - 0.5, west=west)


def existing(path: str | Path) -> Path:
    """Return the path of an existing file; FileNotFoundError otherwise."""
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path}: no such file")
    return path


def positive(name: str, value: float, unit: str) -> float:
    """Return the value as a float; TerrainError unless it is finite and above 0."""
    if not (math.isfinite(value) and value > 0.0):
        raise TerrainError(f"{name} is {value} {unit}; allowed: a finite number above 0")
    return float(value)
