"""Maps of ROS, as ``map_server`` reads and writes them: a text ``map.yaml`` with a picture in PNG or PGM.

With p the share of black of a pixel, or of white with ``negate``, a cell is occupied where p > occupied_thresh, free
where p < free_thresh and unknown between, or with ``mode: scale`` also where the picture is transparent. With ``mode:
raw`` a pixel is the occupancy itself, 0 to 100 %, and anything above is unknown. Row 0 of a picture is its top.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
from PIL import Image

from mathnavi.interfaces.errors import ArgumentError, FieldError
from mathnavi.interfaces.reading.files import MEBIBYTE, read_text
from mathnavi.interfaces.reading.pictures import read_picture
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.occupancy_grid import FREE, OCCUPIED, UNKNOWN, Cells, OccupancyGrid

MODES = ("trinary", "scale", "raw")
_NEEDED = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
_KNOWN = (*_NEEDED, "mode")
_ENTRY = re.compile(r"([A-Za-z_]\w*)\s*:\s*(.*)")
_SHADES = np.array([254, 0, 205], dtype=np.uint8)  # of the states, as map_saver writes them


def read_ros_map(path: Path) -> OccupancyGrid:
    """Read a map.yaml and its picture. Raises FieldError, which names the file, the entry and its value."""
    entries = _entries(path)
    picture, pixels = read_picture(_picture(path, entries), FieldError, ("PNG", "PPM"))
    resolution, origin = _number(path, entries, "resolution"), _origin(path, entries)
    occupied, free = _number(path, entries, "occupied_thresh"), _number(path, entries, "free_thresh")
    for name, value in (("occupied_thresh", occupied), ("free_thresh", free)):
        if not 0.0 <= value <= 1.0:
            raise FieldError(f"{path}: {name} = {value!r}; allowed: 0 to 1")
    if free > occupied:
        raise FieldError(f"{path}: free_thresh = {free!r} > occupied_thresh = {occupied!r}; allowed: less or as much")
    mode = entries.get("mode", "trinary").strip("\"'")
    if mode not in MODES:
        raise FieldError(f"{path}: mode = {mode!r}; allowed: {', '.join(MODES)}")
    shade, opaque = _shade(picture, pixels)
    if mode == "raw":
        share = shade / 100.0
        cells = np.where(share > 1.0, UNKNOWN, _states(share, occupied, free))
    else:
        cells = _states(shade / 255.0 if _negate(path, entries) else 1.0 - shade / 255.0, occupied, free)
        if mode == "scale":
            cells = np.where(opaque, cells, UNKNOWN)
    try:
        return OccupancyGrid(cells[::-1].astype(np.uint8), resolution, origin, path.stem)
    except ArgumentError as error:
        raise FieldError(f"{path}: {error}") from None


def picture_of(path: Path) -> Path:
    """Picture that a map.yaml names; errors as of ``read_ros_map``."""
    return _picture(path, _entries(path))


def ros_map_files(grid: OccupancyGrid, picture: str) -> tuple[str, Cells]:
    """Text of a map.yaml that names a ``picture``, and its pixels (rows, columns), uint8."""
    pixels = _SHADES[grid.cells]
    lines = (
        f"image: {picture}", f"resolution: {grid.resolution!r}", f"origin: [{', '.join(map(repr, grid.origin))}]",
        "negate: 0", "occupied_thresh: 0.65", "free_thresh: 0.196", "mode: trinary",
    )  # fmt: skip
    return "\n".join(lines) + "\n", pixels[::-1]


def _states(share: Array, occupied: float, free: float) -> Array:
    states: Array = np.where(share > occupied, OCCUPIED, np.where(share < free, FREE, UNKNOWN))
    return states


def _shade(picture: Image.Image, pixels: Array) -> tuple[Array, Array]:
    """Brightness (rows, columns) from 0 to 255, the mean of colours, and where the picture is opaque."""
    most = 65535.0 if picture.mode.startswith("I") else 1.0 if picture.mode == "1" else 255.0
    if picture.mode == "P":
        pixels = np.asarray(picture.convert("RGBA")).astype(np.float64)
    if pixels.ndim == 2:
        return pixels * (255.0 / most), np.ones(pixels.shape, dtype=bool)
    has_alpha = pixels.shape[2] in (2, 4)
    opaque = pixels[..., -1] == 255.0 if has_alpha else np.ones(pixels.shape[:2], dtype=bool)
    return (pixels[..., :-1] if has_alpha else pixels).mean(axis=2), opaque


# ---- the entries: a subset of YAML, one entry a line


def _entries(path: Path) -> dict[str, str]:
    """Entries of a map.yaml, as text."""
    found: dict[str, str] = {}
    for number, line in enumerate(read_text(path, FieldError, MEBIBYTE).splitlines(), start=1):
        text = re.sub(r"(^|\s)#.*", "", line).strip()
        if not text or text == "---":
            continue
        entry = _ENTRY.fullmatch(text)
        if entry is None:
            raise FieldError(f"{path} line {number}: {line!r} is no entry NAME: VALUE of a map of ROS")
        name, value = entry.groups()
        if name not in _KNOWN:
            raise FieldError(f"{path} line {number}: {name} is not known; allowed: {', '.join(_KNOWN)}")
        if name in found:
            raise FieldError(f"{path} line {number}: {name} is there twice; allowed: once")
        found[name] = value.strip()
    for name in _NEEDED:
        if name not in found:
            raise FieldError(f"{path}: {name} is missing; allowed: a map of ROS with {', '.join(_NEEDED)}")
    return found


def _picture(path: Path, entries: dict[str, str]) -> Path:
    name = entries["image"].strip("\"'")
    if Path(name).suffix.lower() not in (".png", ".pgm"):
        raise FieldError(f"{path}: image = {name!r}; allowed: a .png or .pgm file")
    return path.parent / name


def _number(path: Path, entries: dict[str, str], name: str) -> float:
    return _finite(path, name, entries[name])


def _finite(path: Path, name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FieldError(f"{path}: {name} = {text!r}; allowed: a finite number")
    return value


def _origin(path: Path, entries: dict[str, str]) -> tuple[float, float, float]:
    text = entries["origin"]
    words = text.strip("[]").split(",") if text.startswith("[") and text.endswith("]") else []
    if len(words) != 3:
        raise FieldError(f"{path}: origin = {text!r}; allowed: [X, Y, YAW] in m, m, rad")
    x, y, yaw = (_finite(path, "origin", word.strip()) for word in words)
    return x, y, yaw


def _negate(path: Path, entries: dict[str, str]) -> bool:
    text = entries["negate"].lower()
    if text not in ("0", "1", "true", "false"):
        raise FieldError(f"{path}: negate = {entries['negate']!r}; allowed: 0 or 1")
    return text in ("1", "true")
