"""Map files and grey pictures: reads them, writes maps.

A map file is an ``.npz`` with ``z`` (rows, cols) [m], row 0 south, column 0 west, ``above`` (rows - 1, cols - 1, 2) [m]
if the ground that it was made from may rise above its triangles, and ``meta``, a JSON object with ``spacing_m`` and, if
known, ``name``, ``source``, ``licence`` and ``datum``. A 16-bit PNG has row 0 north; the caller states the spacing [m]
and the scale [m per unit]. Other files are converted to a map once (``dem_import``).
"""

from __future__ import annotations

import io
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.errors import TerrainError
from mathnavi.interfaces.reading import arrays as reading
from mathnavi.interfaces.reading.files import decoded
from mathnavi.interfaces.signals import Array
from mathnavi.interfaces.writing import write_bytes
from mathnavi.models.terrain.height_field import HIGHEST, HeightField
from mathnavi.models.terrain.raster import Raster

MOST_NODES = 25_000_000  # of a map


@configuration
class MapDocument:
    """The JSON object ``meta`` of a map file."""

    spacing_m: Positive
    name: str | None = None  # the name of the file if not given
    source: str = ""
    licence: str = ""
    datum: str = ""


def read_npz(path: str | Path) -> HeightField:
    """Read the map in an ``.npz`` file.

    Raises TerrainError for a file that is malformed, FileNotFoundError for a file that does not exist.
    """
    path = existing(path)
    entries = reading.read_npz(path, TerrainError, kinds=reading.NUMBERS_AND_TEXTS, names=("z", "above", "meta"))
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
    above = entries.get("above")
    if above is not None and above.dtype.kind not in "fiu":
        raise TerrainError(f"{path}: above has the type {above.dtype}; allowed: real numbers, float32 as a rule")
    name = path.stem if meta.name is None else meta.name
    try:
        return HeightField(z, meta.spacing_m, name, meta.source, meta.licence, above, meta.datum)
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
        "datum": terrain.datum,
    }
    arrays: dict[str, Any] = {"z": terrain.z.astype(np.float32)}
    if terrain.above is not None:
        arrays["above"] = terrain.above
    block = io.BytesIO()
    np.savez_compressed(block, **arrays, meta=np.array(json.dumps(meta)))
    write_bytes(path, block.getvalue())


def read_png(path: str | Path, spacing: float, scale: float, nodata: float | None = None) -> Raster:
    """Read a 16-bit grey picture: nodes ``spacing`` [m] apart, ``scale`` [m] per unit; row 0 is north.

    Pixels of the value ``nodata``, and of that which the picture states to be transparent, are voids.
    """
    path = existing(path)
    spacing, scale = positive("spacing", spacing, "m"), checked_scale(scale)
    from mathnavi.interfaces.reading.pictures import read_picture  # pillow takes a while to import

    image, values = read_picture(path, TerrainError)
    if image.mode not in ("I;16", "I;16B", "I;16L"):
        raise TerrainError(f"{path}: the picture has the mode {image.mode}; allowed: 16-bit grey (I;16)")
    z = np.where((values == nodata) | (values == image.info.get("transparency")), np.nan, scale * values)
    return Raster(path.stem, z[::-1], spacing, spacing)


def existing(path: str | Path) -> Path:
    """Return the path of an existing file; FileNotFoundError otherwise."""
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path}: no such file")
    return path


def checked_scale(scale: float) -> float:
    """Return the height [m] of one unit; TerrainError unless it is above 0 and at most ``HIGHEST``."""
    if not 0.0 < scale <= HIGHEST:
        raise TerrainError(f"scale is {scale} m per unit; allowed: a number above 0, at most {HIGHEST:g}")
    return float(scale)


def positive(name: str, value: float, unit: str) -> float:
    """Return the value as a float; TerrainError unless it is finite and above 0."""
    if not (math.isfinite(value) and value > 0.0):
        raise TerrainError(f"{name} is {value} {unit}; allowed: a finite number above 0")
    return float(value)
