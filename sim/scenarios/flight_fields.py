"""Fields of flights: those that several scenarios share, and those of ``safe-flight``."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import field
from typing import Annotated, Literal

from annotated_types import Ge, Interval

from mathnavi.interfaces.angles import Radians
from mathnavi.interfaces.bounds import (
    FINITE,
    THREE_FINITE_NUMBERS,
    Condition,
    Each,
    Fraction,
    TickRate,
    Within,
    configuration,
)
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import TOGETHER
from mathnavi.models.aerial.beacons import FlightBeacons
from mathnavi.models.aerial.dynamics import CONTROL_TICKS, HULL_RADIUS, TICK
from mathnavi.models.beacon_names import BeaconKind
from mathnavi.models.terrain.library import TerrainPlace
from mathnavi.sim.records.missions import Point
from mathnavi.sim.scenarios.beacon_fields import check_beacons, check_unknown
from mathnavi.sim.scenarios.fault_fields import LARGEST, BeaconFaults, Magnitude, PositiveMagnitude, SafeFlightFaults
from mathnavi.sim.scenarios.information import ChangeFields, check_target_path
from mathnavi.sim.scenarios.redraw import ChanceFields

_DIAGONAL = 1.5  # beyond that of a square map, in shares of its side


def drawn_between(largest: float) -> Condition:
    """Condition on the two ends of a range of draws, 0 <= low <= high <= ``largest``."""

    def are_ordered(ends: tuple[float, float]) -> bool:
        low, high = ends
        return 0.0 <= low <= high <= largest

    return Condition(are_ordered, f"two finite numbers, 0 <= low <= high <= {largest:g}")


FinitePoint = Annotated[Point, THREE_FINITE_NUMBERS]
DrawnHeights = Annotated[tuple[float, float], drawn_between(LARGEST)]
DrawnSeparation = Annotated[tuple[float, float], drawn_between(_DIAGONAL)]
DeadlineFactor = Annotated[float, Interval(ge=1.0, le=LARGEST), FINITE]
Datum = Literal["map", "geoid", "ellipsoid"]
Rate = Annotated[float, TickRate(TICK)]
BEACON_PLACE = Condition(
    lambda place: all(abs(each) <= LARGEST for each in place), f"three values from -{LARGEST:g} to {LARGEST:g} m"
)


@configuration(prefix="noise.")
class FlightNoise:
    """Errors of the sensors."""

    position: Magnitude = 0.0
    """standard deviation of a position reading on each axis [m]"""
    position_rate: Rate = 10.0
    """rate of the position fixes [Hz]"""


@configuration(prefix="beacons.")
class FlightBeaconFields:
    """Beacons, which the estimator kalman reads in place of position fixes, or beside them."""

    places: Annotated[tuple[FinitePoint, ...], Each(BEACON_PLACE)] = ()
    """place X Y Z of a beacon [m] on the map; may be given several times"""
    unknown: Annotated[tuple[int, ...], Each(Ge(0))] = ()
    """number of a beacon, from 0 in the order of the places, whose place the estimator is not given; may be given
    several times"""
    read: Annotated[tuple[BeaconKind, ...], TOGETHER] = ("ranges",)
    """readings of each beacon: ranges, bearings, range differences to the first, or several of these"""
    range_noise: Magnitude = 1.0
    """standard deviation of a range, and of each of the two arrivals that a range difference is between [m]"""
    bearing_noise: Annotated[float, Radians(0.0, math.pi)] = 0.02
    """standard deviation of the azimuth and of the elevation of a bearing [rad]"""
    range_maximum: PositiveMagnitude | None = None
    """greatest range, beyond which there is no return [m]; no limit if not given"""
    outliers: Fraction = 0.0
    """fraction of readings that are anything"""
    dropout: Fraction = 0.0
    """fraction of readings that are lost"""
    rate: Rate = 10.0
    """rate at which all beacons are read [Hz]"""
    line_of_sight: bool = False
    """whether a beacon that the ground hides has no return; readings pass through the ground if not"""

    def __post_init__(self) -> None:
        check_beacons(self)
        check_unknown(self)
        if "range-differences" in self.read and 0 in self.unknown:
            raise FieldError(
                f"beacons.unknown = {self.unknown!r} with beacons.read = {self.read!r}; allowed: numbers from 1, for "
                "range differences are taken to beacon 0, or no range-differences"
            )

    def given(self) -> FlightBeacons | None:
        """Beacons as a mission declares them to an estimator; None without any."""
        true = self.declared()
        if true is None or not self.unknown:
            return true
        given = tuple(None if i in self.unknown else place for i, place in enumerate(self.places))
        return dataclasses.replace(true, places=given)

    def declared(self) -> FlightBeacons | None:
        """Beacons at their true places; None without any."""
        if not self.places:
            return None
        return FlightBeacons(
            self.places,
            self.range_noise,
            self.rate,
            self.range_maximum,
            self.dropout,
            self.outliers,
            self.line_of_sight,
            self.read,
            self.bearing_noise,
        )


@configuration
class EndFields:
    """Start, target and ground of a mission."""

    terrain: TerrainPlace = "tian_shan"
    """name of a terrain, or an .npz file"""
    start: FinitePoint | None = None
    """start x, y, z [m] on the map; drawn from the seed if not given"""
    target: FinitePoint | None = None
    """target x, y, z [m] on the map; drawn from the seed if not given"""
    drawn_heights: DrawnHeights = (50.0, 450.0)
    """heights above h_min between which a start or target is drawn [m]"""
    drawn_separation: DrawnSeparation = (0.8, 1.5)
    """shares of the map's side between which the distance of a drawn start and target lies"""
    datum: Datum = "map"
    """surface from which the heights of start and target are measured: the map's, or one that the map must state"""


HullClearance = Annotated[
    Magnitude, Within(Ge(HULL_RADIUS), allowed=f">= {HULL_RADIUS:g} m, the radius of the vehicle's hull")
]


@configuration
class LimitFields:
    """Bounds within which the point masses fly, one or a fleet of them."""

    clearance_min: HullClearance = 50.0
    """least height h_min of a vehicle's centre above the ground below it [m]"""
    speed_max: PositiveMagnitude = 300.0
    """largest speed v_max [m/s]"""
    acceleration_max: PositiveMagnitude = 40.0
    """largest acceleration a_max [m/s^2]"""
    deadline_factor: DeadlineFactor = 1.3
    """ratio gamma of the deadline to the duration of the first plan"""
    arrival_radius: PositiveMagnitude = 50.0
    """distance r_f from the target that counts as arrived [m]"""


@configuration
class MissionFields(LimitFields, EndFields):
    """Mission, without changes on the way."""

    control_rate: Rate = 1.0 / (CONTROL_TICKS * TICK)
    """rate of estimator, tracker and log [Hz]; the physics runs at 300 Hz"""


@configuration
class SafeFlightConfig(ChangeFields, ChanceFields, MissionFields):
    """Fields of the scenario."""

    target_path: tuple[tuple[float, float, float, float], ...] = ()
    """position of the target at a time, T X Y Z [s, m, m, m], reached at constant speed and initial height above ground
    or more; may be given several times"""
    filter: bool = False
    """whether the controller's commands are filtered, in place of certifying its plans"""
    noise: FlightNoise = field(default_factory=FlightNoise)
    faults: SafeFlightFaults = field(default_factory=SafeFlightFaults)
    beacons: FlightBeaconFields = field(default_factory=FlightBeaconFields)

    @property
    def kernels(self) -> str | None:
        """List of what is compiled before the first run among beacons."""
        return "mathnavi.estimators.beacons.flight_ahead" if self.beacons.places else None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_target_path(self.target_path)
        failing = self.faults.beacons if isinstance(self.faults, BeaconFaults) else ()  # somebody's own may have none
        count = len(self.beacons.places)
        if any(each >= count for each in failing) or len(set(failing)) < len(failing):
            allowed = "none without beacons.places" if not count else "0" if count == 1 else f"0 to {count - 1}"
            allowed = allowed if len(set(failing)) == len(failing) else f"different numbers, {allowed}"
            beacons = "1 beacon" if count == 1 else f"{count} beacons"
            raise FieldError(f"faults.beacons = {failing!r}, of {beacons}; allowed: {allowed}")
