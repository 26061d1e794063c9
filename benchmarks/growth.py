"""Growth of the cost of a mission with its map, and of a fleet with its vehicles.

    python -m benchmarks.growth [--repetitions 3]

The work is that of the study ``scaling`` (``mathnavi.studies.introduction.cost_measurement``): a mission over the
same ground on more and more nodes, built and flown, and 20 s of a fleet's flight. Large and small sizes run in turns. A
window of a GeoTIFF is read, and a mission flown over it, compared with a file that holds the window only.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Ge

from benchmarks.arguments import read_arguments
from mathnavi.interfaces.bounds import Within, configuration

os.environ.setdefault("MUJOCO_GL", "disable")

import numpy as np
from rich.console import Console

from benchmarks.comparison import Comparison, alone
from benchmarks.progress import progress
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.dem_import import import_dem
from mathnavi.models.terrain.raster import Box
from mathnavi.models.terrain.raster_file import read_raster
from mathnavi.sim.sweep.trial import trial
from mathnavi.studies.introduction.cost_measurement import CURVES, FLOWN

SPACING = 160.0  # [m] of the file that a window is read from
WINDOWED, WINDOW = 4097, 257  # nodes along a side, of the file and of the window
LEEWAY = 1.15  # what counts as no growth: times


@dataclass(frozen=True)
class Growth:
    """A cost at two sizes, divided by ``size ** power``."""

    what: str
    curve: str  # a key of CURVES
    small: int
    large: int
    power: int
    unit: str
    factor: float  # of the unit

    def cost(self, size: int, seed: int) -> float:
        """Return the cost of a size, divided by ``size ** power``."""
        curve = CURVES[self.curve]
        whole: float = curve.cost(curve.made(size, seed))
        return self.factor * whole / float(size**self.power)


def growths(quick: bool) -> tuple[Growth, ...]:
    """Return the costs that are measured, at smaller sizes if ``quick``."""
    side, vehicles = ((129, 257), (4, 8)) if quick else ((257, 2049), (16, 128))
    return (
        Growth("build, a node of {large}²", "map, built", *side, 2, "us", 1e6),
        Growth("flight, a second over {large}²", "map, flown", *side, 0, "ms", 1e3),
        Growth("fleet, a vehicle's second among {large}", "fleet", *vehicles, 1, "ms", 1e3),
    )


@configuration
class Arguments:
    """Measure how costs grow with maps and fleets."""

    repetitions: Annotated[int, Within(Ge(1), allowed=">= 1")] = 3
    """number of measurements of each size"""
    quick: bool = False
    """whether to measure small sizes only: rough figures"""
    out: Path = Path("renders/out/growth.json")
    """file of the figures"""


@dataclass(frozen=True, eq=False)
class GrowthFindings:
    """Rows of the table."""

    rows: list[Comparison]

    @property
    def title(self) -> str:
        return "growth with maps and fleets"

    def comparisons(self) -> list[Comparison]:
        return self.rows

    def show(self, console: Console) -> None:
        console.print("Growth: the other is the same at the smaller size; the study `scaling` has whole curves.")

    def plain(self) -> dict[str, Any]:
        return {
            "costs": [{"what": row.what, "large": row.ours.tolist(), "small": row.other.tolist()} for row in self.rows]
        }


def run(arguments: Arguments, console: Console) -> GrowthFindings:
    """Measure small and large sizes in turns."""
    wanted, rows = growths(arguments.quick), []
    with progress(console, "growth", arguments.repetitions * len(wanted)) as report:
        for k, growth in enumerate(wanted):
            growth.cost(growth.small, 0)  # kernels are loaded, files are in memory
            pairs = []
            for repetition in range(arguments.repetitions):
                report(arguments.repetitions * k + repetition, growth.what.format(large=growth.large))
                pairs.append([growth.cost(size, repetition) for size in (growth.small, growth.large)])
            small, large = np.array(pairs).T
            named = "²" * (growth.power == 2 or growth.curve == "map, flown")
            rows.append(
                Comparison(
                    growth.what.format(large=growth.large), growth.unit, large, small, f"at {growth.small}{named}",
                    "ours / other", at_most=LEEWAY,
                )
            )  # fmt: skip
    return GrowthFindings([*rows, *windows(arguments.repetitions)])


def windows(repetitions: int, side: int = WINDOWED, window: int = WINDOW) -> list[Comparison]:
    """Compare reading and flying over a window of a GeoTIFF with a file that holds the window only."""
    reach = SPACING * (window - 1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        whole, part = folder / "whole.tif", folder / "part.tif"
        write_geotiff(whole, side)
        write_geotiff(part, window)
        box = (0.0, 0.0, reach, reach)
        readings = [lambda: read_raster(whole, box), lambda: read_raster(part)]
        missions = [lambda: _mission(whole, folder, box), lambda: _mission(part, folder, None)]
        return [
            _in_turns(f"read {window}² nodes of {side}²", readings, f"of {window}²", repetitions),
            _in_turns(f"mission over {window}² of {side}²", missions, f"of {window}²", repetitions),
        ]


def _mission(source: Path, folder: Path, box: Box | None) -> None:
    """Import the map, plan the mission, and fly its first 20 s."""
    made = folder / f"{source.stem}.npz"
    import_dem(source, made, crop=box)
    closed_loop = trial("safe-flight", 1, fields={"terrain": str(made), "drawn_separation": (0.15, 0.2)}).build()
    replace(closed_loop, duration=FLOWN).run()


def _in_turns(what: str, works: Sequence[Callable[[], object]], other: str, repetitions: int) -> Comparison:
    """Compare the first work with the second in turns, after one run of each that is not counted."""
    pairs: Array = np.array([[_timed(work) for work in works] for _ in range(repetitions + 1)])[1:]
    return Comparison(what, "ms", pairs[:, 0], pairs[:, 1], other, "ours / other", at_most=LEEWAY)


def write_geotiff(path: Path, side: int) -> None:
    """Write hills on ``side`` x ``side`` nodes, the south-western node at (0, 0)."""
    import rasterio

    row, column = np.indices((side, side), sparse=True)
    z = (500.0 + 200.0 * np.sin(0.02 * row) * np.cos(0.03 * column)).astype(np.float32)
    with rasterio.open(
        path, "w", driver="GTiff", width=side, height=side, count=1, dtype="float32", crs="EPSG:32644", tiled=True,
        transform=rasterio.transform.from_origin(-0.5 * SPACING, (side - 0.5) * SPACING, SPACING, SPACING),
    ) as dataset:  # fmt: skip
        dataset.write(z, 1)


def _timed(work: Callable[[], object]) -> float:
    """Return the CPU time [ms] of the work."""
    began = time.process_time()
    work()
    return 1e3 * (time.process_time() - began)


def main(arguments: Arguments) -> None:
    alone("growth", lambda console: run(arguments, console), arguments.out)


if __name__ == "__main__":
    main(read_arguments(Arguments))
