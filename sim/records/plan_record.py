"""Walls and beacons that an estimator was given, seen from above: the record of a mission in the folder of an estimated
log, in which nothing was simulated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mathnavi.models.aerial.beacons import FlightBeacons
from mathnavi.models.field.curve import Curve
from mathnavi.models.field.polygon import Polygon
from mathnavi.models.field.wall import Ring, Wall
from mathnavi.models.unicycle.beacons import BeaconMission
from mathnavi.sim.records.range_missions import wall_record


@dataclass(frozen=True)
class PlanRecord:
    """Wall and beacons of a mission in the horizontal plane."""

    coefficients: tuple[tuple[float, float, float, float], ...] = ()  # [m] of a curve, as of ``RangingRecord``
    rings: tuple[Ring, ...] = ()  # [m] of a polygon
    beacons: tuple[tuple[float, float] | None, ...] = ()  # [m] by their numbers; None: not known

    def wall(self) -> Wall | None:
        """The wall; None without one. Raises ArgumentError for coefficients or rings that describe none."""
        if self.rings:
            return Polygon(self.rings, "wall")
        return Curve(self.coefficients, "wall") if self.coefficients else None


def plan_record(mission: Any) -> PlanRecord:
    """Record of what the mission of an estimator knows of walls and beacons: nothing of a mission of another kind."""
    curve, beacons = getattr(mission, "curve", None), getattr(getattr(mission, "flight", mission), "beacons", None)
    known: dict[str, Any] = wall_record(curve) if isinstance(curve, Curve | Polygon) else {}
    places: Any = ()
    if isinstance(mission, BeaconMission):
        places = mission.beacons
    elif isinstance(beacons, BeaconMission):
        places = beacons.beacons
    elif isinstance(beacons, FlightBeacons):
        places = beacons.places
    plane = tuple(None if each is None else (float(each[0]), float(each[1])) for each in places)
    return PlanRecord(**known, beacons=plane)
