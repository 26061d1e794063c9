"""Maps of buildings in files: walls as rings in JSON, a folder of ``mathnavi map import``, or a map of ROS.

::

    {"name": "office", "rings": [[[0, 0], [6, 0], [6, 4], [0, 4]], [[1, 1], [2, 1], [2, 2]]]}

are the corners x, y [m] of the outer ring, and of holes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.input_files import InputFile, content_digest, digest_of
from mathnavi.interfaces.reading.files import MEBIBYTE, read_bytes, read_json
from mathnavi.models.field.polygon import Polygon
from mathnavi.models.field.ros_map import picture_of, read_ros_map
from mathnavi.models.field.tracing import traced

WALLS = "walls.json"
"""file of a folder that has the rings"""
_ROS = (".yaml", ".yml")


@dataclass(frozen=True)
class WallsDocument:
    """Content of a file of walls."""

    rings: tuple[tuple[tuple[float, float], ...], ...]  # [m] the outer one first
    name: str = ""
    about: dict[str, Any] = field(default_factory=dict)  # what the map is of, and how it was made


def load_map(place: str | Path) -> Polygon:
    """Load the walls of a map: a folder or a .json file with rings, or a map.yaml of ROS, traced to a cell.

    Raises FieldError for a file that is no map, ArgumentError for rings that are no wall, FileNotFoundError.
    """
    path = Path(place)
    if path.is_dir():
        path /= WALLS
    if not path.is_file():
        raise FileNotFoundError(f"{path}: no such file; allowed: a map in .json or .yaml, or a folder of map import")
    stamps = tuple(each.stat().st_mtime_ns for each in _files(path))
    return _load(path.resolve(), stamps)


def map_digest(place: str) -> str:
    """Digest of the files of a map; errors as of ``load_map``."""
    path = Path(place)
    if path.is_dir():
        path /= WALLS
    if path.suffix in _ROS and path.is_file():
        return digest_of({each.name: read_bytes(each, FieldError, 64 * MEBIBYTE) for each in _files(path)})
    return content_digest(path)


MapPlace = Annotated[str, InputFile(map_digest)]
"""type of a field that names the map of a building"""


def _files(path: Path) -> list[Path]:
    return [path, picture_of(path)] if path.suffix in _ROS else [path]


@lru_cache(maxsize=8)
def _load(path: Path, stamps: tuple[int, ...]) -> Polygon:
    if path.suffix in _ROS:
        return traced(read_ros_map(path)).walls
    if path.suffix != ".json":
        raise FieldError(f"{path}: no map; allowed: a .json file with rings, a .yaml file of ROS, or a folder")
    document = read_json(path, WallsDocument, FieldError, closed=True)
    return Polygon(document.rings, document.name or path.stem)
