"""Record of the mission of a robot with range sensors in config.json."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mathnavi.models.field.curve import Curve
from mathnavi.models.field.polygon import Polygon
from mathnavi.models.field.wall import Ring, Wall
from mathnavi.models.unicycle.beacons import BeaconMission
from mathnavi.models.unicycle.entity import DriveName
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from mathnavi.sim.records.missions import Point


@dataclass(frozen=True)
class RangingRecord:
    """Robot with range sensors within a wall; angles are in radians."""

    field: str  # name of the wall
    coefficients: tuple[
        tuple[float, float, float, float], ...
    ]  # [m] a_x, b_x, a_y, b_y of each harmonic; () of a polygon
    angles: tuple[float, ...]  # (l,) [rad] of the sensors relative to the heading
    ranging: RangeQuality
    odometry: OdometryQuality
    known_start: KnownStart | None
    speed_max: float  # [m/s]
    turn_rate_max: float  # [rad/s]
    margin: float  # [m]
    period: float  # [s]
    drive: DriveName
    friction: float  # [-]
    start: Point = (0.0, 0.0, 0.0)  # [m, m, rad] the true one
    rings: tuple[Ring, ...] = ()  # [m] corners of a polygon's rings, the outer one first; () of a curve
    beacons: BeaconMission | None = None  # as the estimator knows them; None: it reads none
    beacon_places: tuple[tuple[float, float], ...] = ()  # [m] the true ones
    mounting: tuple[tuple[float, float], ...] = ()  # [m] of the sensors in the robot's axes: one for all, or one each
    outage: tuple[tuple[float, float], ...] = ()  # [s] from when to when there are no ranges

    def wall(self) -> Wall:
        """Wall of the mission. Raises ArgumentError for coefficients or rings that describe none."""
        return Polygon(self.rings, self.field) if self.rings else Curve(self.coefficients, self.field)


def wall_record(wall: Wall) -> dict[str, Any]:
    """Return the fields of a record that describe a wall."""
    if isinstance(wall, Polygon):
        return {"coefficients": (), "rings": wall.rings}
    assert isinstance(wall, Curve)
    return {"coefficients": wall.coefficients}
