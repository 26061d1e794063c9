"""``mathnavi map``: make walls of a building from laser scans or from a ROS map, and show the contents of a map."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from PIL import Image

from mathnavi.commands.arguments import FlagGroup, flags, parse, with_flag
from mathnavi.commands.errors import BadInputError, bad_input
from mathnavi.commands.output import output_folder
from mathnavi.commands.wrapping import wrapped
from mathnavi.interfaces.checks import check_spares
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import Positional
from mathnavi.interfaces.writing import write_together
from mathnavi.models.field.map_file import WALLS, load_map
from mathnavi.models.field.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mathnavi.models.field.polygon import Polygon
from mathnavi.models.field.ros_map import read_ros_map, ros_map_files
from mathnavi.models.field.scan_map import grid_of_scans
from mathnavi.models.field.tracing import Traced, traced
from mathnavi.sim.logs.formats import read_log
from mathnavi.sim.logs.recorded_log import RecordedLog

USAGE = """usage: mathnavi map import FILE --out DIR [OPTIONS]
       mathnavi map show FILE|DIR

FILE: a log with laser scans and poses, or a map.yaml of ROS; DIR: a folder that holds walls.json, map.yaml and map.png

mathnavi map import --help lists the options."""
_RESOLUTION, _OCCUPIED, _LEAST = 0.05, 0.25, 2
_POSE = " pose"


@dataclass(frozen=True)
class MapImportOptions:
    """Flags of ``map import``: the scans or the map, and the folder to write."""

    file: Annotated[Path, Positional("FILE")]
    """log with laser scans and their poses, or map.yaml of ROS"""
    out: Path
    """folder to write: walls.json, map.yaml, map.png"""
    deviation: float | None = None
    """largest distance of the cells' border from the walls [m]; a cell's side if not given; 0: not simplified"""
    smallest_hole: float = 0.01
    """area below which a hole is left out [m^2]"""
    unknown_is_free: bool = False
    """whether unknown cells are free; otherwise they are solid"""
    channel: str | None = None
    """channel of the scans, which has another one with their poses; the only one if not given"""
    resolution: float | None = None
    """side of a cell [m] of a grid of scans; 0.05 if not given"""
    range_maximum: float | None = None
    """least range that counts as no echo [m]; the one that the log states, or 80, if not given"""
    occupied: float | None = None
    """least share of the rays into a cell that end there, for it to be occupied; 0.25 if not given"""
    least_rays: int | None = None
    """number of rays below which a cell is unknown; 2 if not given"""
    since: float | None = None
    """time in the log from which scans are used [s]"""
    until: float | None = None
    """time in the log before which scans are used [s]"""


_OF_SCANS = ("channel", "resolution", "range_maximum", "occupied", "least_rays", "since", "until")


@dataclass(frozen=True)
class MapShowOptions:
    """Flags of ``map show``: the map to show."""

    map: Annotated[str, Positional("FILE|DIR")]
    """map: .json with rings, map.yaml of ROS, or folder of map import"""


def main(argv: Sequence[str]) -> int:
    actions = {"import": _import, "show": _show}
    if argv and argv[0] in ("-h", "--help"):
        print(wrapped(USAGE))
        return 0
    if not argv or argv[0] not in actions:
        raise BadInputError(f"map {' '.join(argv[:1])}: not a command; allowed: {', '.join(actions)}")
    actions[argv[0]](argv[1:])
    return 0


def _import(argv: Sequence[str]) -> None:
    (options,) = parse(
        argv, "mathnavi map import", "Write the walls of a building, from scans or a map.", FlagGroup(MapImportOptions)
    )
    try:
        with bad_input():
            files = [options.out / name for name in (WALLS, "map.yaml", "map.png")]
            for path in files:
                check_spares(path, [options.file], "out")
            grid, about = _grid(options)
            found = traced(
                grid, options.deviation, options.smallest_hole, unknown_is_free=options.unknown_is_free
            )  # fmt: skip
            with output_folder(options.out):
                write_together(dict(zip(files, _contents(grid, found, about), strict=True)))
    except BadInputError as error:
        raise BadInputError(with_flag(str(error), [*flags(MapImportOptions)])) from error
    _print(_of_grid(grid, found) | figures(found.walls))
    print(f"{'map':12}{options.out}")


def _show(argv: Sequence[str]) -> None:
    (options,) = parse(argv, "mathnavi map show", "Print the figures of a map.", FlagGroup(MapShowOptions))
    with bad_input():
        walls = load_map(options.map)
    _print(figures(walls))


# ---- the grid


def _grid(options: MapImportOptions) -> tuple[OccupancyGrid, dict[str, object]]:
    """The occupancy grid of a file, and what walls.json says of it."""
    if options.file.suffix in (".yaml", ".yml"):
        for name in _OF_SCANS:
            if (value := getattr(options, name)) is not None:
                raise FieldError(f"{name} = {value!r} with a map of ROS; allowed: with scans")
        return read_ros_map(options.file), {"source": options.file.name}
    log = read_log(options.file)
    scans, longest = _scans(log, options.channel)
    channel, poses = log[scans], log[scans + _POSE]
    first, step = (float(channel.facts[key]) for key in ("first angle [deg]", "step [deg]"))
    used = np.ones(len(channel.t), dtype=bool)
    used &= channel.t >= (-math.inf if options.since is None else options.since)
    used &= channel.t < (math.inf if options.until is None else options.until)
    if not used.any():
        raise FieldError(
            f"since = {options.since!r}, until = {options.until!r}: no scan in between; allowed: times from "
            f"{channel.t.min():.6g} to {channel.t.max():.6g} s"
        )
    grid = grid_of_scans(
        poses.values[used],
        np.radians(first + step * np.arange(channel.values.shape[1])),
        channel.values[used],
        resolution=_RESOLUTION if options.resolution is None else options.resolution,
        longest=longest if options.range_maximum is None else options.range_maximum,
        occupied=_OCCUPIED if options.occupied is None else options.occupied,
        least=_LEAST if options.least_rays is None else options.least_rays,
        name=options.file.name.partition(".")[0],
    )
    return grid, {"source": options.file.name, "channel": scans, "scans": int(used.sum())}


def _scans(log: RecordedLog, wanted: str | None) -> tuple[str, float]:
    """Name of the channel of scans with poses, and the least range [m] that counts as no echo."""
    found = [
        name for name, channel in log.channels.items() if "step [deg]" in channel.facts and name + _POSE in log.channels
    ]
    if wanted is not None and wanted not in found:
        raise FieldError(
            f"channel = {wanted!r}: no scans with poses; allowed: {', '.join(found) or 'none in this log'}"
        )
    if not found:
        raise FieldError(f"{log.source}: no scans with poses; allowed: a log whose poses were corrected")
    if wanted is None and len(found) > 1:
        raise FieldError(f"channel is missing, and several have scans; allowed: {', '.join(found)}")
    name = wanted or found[0]
    return name, float(log[name].facts.get("longest range [m]", 80.0))


def _contents(grid: OccupancyGrid, found: Traced, about: dict[str, object]) -> tuple[bytes, bytes, bytes]:
    text, pixels = ros_map_files(grid, "map.png")
    document = {
        "name": found.walls.name,
        "rings": found.walls.rings,
        "about": {**about, "resolution": grid.resolution, "deviation": found.deviation},
    }
    picture = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(picture, "PNG")
    return json.dumps(document).encode(), text.encode(), picture.getvalue()


# ---- what is printed


def figures(walls: Polygon) -> dict[str, str]:
    """Name, extent, area, segments and clearance of a map, by what they are called."""
    low, high = walls.polyline.min(axis=0), walls.polyline.max(axis=0)
    lengths = np.linalg.norm(walls.segments[:, 2:] - walls.segments[:, :2], axis=1)
    return {
        "name": walls.name,
        "extent": f"{low[0]:.2f} to {high[0]:.2f} m by {low[1]:.2f} to {high[1]:.2f} m",
        "free area": f"{walls.area:.1f} m^2",
        "segments": f"{len(lengths)} in {len(walls.rings)} rings, of {lengths.min():.2g} to {lengths.max():.3g} m",
        "symmetry": "none" if walls.symmetry == 1 else f"{walls.symmetry} rotations map it onto itself",
    }


def _of_grid(grid: OccupancyGrid, found: Traced) -> dict[str, str]:
    rows, columns = grid.cells.shape
    free, occupied, unknown = (grid.area(state) for state in (FREE, OCCUPIED, UNKNOWN))
    return {
        "cells": f"{columns} x {rows} of {grid.resolution:g} m",
        "free": f"{free:.1f} m^2, occupied {occupied:.1f}, unknown {unknown:.1f}",
        "left out": f"{found.left_out:.1f} m^2 free but apart, {found.holes_left_out} holes too small",
        "closed": f"{found.closed} free cells that touched by a corner alone",
        "deviation": f"{found.deviation:.3g} m at most between cells and walls",
    }


def _print(lines: dict[str, str]) -> None:
    for name, value in lines.items():
        print(f"{name:12}{value}")
