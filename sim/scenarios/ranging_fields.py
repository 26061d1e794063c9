"""The fields of ``range-localisation``. Lengths are in metres, angles in degrees, counter-clockwise."""

from __future__ import annotations

import dataclasses
import math
from functools import lru_cache
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Interval, Le

from mathnavi.interfaces.angles import Degrees, Radians, check_angle
from mathnavi.interfaces.bounds import (
    FINITE,
    THREE_FINITE_NUMBERS,
    Condition,
    Each,
    Fraction,
    NonNegative,
    Positive,
    TickRate,
    configuration,
    whole_ticks,
)
from mathnavi.interfaces.checks import check
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import TOGETHER, NumberList
from mathnavi.models.beacon_names import BeaconKind
from mathnavi.models.field.curve import BEAN, EGG, Curve, ellipse
from mathnavi.models.field.map_file import MapPlace, load_map
from mathnavi.models.field.wall import Wall
from mathnavi.models.unicycle.beacons import BeaconMission, BeaconQuality
from mathnavi.models.unicycle.entity import RADIUS, DriveName
from mathnavi.models.unicycle.mission import TICK
from mathnavi.models.unicycle.quality import OdometryQuality, RangeQuality
from mathnavi.sim.scenarios.beacon_fields import check_beacons, check_unknown
from mathnavi.sim.scenarios.fault_fields import Factor
from mathnavi.sim.scenarios.redraw import ChanceFields

_HALF_AXES = (3.763, math.sqrt(2.0))
_START_ERROR = (0.3, 0.3, 17.0)
_SHORTEST, _LONGEST = 0.5, 20.0  # [m] of a half-axis
_FARTHEST = 1000.0  # [m] of a range in a building
_MOST_SENSORS = 64
_FARTHEST_OUT = 1.0  # [m] of a sensor on the robot
_AROUND = 3.0  # [m] by which a robot may be outside the box around all beacons
_AROUND_UNKNOWN = 10.0  # [m] likewise where some are to be found
_AXES = f"two finite values from {_SHORTEST:g} to {_LONGEST:g} m"


def _is_outage(times: tuple[float, float]) -> bool:
    begin, end = times
    return math.isfinite(end) and 0.0 <= begin < end


_PLACE = Condition(
    lambda place: all(abs(each) <= _LONGEST for each in place), f"two values from -{_LONGEST:g} to {_LONGEST:g} m"
)
_MOUNTED = Condition(
    lambda place: math.hypot(*place) <= _FARTHEST_OUT,
    f"two values, up to {_FARTHEST_OUT:g} m off the middle of the axle",
)
_OUTAGE = Condition(_is_outage, "two finite times, 0 <= T0 < T1")
HalfAxes = Annotated[tuple[float, float], Each(Interval(ge=_SHORTEST, le=_LONGEST), allowed=_AXES)]
SensorDirections = Annotated[
    NumberList,
    Condition(lambda angles: 1 <= len(angles) <= _MOST_SENSORS, f"1 to {_MOST_SENSORS} directions"),
    Each(Degrees()),
]


@configuration(prefix="field.")
class WallFields:
    """Fields of the wall."""

    shape: Literal["ellipse", "egg", "bean", "fourier", "map"] = "ellipse"
    """shape of the wall; egg and bean have no further fields, a map has that of a building"""
    half_axes: HalfAxes = _HALF_AXES
    """half-axes c_1 and c_2 of an ellipse [m]"""
    coefficients: tuple[tuple[float, float, float, float], ...] = ()
    """coefficients A_X B_X A_Y B_Y of a fourier shape, given once for each harmonic k = 0, 1, ... [m]"""
    map: MapPlace = ""
    """map of a building: .json with rings, map.yaml of ROS, or a folder of map import; with the shape map"""

    def __post_init__(self) -> None:
        if self.half_axes != _HALF_AXES and self.shape != "ellipse":
            raise FieldError(
                f"field.half_axes = {self.half_axes!r} with shape = {self.shape}; allowed: with an ellipse"
            )
        if bool(self.coefficients) != (self.shape == "fourier"):
            allowed = "two rows or more" if self.shape == "fourier" else f"none with shape = {self.shape}"
            raise FieldError(f"field.coefficients = {self.coefficients!r}; allowed: {allowed}")
        if bool(self.map) != (self.shape == "map"):
            allowed = "a file or a folder" if self.shape == "map" else f"none with shape = {self.shape}"
            raise FieldError(f"field.map = {self.map!r}; allowed: {allowed}")
        if self.shape == "map":
            return
        reach = float(np.abs(self.curve().polyline - self.curve().centre).max())
        if reach > _LONGEST:
            raise FieldError(f"field.coefficients: a wall {reach:.3g} m off its centre; allowed: up to {_LONGEST:g} m")

    def curve(self) -> Wall:
        """Wall of the field; raises ValueError for coefficients or a map that do not describe one."""
        return load_map(self.map) if self.shape == "map" else _curve(self)


@lru_cache(maxsize=32)
def _curve(field: WallFields) -> Curve:
    if field.shape == "ellipse":
        return ellipse(*field.half_axes)
    if field.shape == "fourier":
        return Curve(field.coefficients, "field.coefficients")
    return {"egg": EGG, "bean": BEAN}[field.shape]


@configuration(prefix="noise.")
class RangingNoise:
    """Errors of the sensors."""

    range_relative: Fraction = 0.05
    """standard deviation of a range as a share of the range"""
    range_absolute: Annotated[NonNegative, Le(_LONGEST)] = 0.0
    """standard deviation of a range in addition to the relative one [m]"""
    dropout: Fraction = 0.0
    """fraction of single ranges that are lost"""
    outliers: Fraction = 0.0
    """fraction of single ranges that are outliers: any value up to the longest in sight"""
    range_maximum: Annotated[Positive, Le(_FARTHEST)] | None = None
    """greatest range of a sensor, beyond which a ray has no echo [m]; no limit if not given"""
    odometry_noise: Annotated[tuple[float, float], Each(Interval(ge=0.0, le=10.0), FINITE)] = (0.05, 0.05)
    """standard deviations of the odometry's speed [m/s] and turn rate [rad/s], per reading"""
    odometry_bias: Annotated[NonNegative, Le(0.5)] = 0.02
    """relative error of the odometry's speed and turn rate, constant over a run, with a sign drawn from the seed"""

    def ranging(self) -> RangeQuality:
        """Errors of the ranges, as a mission declares them."""
        return RangeQuality(self.range_relative, self.range_absolute, self.dropout, self.outliers, self.range_maximum)

    def odometry(self, slip: tuple[float, float]) -> OdometryQuality:
        """Errors of the odometry, as a mission declares them, with a slip [m/s, rad/s]."""
        return OdometryQuality(self.odometry_noise, self.odometry_bias, slip)


@configuration(prefix="beacons.")
class BeaconFields:
    """Beacons, which estimators such as beacon_bank read in place of the wall."""

    places: Annotated[tuple[tuple[float, float], ...], Each(_PLACE)] = ()
    """place X Y of a beacon [m]; may be given several times"""
    unknown: Annotated[tuple[int, ...], Each(Ge(0))] = ()
    """number of a beacon, from 0 in the order of the places, whose place the estimator is not given; may be given
    several times"""
    read: Annotated[tuple[BeaconKind, ...], TOGETHER] = ("ranges",)
    """readings of each beacon: ranges, bearings, range differences to the first, or several of these"""
    range_noise: Annotated[NonNegative, Le(_LONGEST)] = 0.1
    """standard deviation of a range and of a range difference [m]"""
    range_scale: Fraction = 0.0
    """standard deviation of the relative error of all ranges, constant over a run, drawn from the seed"""
    bearing_noise: Annotated[float, Radians(0.0, math.pi)] = 0.02
    """standard deviation of a bearing [rad]"""
    outliers: Fraction = 0.0
    """fraction of readings that are anything"""
    dropout: Fraction = 0.0
    """fraction of readings that are lost"""
    rate: Annotated[float, TickRate(TICK)] = 10.0
    """rate at which all beacons are read [Hz]"""

    def __post_init__(self) -> None:
        check_beacons(self)
        check_unknown(self)
        if self.unknown and len(self.unknown) == len(self.places) and set(self.read) == {"range-differences"}:
            raise FieldError(
                f"beacons.unknown = {self.unknown!r}, all, with beacons.read = {self.read!r}: beacon 0, to which they "
                "are, is not found; allowed: all but one, or ranges or bearings too"
            )

    def mission(self) -> BeaconMission | None:
        """Beacons as a mission declares them to an estimator; None without any."""
        if not self.places:
            return None
        given = tuple(None if i in self.unknown else place for i, place in enumerate(self.places))
        length = BeaconQuality(self.range_noise, 0.0, self.dropout, self.outliers)
        return BeaconMission(
            given,
            ranges=length if "ranges" in self.read else None,
            bearings=dataclasses.replace(length, absolute=self.bearing_noise) if "bearings" in self.read else None,
            range_differences=length if "range-differences" in self.read else None,
            range_scale=self.range_scale,
            surroundings=_AROUND_UNKNOWN if self.unknown else _AROUND,
            interval=1.0 / self.rate,
        )


@configuration(prefix="mismatch.")
class RangingMismatch:
    """Mismatch of the sensors' true errors to the declared ones; undeclared wheel slip follows from ``friction``."""

    range_noise: Factor = 1.0
    """factor of the standard deviation of a range"""
    outliers: Fraction = 0.0
    """fraction of single ranges that are outliers in addition to the declared ones"""
    range_saturation: Annotated[Positive, Le(_FARTHEST)] | None = None
    """range that a sensor reads in place of every longer one [m]; no saturation if not given"""
    mounting: Annotated[float, Interval(ge=-180.0, le=180.0), FINITE] = 0.0
    """angle by which the range sensors are turned off their directions, counter-clockwise [deg]"""
    odometry_bias: Annotated[NonNegative, Le(0.5)] = 0.0
    """relative error of the odometry in addition to the declared one, constant over a run"""

    def ranging(self, declared: RangeQuality) -> RangeQuality:
        """True errors of the ranges."""
        return dataclasses.replace(
            declared,
            relative=self.range_noise * declared.relative,
            absolute=self.range_noise * declared.absolute,
            outliers=declared.outliers + self.outliers,
        )

    def odometry(self, declared: OdometryQuality) -> OdometryQuality:
        """True errors of the odometry."""
        return dataclasses.replace(declared, bias=declared.bias + self.odometry_bias)


@configuration
class RangeLocalisationConfig(ChanceFields):
    """Fields of the scenario."""

    field: WallFields = dataclasses.field(default_factory=WallFields)
    sensors: SensorDirections = (-60.0, 60.0)
    """directions of the range sensors off the heading [deg]"""
    mounting: Annotated[tuple[tuple[float, float], ...], Each(_MOUNTED)] = ()
    """place X Y of the range sensors, ahead of the middle of the axle and to its left [m]: given once for all, or once
    for each; at the middle of the axle if not given"""
    start: Annotated[tuple[float, float, float], THREE_FINITE_NUMBERS] | None = None
    """start X Y HEADING [m, m, deg]; drawn from the seed if not given"""
    start_known: bool = False
    """whether the estimator knows the start"""
    start_error: tuple[float, float, float] = _START_ERROR
    """standard deviations X Y HEADING of the known start [m, m, deg]; only with start_known"""
    drive: DriveName = "ideal"
    """drive; ideal: the exact motion of a unicycle; differential: wheels and casters on a floor, in MuJoCo"""
    friction: Annotated[float, Interval(ge=0.01, le=10.0), FINITE] = 1.0
    """friction coefficient of the differential drive's wheels on the floor"""
    duration: Annotated[float, Interval(ge=TICK, le=3600.0), FINITE, whole_ticks(TICK)] = 20.0
    """duration of the run [s]"""
    speed_max: Annotated[Positive, Le(3.0)] = 1.0
    """bound of the speed [m/s]"""
    turn_rate_max: Annotated[float, Radians(0.0, 10.0, open_low=True, unit="rad/s")] = 2.0
    """bound of the turn rate [rad/s]"""
    margin: Annotated[float, Interval(ge=RADIUS, le=_LONGEST), FINITE] = 0.3
    """distance of the robot's centre from the wall in plans and drawn starts [m]; slipping wheels may violate it"""
    outage: Annotated[tuple[tuple[float, float], ...], Each(_OUTAGE)] = ()
    """outage T0 T1 [s] of the ranges, from T0 to T1; may be given several times"""
    noise: RangingNoise = dataclasses.field(default_factory=RangingNoise)
    mismatch: RangingMismatch = dataclasses.field(default_factory=RangingMismatch)
    beacons: BeaconFields = dataclasses.field(default_factory=BeaconFields)

    def __post_init__(self) -> None:
        if self.noise.outliers + self.mismatch.outliers > 1.0:
            raise FieldError(
                f"mismatch.outliers = {self.mismatch.outliers!r} with noise.outliers = {self.noise.outliers!r}; "
                "allowed: together at most 1"
            )
        if len({angle % 360.0 for angle in self.sensors}) < len(self.sensors):
            raise FieldError(f"sensors = {self.sensors!r} holds one direction twice; allowed: different directions")
        if len(self.mounting) not in {0, 1, len(self.sensors)}:
            raise FieldError(
                f"mounting = {self.mounting!r} for {len(self.sensors)} sensors; allowed: one place, or one for each"
            )
        for value in self.start_error[:2]:
            check(value, "start_error", 0.0, _LONGEST)
        check_angle(self.start_error[2], "start_error: its heading", Degrees(0.0, 180.0))
        if self.start is not None:
            check_angle(self.start[2], "start: its heading", Degrees())
        if self.start_error != _START_ERROR and not self.start_known:
            raise FieldError(
                f"start_error = {self.start_error!r} with start_known = False; allowed: with start_known = True"
            )
        if self.friction != 1.0 and self.drive == "ideal":
            raise FieldError(f"friction = {self.friction!r} with drive = ideal; allowed: with a differential drive")
