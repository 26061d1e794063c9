"""The fields of ``range-localisation``. Lengths are in metres, angles in degrees, counter-clockwise."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from mathnavi.models.field.curve import BEAN, EGG, Curve, ellipse
from mathnavi.models.unicycle.entity import RADIUS, DriveName
from mathnavi.models.unicycle.mission import TICK
from mathnavi.models.unicycle.quality import OdometryQuality, RangeQuality
from mathnavi.sim.interfaces.checks import check
from mathnavi.sim.interfaces.number_lists import NumberList

_HALF_AXES = (3.763, math.sqrt(2.0))
_START_ERROR = (0.3, 0.3, 17.0)
_SHORTEST, _LONGEST = 0.5, 20.0  # [m] of a half-axis
_MOST_SENSORS = 64


@dataclass(frozen=True)
class WallFields:
    """The wall."""

    shape: Literal["ellipse", "egg", "bean", "fourier"] = "ellipse"
    """of the wall; egg and bean are as they are"""
    half_axes: tuple[float, float] = _HALF_AXES
    """c_1 and c_2 of an ellipse [m]"""
    coefficients: tuple[tuple[float, float, float, float], ...] = ()
    """A_X B_X A_Y B_Y of the harmonics k = 0, 1, ... of a fourier shape [m], given once for each"""

    def __post_init__(self) -> None:
        for value in self.half_axes:
            if not _SHORTEST <= value <= _LONGEST:
                allowed = f"two finite values from {_SHORTEST:g} to {_LONGEST:g} m"
                raise ValueError(f"field.half_axes = {self.half_axes!r}; allowed: {allowed}")
        if self.half_axes != _HALF_AXES and self.shape != "ellipse":
            raise ValueError(
                f"field.half_axes = {self.half_axes!r} with shape = {self.shape}; allowed: with an ellipse"
            )
        if bool(self.coefficients) != (self.shape == "fourier"):
            allowed = "two rows or more" if self.shape == "fourier" else f"none with shape = {self.shape}"
            raise ValueError(f"field.coefficients = {self.coefficients!r}; allowed: {allowed}")
        reach = float(np.abs(self.curve().polyline - self.curve().centre).max())
        if reach > _LONGEST:
            raise ValueError(f"field.coefficients: a wall {reach:.3g} m off its centre; allowed: up to {_LONGEST:g} m")

    def curve(self) -> Curve:
        """The wall; ValueError for coefficients that make none."""
        return _curve(self)


@lru_cache(maxsize=32)
def _curve(field: WallFields) -> Curve:
    if field.shape == "ellipse":
        return ellipse(*field.half_axes)
    if field.shape == "fourier":
        return Curve(field.coefficients, "field.coefficients")
    return {"egg": EGG, "bean": BEAN}[field.shape]


@dataclass(frozen=True)
class RangingNoise:
    """Errors of the sensors."""

    range_relative: float = 0.05
    """standard deviation of a range over its length"""
    range_absolute: float = 0.0
    """standard deviation of a range beside that [m]"""
    dropout: float = 0.0
    """fraction of single ranges that are lost"""
    outliers: float = 0.0
    """fraction of single ranges that are any value up to the longest in sight"""
    odometry_noise: tuple[float, float] = (0.05, 0.05)
    """standard deviations of the odometry's speed [m/s] and turn rate [rad/s], per reading"""
    odometry_bias: float = 0.02
    """relative error of both, constant over a run, its sign drawn from the seed"""

    def __post_init__(self) -> None:
        check(self.range_relative, "noise.range_relative", 0.0, 1.0)
        check(self.range_absolute, "noise.range_absolute", 0.0, _LONGEST)
        check(self.dropout, "noise.dropout", 0.0, 1.0)
        check(self.outliers, "noise.outliers", 0.0, 1.0)
        for value in self.odometry_noise:
            check(value, "noise.odometry_noise", 0.0, 10.0)
        check(self.odometry_bias, "noise.odometry_bias", 0.0, 0.5)

    def ranging(self) -> RangeQuality:
        """Errors of the ranges, as a mission declares them."""
        return RangeQuality(self.range_relative, self.range_absolute, self.dropout, self.outliers)

    def odometry(self, slip: tuple[float, float]) -> OdometryQuality:
        """Errors of the odometry, as a mission declares them, with a slip [m/s, rad/s]."""
        return OdometryQuality(self.odometry_noise, self.odometry_bias, slip)


@dataclass(frozen=True)
class RangeLocalisationConfig:
    """Fields of the scenario."""

    field: WallFields = dataclasses.field(default_factory=WallFields)
    sensors: NumberList = (-60.0, 60.0)
    """directions of the range sensors off the heading [deg]"""
    start: tuple[float, float, float] | None = None
    """X Y HEADING [m, m, deg]; drawn from the seed if not given"""
    start_known: bool = False
    """whether the estimator knows the start"""
    start_error: tuple[float, float, float] = _START_ERROR
    """standard deviations of the known start, X Y HEADING [m, m, deg]; with a start that is known"""
    drive: DriveName = "ideal"
    """ideal: the exact motion of a unicycle; differential: wheels and casters on a floor, in MuJoCo"""
    friction: float = 1.0
    """of the wheels of the differential drive on the floor"""
    duration: float = 20.0
    """of the run [s]"""
    speed_max: float = 1.0
    """bound of the speed [m/s]"""
    turn_rate_max: float = 2.0
    """bound of the turn rate [rad/s]"""
    margin: float = 0.3
    """distance of the robot's centre to the wall that plans and drawn starts keep; wheels that slip may not [m]"""
    outage: tuple[tuple[float, float], ...] = ()
    """T0 T1: no ranges from T0 to T1 [s]; may be given several times"""
    noise: RangingNoise = dataclasses.field(default_factory=RangingNoise)

    def __post_init__(self) -> None:
        _check_sensors(self.sensors)
        if self.start is not None and not all(math.isfinite(value) for value in self.start):
            raise ValueError(f"start = {self.start!r}; allowed: three finite numbers")
        for value, largest in zip(self.start_error, (_LONGEST, _LONGEST, 180.0), strict=True):
            check(value, "start_error", 0.0, largest)
        if self.start_error != _START_ERROR and not self.start_known:
            raise ValueError(
                f"start_error = {self.start_error!r} with start_known = False; allowed: with start_known = True"
            )
        check(self.friction, "friction", 0.01, 10.0)
        check(self.duration, "duration", TICK, 3600.0)
        if abs(self.duration / TICK - round(self.duration / TICK)) > 1e-6:
            raise ValueError(f"duration = {self.duration!r}; allowed: a whole number of ticks of {TICK:g} s")
        check(self.speed_max, "speed_max", 0.0, 3.0, open_low=True)
        check(self.turn_rate_max, "turn_rate_max", 0.0, 10.0, open_low=True)
        check(self.margin, "margin", RADIUS, _LONGEST)
        if self.friction != 1.0 and self.drive == "ideal":
            raise ValueError(f"friction = {self.friction!r} with drive = ideal; allowed: with a differential drive")
        for begin, end in self.outage:
            if not (math.isfinite(end) and 0.0 <= begin < end):
                raise ValueError(f"outage = {(begin, end)!r}; allowed: two finite times, 0 <= T0 < T1")


def _check_sensors(angles: tuple[float, ...]) -> None:
    if not 1 <= len(angles) <= _MOST_SENSORS:
        raise ValueError(f"sensors = {angles!r}; allowed: 1 to {_MOST_SENSORS} directions")
    for angle in angles:
        if not (math.isfinite(angle) and abs(angle) <= 360.0):
            raise ValueError(f"sensors = {angles!r}; allowed: finite directions from -360 to 360 degrees")
    if len({angle % 360.0 for angle in angles}) < len(angles):
        raise ValueError(f"sensors = {angles!r} holds one direction twice; allowed: different directions")
