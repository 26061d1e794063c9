"""Elevation models and the maps made of them: does the ground of the file stay below what plans are certified over?

The file is read in another way than the one that made the map: PROJ brings points of the map to the file's pixels, and
the height there is bilinear between four of them.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mathnavi.controllers.flight.certificate import Certificate, raised_ground
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.dynamics import HULL_RADIUS, state_at
from mathnavi.models.aerial.plan_status import FlightPhase
from mathnavi.models.terrain.dem_import import import_dem
from mathnavi.models.terrain.ellipsoid import WGS84
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import jacksboro, tian_shan
from mathnavi.models.terrain.resampling import bilinear
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Row, Setup, StudyResult

H_MIN, SPEED, ACCELERATION = 50.0, 300.0, 40.0  # [m], [m/s], [m/s^2]
DIRECTIONS = ("north", "east", "north-east", "north-west")  # of ridges
NODES, PERIOD = 90, 7  # of a synthetic model each way; pixels from ridge to ridge
LOOKS = 4000  # places on a plan at which the file is asked
POINTS = 40_000  # of the map at which the file is asked
ROUNDING = 1e-3  # [m]
REAL = ("degrees", "rotated", "coarser", "mercator", "feet")
TREE = "EPSG:32644"  # of the real models


@dataclass(frozen=True)
class ModelCase:
    """One elevation model: a synthetic one by its number, or a real one by the way it is written."""

    number: int
    real: str = ""
    plans: int = 50


@configuration
class TerrainConfig:
    """Sample sizes: elevation models and plans."""

    synthetic: Count = 40
    """number of synthetic elevation models, from 10 to 80 degrees of latitude"""
    real: Count = len(REAL)
    """largest number of files of real ground"""
    plans: Count = 200
    """number of plans over each map, most of them close to the ground"""


class TerrainStudy:
    """Elevation models, the maps made of them, and plans certified over these."""

    Config = TerrainConfig
    quick = TerrainConfig(synthetic=4, real=1, plans=20)
    title = "Files of heights and their maps"
    on_terrain = False

    @staticmethod
    def run(config: TerrainConfig, setup: Setup) -> StudyResult:
        """Run the study with the sample sizes of ``config``."""
        cases = [ModelCase(number, plans=config.plans) for number in range(config.synthetic)]
        cases += [ModelCase(number, real, config.plans) for number, real in enumerate(REAL[: config.real])]
        rows = setup.compute(compared, cases)
        return StudyResult(
            summary=(
                f"{len(rows)} files of heights, {config.plans} straight flights over each, from rest to rest, about as "
                f"low as h_min = {H_MIN:g} m over the map, or over its bound, allows. A map at other nodes than its "
                "file keeps how far the file may rise above each of its triangles, and plans are certified over that. "
                "Beside it: what would be certified over the map alone.",
            ),
            rows=rows,
            tables=(_table(rows),),
            figure=_figure(rows),
            caption=(
                "How far the file is above the map at most, over the bound that the map states; each point is a file. "
                "Right: certified plans that come closer to the file than h_min, over the map alone."
            ),
            claims=[_claim(rows)],
        )


def _table(rows: Sequence[Row]) -> Table:
    return Table.of("Files and their maps", rows, (
        ("file", "file"), ("spacing", "{spacing_m:.1f} m"), ("file above map", "{above_m:.1f} m"),
        ("stated", "{stated_m:.1f} m"), ("beyond what is stated", "beyond"), ("certified", "certified"),
        ("of these below h_min over the file", "low"), ("certified over the map alone", "certified_alone"),
        ("of these below h_min over the file", "low_alone"),
    ))  # fmt: skip


def _claim(rows: Sequence[Row]) -> Claim:
    points, plans, alone = (sum(row[key] for row in rows) for key in ("beyond", "low", "low_alone"))
    certified = sum(row["certified"] for row in rows)
    return Claim(
        "terrain.faithful", "target", "A plan certified over a map keeps h_min over the file that it was made from.",
        "A.4", "no file above its map by more than is stated, no certified plan below h_min over the file",
        f"{points} of {POINTS * len(rows)} points beyond, {plans} of {certified} plans below; over maps alone {alone}",
        points == 0 and plans == 0,
    )  # fmt: skip


def _figure(rows: Sequence[Row]) -> Figure:
    with styled_figure((9.0, 3.8)) as page:
        left, right = page.subplots(1, 2)
        for real, colour, name in ((False, "#0d5fa8", "synthetic"), (True, "#c2183b", "real ground")):
            chosen = [row for row in rows if row["real"] == real]
            if chosen:
                left.plot(
                    [row["stated_m"] for row in chosen], [max(row["above_m"], 0.0) for row in chosen], "o",
                    color=colour, ms=4.5, label=name,
                )  # fmt: skip
        largest = 1.1 * max(1.0, *(row["stated_m"] for row in rows))
        left.plot((0.0, largest), (0.0, largest), color="0.5", lw=1.0, ls="--", label="equal")
        left.set(xlabel="largest bound of the map [m]", ylabel="file above map, at most [m]")
        left.legend()
        shares = [row["low_alone"] / max(row["certified_alone"], 1) for row in rows]
        right.bar(range(len(rows)), [100.0 * share for share in shares], color="#9aa7b3", label="over the map alone")
        right.plot(range(len(rows)), [100.0 * row["low"] / max(row["certified"], 1) for row in rows], "o",
                   color="#0d5fa8", ms=3.5, label="as certified")  # fmt: skip
        right.set(xlabel="file", ylabel="below h_min over the file [%]")
        right.legend()
    return page


@dataclass(frozen=True, eq=False)
class WrittenModel:
    """A file of heights, and where a point of the map made of it lies in its pixels."""

    path: Path
    z: Array  # (rows, cols) [m] in the order of the file
    resample: float | None = None  # [m]
    crop: tuple[float, float, float, float] | None = None
    scale: float | None = None


def compared(case: ModelCase) -> dict[str, Any]:
    """Row of one elevation model: how far its file is above its map, and plans over it."""
    rng = np.random.default_rng((case.number, len(case.real)))
    with tempfile.TemporaryDirectory() as folder:
        model = _real(case.real, Path(folder)) if case.real else _synthetic(case.number, rng, Path(folder))
        terrain = import_dem(
            model.path, Path(folder, "map.npz"), resample=model.resample, crop=model.crop, scale=model.scale
        )
        file = FileGround(model, terrain)
        x, y = rng.uniform(0.0, terrain.width, POINTS), rng.uniform(0.0, terrain.depth, POINTS)
        above = file.height(x, y) - terrain.height(x, y)
        plans = [_straight(rng, terrain) for _ in range(case.plans)]
        certified, low = _flown(terrain, file, plans)
        alone = HeightField(terrain.z, terrain.spacing)
        certified_alone, low_alone = _flown(alone, file, plans)
    name = case.real or f"{_latitude(case.number):.0f} degrees, ridges {DIRECTIONS[case.number % 4]}"
    return {
        "file": name, "real": bool(case.real), "spacing_m": terrain.spacing, "above_m": float(above.max()),
        "stated_m": 0.0 if terrain.above is None else float(terrain.above.max()),
        "beyond": int((above > _stated(terrain, x, y) + ROUNDING).sum()),
        "certified": certified, "low": low, "certified_alone": certified_alone, "low_alone": low_alone,
    }  # fmt: skip


def _stated(terrain: HeightField, x: Array, y: Array) -> Array:
    """Return the bound (n,) [m] of the map on how far the file is above it there."""
    if terrain.above is None:
        return np.zeros_like(x)
    i, j = (x / terrain.spacing).astype(int), (y / terrain.spacing).astype(int)
    i, j = np.minimum(i, terrain.z.shape[1] - 2), np.minimum(j, terrain.z.shape[0] - 2)
    half = (y / terrain.spacing - j > x / terrain.spacing - i).astype(int)
    stated: Array = terrain.above[j, i, half].astype(np.float64)
    return stated


class FileGround:
    """Ground of a file, in the frame of the map that was made of it."""

    def __init__(self, model: WrittenModel, terrain: HeightField) -> None:
        import rasterio

        from mathnavi.models.terrain.raster_file import read_raster

        raster = read_raster(model.path, model.crop, model.scale)
        self._z, self._raster = model.z, raster
        with rasterio.open(model.path) as dataset:
            self._picture, self._transform = dataset.crs, dataset.transform
        metre = 1.0 if raster.latitude is not None else self._picture.linear_units_factor[1]
        self._unit = metre
        degrees = raster.latitude is not None and not self._picture.is_geographic
        self._system = rasterio.CRS.from_epsg(4326) if degrees else self._picture

    def height(self, x: Array, y: Array) -> Array:
        """Heights (n,) [m] of the file at points x, y (n,) [m] of the map."""
        from rasterio.warp import transform

        to_north, to_east = self._raster.metres
        east, north = (self._raster.west + x / to_east) / self._unit, (self._raster.south + y / to_north) / self._unit
        if self._system != self._picture:
            east, north = np.array(transform(self._system, self._picture, list(east), list(north)))
        place = ~self._transform
        column = place.a * east + place.b * north + place.c - 0.5
        row = place.d * east + place.e * north + place.f - 0.5
        rows, columns = self._z.shape
        return bilinear(self._z, np.clip(row, 0.0, rows - 1.0), np.clip(column, 0.0, columns - 1.0))


def _straight(rng: np.random.Generator, terrain: HeightField) -> Plan:
    """A straight flight from rest to rest, level, close to the lowest that the map alone, or with its bound, allows."""
    lost = 0.0 if terrain.above is None else float(terrain.above.max())
    room = 0.05 * min(terrain.width, terrain.depth)
    ends = rng.uniform(room, (terrain.width - room, terrain.depth - room), (2, 2))
    way = ends[0] + np.linspace(0.0, 1.0, 2000)[:, None] * (ends[1] - ends[0])
    z = float(terrain.height(*way.T).max()) + H_MIN + float(rng.uniform(-2.0, 20.0 + 1.2 * lost))
    length = math.dist(ends[0], ends[1])
    push = min(0.9 * ACCELERATION, (0.9 * SPEED) ** 2 / length)
    half = math.sqrt(length / push)
    u = np.zeros((2, 3))
    u[0, :2] = push * (ends[1] - ends[0]) / length
    u[1] = -u[0]
    start, end = np.array([*ends[0], z, 0.0, 0.0, 0.0]), np.array([*ends[1], z, 0.0, 0.0, 0.0])
    middle = np.concatenate((0.5 * (start[:3] + end[:3]), half * u[0]))
    phases = np.full(2, int(FlightPhase.OPTIMISED))
    return Plan(np.array([0.0, half, 2.0 * half]), np.array([start, middle, end]), u, phases)


def _flown(terrain: HeightField, file: FileGround, plans: Sequence[Plan]) -> tuple[int, int]:
    """Number of plans certified over a map, and of these how many are below h_min over the file."""
    raised, certified, low = raised_ground(terrain, HULL_RADIUS, 0.0), 0, 0
    for plan in plans:
        certificate = Certificate(raised, H_MIN, SPEED, ACCELERATION, plan.x[-1, :3], 1.0)
        if certificate.check(plan) is not None:
            continue
        certified += 1
        x = state_at(plan, np.linspace(plan.t[0], plan.t[-1], LOOKS))
        low += int((x[:, 2] - file.height(x[:, 0], x[:, 1])).min() < H_MIN - ROUNDING)
    return certified, low


# ---- files


def _latitude(number: int) -> float:
    return 10.0 + 70.0 * (number // len(DIRECTIONS) % 10) / 9.0


def _synthetic(number: int, rng: np.random.Generator, folder: Path) -> WrittenModel:
    """Hills with ridges one pixel wide, one arc-second from pixel to pixel, at a random place."""
    rows, columns = np.mgrid[0:NODES, 0:NODES]
    waves = np.add.outer(rng.uniform(0.0, 40.0, NODES).cumsum() % 60.0, 20.0 * np.sin(np.arange(NODES) / 5.0))
    along = {"north": columns, "east": rows, "north-east": rows + columns, "north-west": rows - columns}
    ridges = along[DIRECTIONS[number % len(DIRECTIONS)]] % PERIOD == 3
    z = 300.0 + waves + ridges * rng.uniform(150.0, 400.0)
    step = 1.0 / 3600.0
    north, west = _latitude(number) + step * rng.uniform(0.0, 1.0), 10.0 + step * rng.uniform(0.0, 1.0)
    return WrittenModel(*_written(folder, z, "EPSG:4326", (step, 0.0, west, 0.0, -step, north)))


def _real(way: str, folder: Path) -> WrittenModel:
    """Real ground, written as people bring it."""
    if way == "degrees":
        z, latitude = jacksboro().z[::-1], 36.5
        to_north, to_east = WGS84.metres_per_degree(latitude)
        place = (90.0 / to_east, 0.0, -84.4, 0.0, -90.0 / to_north, 36.7)
        return WrittenModel(*_written(folder, z, "EPSG:4326", place))
    z = tian_shan().z[::-1][60:190, 50:200]
    if way == "rotated":
        cosine, sine = 320.0 * math.cos(0.4), 320.0 * math.sin(0.4)
        path, values = _written(folder, z, TREE, (cosine, sine, 4.5e5, sine, -cosine, 4.66e6))
        # A square within the picture, about its centre.
        x, y = 4.5e5 + 75 * cosine + 65 * sine, 4.66e6 + 75 * sine - 65 * cosine
        return WrittenModel(path, values, crop=(x - 1.2e4, y - 1.2e4, x + 1.2e4, y + 1.2e4))
    if way == "coarser":
        return WrittenModel(*_written(folder, z, TREE, (320.0, 0.0, 4.5e5, 0.0, -320.0, 4.66e6)), resample=500.0)
    if way == "mercator":
        return WrittenModel(*_written(folder, z, "EPSG:3857", (430.0, 0.0, 8.9e6, 0.0, -430.0, 5.2e6)))
    path, values = _written(folder, z / 0.3048, TREE, (320.0, 0.0, 4.5e5, 0.0, -350.0, 4.66e6))
    return WrittenModel(path, 0.3048 * values, scale=0.3048)


def _written(folder: Path, z: Array, crs: str, place: tuple[float, ...]) -> tuple[Path, Array]:
    """Write a GeoTIFF, row 0 first, and return the heights that it holds."""
    import rasterio

    path, values = folder / "model.tif", z.astype(np.float32)
    rows, columns = z.shape
    with rasterio.open(
        path, "w", driver="GTiff", width=columns, height=rows, count=1, dtype="float32", crs=crs,
        transform=rasterio.Affine(*place),
    ) as dataset:  # fmt: skip
        dataset.write(values, 1)
    return path, values.astype(np.float64)
