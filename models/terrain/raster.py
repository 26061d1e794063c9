"""Heights of an elevation model as its file has them, before they become a map."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from mathnavi.interfaces.errors import TerrainError
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.ellipsoid import WGS84, Ellipsoid

Box = tuple[float, float, float, float]  # west, south, east, north
Locate = Callable[[Array, Array], tuple[Array, Array]]
"""function from coordinates east (n,) and north (m,) to rows and columns (m, n) of a raster, fractions among them"""


@dataclass(frozen=True, eq=False)
class Raster:
    """Heights of a file, voids included.

    Row 0 is south and column 0 west, unless ``locate`` says where a point of the ground lies in ``z``.
    """

    name: str
    z: Array  # (rows, cols) [m]; NaN where void
    step_north: float  # between nodes, [m], or [degrees] if there is a latitude
    step_east: float
    latitude: float | None = None  # [degrees] of the centre, if the steps are angles
    source: str = ""
    licence: str = ""
    south: float = 0.0  # coordinates of the south-west node, in the unit of the steps
    west: float = 0.0
    ellipsoid: Ellipsoid = WGS84
    datum: str = ""  # what the heights are measured from: "ellipsoid", "geoid", each with a name; empty if not stated
    taken: str = ""  # what was taken for granted, since the file does not say it
    locate: Locate | None = None
    extent: tuple[int, int] | None = None  # nodes (north, east) of the ground, if ``locate`` is given
    upper: Array | None = None  # (rows, cols) [m] that the ground may reach, inf where it was guessed; z if None

    @property
    def nodes(self) -> tuple[int, int]:
        """Nodes from south to north and from west to east, ``step_north`` and ``step_east`` apart."""
        rows, columns = self.z.shape
        return self.extent or (rows, columns)

    @property
    def box(self) -> Box:
        """West, south, east and north border, in the unit of the steps."""
        rows, columns = self.nodes
        north, east = self.south + (rows - 1) * self.step_north, self.west + (columns - 1) * self.step_east
        return self.west, self.south, east, north

    @property
    def reach(self) -> str:
        """Text of the borders."""
        return "west {:.10g}, south {:.10g} to east {:.10g}, north {:.10g}".format(*self.box)

    @property
    def metres(self) -> tuple[float, float]:
        """Lengths [m] of the unit of the steps, north and east."""
        return (1.0, 1.0) if self.latitude is None else self.ellipsoid.metres_per_degree(self.latitude)


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
    rows, columns = within(crop, raster.nodes, corner, steps, raster.name)
    south, count = raster.south + rows.start * raster.step_north, rows.stop - rows.start
    return replace(
        raster,
        z=raster.z if raster.locate else raster.z[rows, columns],
        upper=raster.upper if raster.locate or raster.upper is None else raster.upper[rows, columns],
        extent=(count, columns.stop - columns.start) if raster.locate else None,
        south=south,
        west=raster.west + columns.start * raster.step_east,
        latitude=None if raster.latitude is None else south + 0.5 * (count - 1) * raster.step_north,
    )


def _numbers(box: Box) -> str:
    return " ".join(f"{value:.10g}" for value in box)
