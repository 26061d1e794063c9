"""``mathnavi terrain``: import an elevation model, show a map."""

from __future__ import annotations

import io
import math
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from mathnavi.commands.arguments import FlagGroup, flags, parse, with_flag
from mathnavi.commands.errors import BadInputError, bad_input
from mathnavi.commands.output import output_folder
from mathnavi.commands.wrapping import wrapped
from mathnavi.interfaces.checks import check_spares
from mathnavi.interfaces.field_table import Positional, ValueName
from mathnavi.interfaces.writing import write_bytes
from mathnavi.models.terrain.dem_import import import_dem
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain, terrain_names

USAGE = """usage: mathnavi terrain import FILE --out FILE.npz [--fill]
                               [--crop WEST SOUTH EAST NORTH]
                               [--resample M] [--spacing M] [--scale M]
                               [--nodata VALUE] [--heights LOW HIGH]
                               [--void-error M]
       mathnavi terrain show NAME|FILE.npz [--out PNG]

NAME: {}"""


@dataclass(frozen=True)
class TerrainImportOptions:
    """Flags of ``terrain import``: the elevation model to import, and the map to write."""

    file: Annotated[Path, Positional("FILE")]
    """elevation model: .tif, .hgt, .asc, .bil, .flt, .img, .nc, .vrt, one of these in a .zip or .gz, .png (16 bit) or
    .npz"""
    out: Path
    """map to write, .npz"""
    crop: Annotated[tuple[float, float, float, float] | None, ValueName("WEST SOUTH EAST NORTH")] = None
    """rectangle to keep: in degrees for a file in degrees, in metres of the projection for another one, in metres from
    the south-west corner for .png and .npz"""
    fill: bool = False
    """whether to fill voids from the heights around them, at most 100 nodes away"""
    resample: float | None = None
    """distance between the nodes of the map [m], bilinear; the smaller step of the file if not given"""
    spacing: float | None = None
    """distance between the pixels of a .png [m], which does not contain it"""
    scale: float | None = None
    """height of one unit [m]; needed for a .png, and where a file does not say which unit its heights have"""
    nodata: float | None = None
    """value of a void, in addition to the one that the file states [unit of the file]"""
    heights: Annotated[tuple[float, float] | None, ValueName("LOW HIGH")] = None
    """range of the heights that are ground [m]; -500 to 9000 on Earth if not given"""
    void_error: float | None = None
    """height that the ground may have above what is filled [m]; a plan over filled ground is not certified without"""


@dataclass(frozen=True)
class TerrainShowOptions:
    """Flags of ``terrain show``: the map to show, and the picture to write."""

    terrain: Annotated[str, Positional("NAME|FILE")]
    """terrain: its name, or an .npz file"""
    out: Path | None = None
    """picture to write, .png; renders/out/NAME.png if not given"""


def main(argv: Sequence[str]) -> int:
    actions = {"import": _import, "show": _show}
    if argv and argv[0] in ("-h", "--help"):
        print(wrapped(USAGE.format(", ".join(terrain_names()))))
        return 0
    if not argv or argv[0] not in actions:
        raise BadInputError(f"terrain {' '.join(argv[:1])}: not a command; allowed: {', '.join(actions)}")
    actions[argv[0]](argv[1:])
    return 0


def _import(argv: Sequence[str]) -> None:
    (options,) = parse(
        argv, "mathnavi terrain import", "Write an elevation model as a map (.npz).", FlagGroup(TerrainImportOptions)
    )
    try:
        with bad_input():
            terrain = import_dem(
                options.file,
                options.out,
                spacing=options.spacing,
                scale=options.scale,
                crop=options.crop,
                fill=options.fill,
                resample=options.resample,
                nodata=options.nodata,
                heights=options.heights,
                void_error=options.void_error,
            )
    except BadInputError as error:
        raise BadInputError(with_flag(str(error), [*flags(TerrainImportOptions)])) from error
    print(statistics(terrain))
    print(f"map       {options.out}")
    print(f"fly       {flight_over(str(options.out))}")


def _show(argv: Sequence[str]) -> None:
    (options,) = parse(
        argv, "mathnavi terrain show", "Print the statistics of a map and draw it.", FlagGroup(TerrainShowOptions)
    )
    with bad_input():
        terrain = load_terrain(options.terrain)
        picture = options.out or Path("renders/out") / f"{terrain.name}.png"
        if picture.suffix != ".png":
            raise BadInputError(f"--out = {picture}; allowed: a name that ends in .png")
        check_spares(picture, [options.terrain], "--out")
    with output_folder(picture.parent), bad_input():
        _draw(terrain, picture)
    print(statistics(terrain))
    print(f"picture   {picture}")
    print(f"fly       {flight_over(options.terrain)}")


def flight_over(place: str) -> str:
    """Return the command that flies over a terrain, by its name or file."""
    return f"mathnavi run safe-flight --terrain {shlex.quote(place)}"


def _draw(terrain: HeightField, path: Path) -> None:
    from mathnavi.renders.figures import terrain_figure  # matplotlib takes a while to import

    picture = io.BytesIO()
    terrain_figure(terrain).savefig(picture, format="png", dpi=120)
    write_bytes(path, picture.getvalue())


def statistics(terrain: HeightField) -> str:
    """Return name, size, heights and source of a map, one line each."""
    rows, columns = terrain.z.shape
    lines = {
        "name": terrain.name,
        "nodes": f"{rows} x {columns}, {terrain.spacing:g} m apart",
        "size": f"{terrain.width / 1e3:.3g} km east, {terrain.depth / 1e3:.3g} km north",
        "heights": f"{terrain.z.min():.1f} to {terrain.z.max():.1f} m",
        "steepest": f"{steepest(terrain):.1f} degrees, of any triangle",
        **_lost(terrain),
        "datum": terrain.datum or "not stated (heights above the ellipsoid and above the geoid differ by up to 100 m)",
        "source": terrain.source or "not stated",
        "licence": terrain.licence or "not stated",
        "digest": terrain.digest,
    }
    return "\n".join(f"{name:10}{value}" for name, value in lines.items())


def _lost(terrain: HeightField) -> dict[str, str]:
    """Return the lines on ground that may be above the map."""
    if terrain.above is None:
        return {}
    known = terrain.above[np.isfinite(terrain.above)]
    cells = int(np.isinf(terrain.above).any(axis=-1).sum())
    said = {"above": f"up to {float(known.max(initial=0.0)):.1f} m, by which the file may rise above the map"}
    if cells:
        said["filled"] = f"{cells} cells, over which no plan is certified (--void-error M says how far they may be off)"
    return said


def steepest(terrain: HeightField) -> float:
    """Return the slope [degrees] of the steepest triangle."""
    east, north = np.diff(terrain.z, axis=1), np.diff(terrain.z, axis=0)
    # A cell's diagonal runs from south-west to north-east: the south and east edges are one triangle
    squares = (east[:-1] ** 2 + north[:, 1:] ** 2, east[1:] ** 2 + north[:, :-1] ** 2)
    return math.degrees(math.atan(math.sqrt(max(float(square.max()) for square in squares)) / terrain.spacing))
