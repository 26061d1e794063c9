"""Terrains by name. A terrain is an entry point of the group ``mathnavi.terrains``: a function without arguments that
returns a ``HeightField``, or a function of a whole number: ``NAME:3`` calls it with 3, ``NAME`` with its default. The
terrains of this project are registered like those of other packages.
"""

from __future__ import annotations

from functools import cache
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from inspect import signature
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.entry_points import entry_points_of, named
from mathnavi.interfaces.errors import TerrainError
from mathnavi.interfaces.failures import failures_named
from mathnavi.interfaces.input_files import InputFile, PluginName
from mathnavi.interfaces.reading.arrays import read_npz as read_npz_arrays
from mathnavi.interfaces.reading.files import read_json
from mathnavi.models.terrain.dem import read_npz, read_png
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.raster import Raster
from mathnavi.models.terrain.resampling import square_grid

GROUP = "mathnavi.terrains"
DATA = Path(__file__).parent / "data"
_DIGITS = 9  # of a terrain's number


@cache
def tian_shan() -> HeightField:
    """The Tian Shan around Jengish Chokusu: 257 x 257 nodes at 320 m, 1805 to 6971 m (data/SOURCES.md)."""
    meta = read_json(DATA / "tian_shan.json", dict[str, Any], TerrainError)
    raster = read_png(DATA / "tian_shan.png", meta["spacing_m"], meta["scale_m"])
    return HeightField(raster.z, raster.step_north, raster.name, meta["source"], meta["licence"])


@cache
def jacksboro() -> HeightField:
    """The Jacksboro fault in Tennessee: 30 km by 32 km of low ridges at 90 m (data/SOURCES.md).

    The map is the ground: what it lost when it was brought from 3 arc-seconds to 90 m is no part of it.
    """
    package = find_spec("matplotlib")  # only its folder: the package itself takes long to import
    assert package is not None
    assert package.origin is not None
    folder = Path(package.origin).parent / "mpl-data" / "sample_data"
    sample = read_npz_arrays(folder / "jacksboro_fault_dem.npz", TerrainError)
    z = sample["elevation"][::-1].astype(np.float64)  # the file's row 0 is north, and it calls that side ymin
    latitude = 0.5 * (float(sample["ymin"]) + float(sample["ymax"]))
    degrees_north, degrees_east = float(sample["dy"]), float(sample["dx"])
    source = "Shuttle Radar Topography Mission (NASA, NGA), 3 arc-seconds, from matplotlib's jacksboro_fault_dem.npz"
    licence = "public domain"
    raster = Raster("jacksboro", z, degrees_north, degrees_east, latitude, source, licence)
    grid = square_grid(raster, spacing=90.0)
    return HeightField(grid.z, grid.spacing, raster.name, source, licence)


def terrain_names() -> tuple[str, ...]:
    """Names of the installed terrains, sorted."""
    return tuple(sorted({point.name for point in _installed()}))


def load_terrain(name_or_path: str | Path) -> HeightField:
    """Load a terrain by its name, or name and number, or the map in an ``.npz`` file; each is loaded once.

    Raises TerrainError for a name or a number that is not known, PluginError for a name that several plug-ins have,
    FileNotFoundError for a file that does not exist.
    """
    name, _, number = str(name_or_path).partition(":")
    if isinstance(name_or_path, str) and (point := named(_installed(), "terrain", name)):
        return _load(point, number)
    path = Path(name_or_path)
    if path.suffix == ".npz":
        return _read(path.resolve(), path.stat().st_mtime_ns) if path.is_file() else read_npz(path)
    how = ", which mathnavi terrain import makes of a .tif, .hgt or .png"
    raise TerrainError(
        f"terrain = {str(name_or_path)!r}: not known; {allowed_for(name, terrain_names(), f'or an .npz{how}')}"
    )


def place_of(name_or_path: str) -> str:
    """Name or path that loads the same terrain from any folder: a name stays, a path becomes absolute."""
    installed = name_or_path.partition(":")[0] in terrain_names()
    return name_or_path if installed else str(Path(name_or_path).resolve())


def heights_digest(name_or_path: str) -> str:
    """Digest of the heights of a terrain; errors as of ``load_terrain``."""
    return load_terrain(name_or_path).digest


def maker_of(name_or_path: str) -> Any:
    """Return the function that makes the terrain with a name; None for the map in a file."""
    point = named(_installed(), "terrain", name_or_path.partition(":")[0])
    return None if point is None else point.load()


TerrainPlace = Annotated[str, InputFile(heights_digest), PluginName(maker_of)]
"""type of a field that names a terrain, or an .npz file: its heights are part of the key of the runs over it"""


def _installed() -> list[EntryPoint]:
    return entry_points_of(GROUP)


@cache
def _load(point: EntryPoint, number: str) -> HeightField:
    subject = f"terrain {point.name!r}: {point.value}"
    with failures_named(f"{subject} cannot be imported:", TerrainError):
        made = point.load()
    if not callable(made):
        raise TerrainError(f"{subject} is a {type(made).__name__}; allowed: a function that returns a HeightField")
    if number and not (
        number.isdecimal() and number.isascii() and len(number) <= _DIGITS and signature(made).parameters
    ):
        raise TerrainError(
            f"terrain '{point.name}:{number}': allowed: a whole number of at most {_DIGITS} digits after a terrain "
            "that is made from one, as canyon:3"
        )
    try:
        with failures_named("failed:", TerrainError):
            terrain = made(int(number)) if number else made()
    except ValueError as error:  # a refusal too, which need not name the terrain
        raise TerrainError(f"{subject} {error}") from error
    if not isinstance(terrain, HeightField):
        raise TerrainError(f"{subject} returned {type(terrain).__name__}, not a HeightField")
    return terrain


@cache
def _read(path: Path, _modified: int) -> HeightField:
    """Read a map file; the time of its last change is part of the key, so that a changed file is read again."""
    return read_npz(path)
