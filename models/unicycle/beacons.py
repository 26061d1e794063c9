"""The task of a unicycle that reads beacons or landmarks: points whose places are known, or not.

A pose is x = (x_1, x_2, phi) [m, m, rad], an input u = (u_1, u_2), the speed [m/s] and the turn rate [rad/s]. Of beacon
i at b_i, at the distance rho_i = |b_i - (x_1, x_2)|, a robot reads one or more of

    range               (1 + c) rho_i                            [m]
    bearing             angle(b_i - (x_1, x_2)) - phi            [rad] counter-clockwise from the heading
    range difference    (1 + c) (rho_i - rho_0)                  [m] time difference of arrival times the wave's speed

each with noise. The scale error c of all ranges is constant and not known, as of a wave whose speed is not known well.
A reading is an array with an entry for each beacon, NaN where one is missing; beacons may be read one after the other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, ClassVar

import numpy as np

from mathnavi.interfaces.bounds import Condition, Each, Fraction, NonNegative, Positive, configuration
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.protocols import Sensor, StateView
from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.models.beacon_names import BEARINGS, DIFFERENCES, RANGES
from mathnavi.models.unicycle.mission import TICK, RangingMission, WheelOdometry
from mathnavi.models.unicycle.motion import UnicycleMotion
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality

LEAST_NOISE = 1e-4  # [m, rad] least noise that an estimator assumes of a reading, however small the declared one is

Place = tuple[float, float]
Places = Annotated[
    tuple[Place | None, ...],
    Condition(len, "one beacon or more, each two numbers, a place in the plane, or None"),
    Each(Condition(lambda place: place is None or all(map(math.isfinite, place)), "finite places, None if not known")),
]


@configuration
class BeaconQuality:
    """Declared errors of one kind of reading: Gaussian, of variance (relative rho)^2 + absolute^2; losses and outliers.

    A fraction ``outliers`` is anything that a sensor can read.
    """

    absolute: NonNegative = 0.0  # [m], of a bearing [rad]
    relative: Fraction = 0.0  # of the distance rho; of a range difference of its magnitude
    dropout: Fraction = 0.0  # fraction of readings that are lost
    outliers: Fraction = 0.0  # fraction of readings that are anything


@configuration
class BeaconMission(UnicycleMotion):
    """A robot that reads beacons at ``beacons`` (n, 2) [m], of which those that are None are at places to be found.

    Raises MissionError if it reads nothing, if two beacons are at the same place, for range differences to fewer than
    two beacons, and where all are at unknown places, for range differences alone: they find a beacon once the other is
    found.
    """

    beacons: Places  # (n, 2) [m]; None: not known
    ranges: BeaconQuality | None = None  # None: it does not read them
    bearings: BeaconQuality | None = None
    range_differences: BeaconQuality | None = None  # to beacon 0, whose own is not read
    range_scale: Fraction = 0.0  # standard deviation of c
    odometry: OdometryQuality = field(default_factory=OdometryQuality)
    """errors of the speed and of the turn rate; a constant relative error is that of each by itself"""
    odometry_is_input: bool = False
    """whether the inputs of a log are the odometry, each from its time to the next, in place of readings"""
    start: KnownStart | None = None  # None: anywhere
    surroundings: Positive = 10.0
    """[m] by which the robot and a beacon to be found may be outside the box around all known beacons and the start"""
    interval: Positive | None = None  # [s] between readings of beacons; the period if not given
    speed_max: Positive = 1.0  # [m/s]
    turn_rate_max: Positive = 2.0  # [rad/s]
    period: Positive = TICK  # [s] of odometry and estimator

    def __post_init__(self) -> None:
        places = (None if place is None else tuple(map(float, place)) for place in self.beacons)
        object.__setattr__(self, "beacons", tuple(places))  # of NumPy's numbers, which are given too
        if all(quality is None for quality in self.qualities):
            raise MissionError(f"the robot reads nothing of its beacons; allowed: {RANGES}, {BEARINGS}, {DIFFERENCES}")
        known = [place for place in self.beacons if place is not None]
        if len(set(known)) < len(known):
            raise MissionError(f"beacons = {self.beacons!r} holds one place twice; allowed: different places")
        if self.range_differences is not None and len(self.beacons) < 2:
            raise MissionError("range differences to one beacon; allowed: two beacons or more")
        if self.ranges is None and self.bearings is None and len(self.unknown) == len(self.beacons):
            raise MissionError(
                f"beacons = {self.beacons!r} with range differences alone: beacon 0, to which they are, is not found; "
                "allowed: a place that is known, or ranges or bearings too"
            )

    @property
    def unknown(self) -> tuple[int, ...]:
        """Numbers of the beacons whose places are not known."""
        return tuple(i for i, place in enumerate(self.beacons) if place is None)

    @property
    def qualities(self) -> tuple[BeaconQuality | None, ...]:
        """Qualities of the three kinds of readings; None for one that the robot does not read."""
        return self.ranges, self.bearings, self.range_differences

    @property
    def input_size(self) -> int:
        """Number 2 of inputs: speed and turn rate."""
        return 2

    @property
    def places(self) -> Array:
        """Places (n, 2) [m] of the beacons, NaN where they are not known."""
        return np.array([(math.nan, math.nan) if place is None else place for place in self.beacons])

    @property
    def box(self) -> tuple[Array, Array]:
        """Least and largest position (2,) [m] at which the robot may be at the start."""
        places = [place for place in self.beacons if place is not None]
        if self.start is not None and self.unknown:
            places.append(self.start.pose[:2])
        corners = np.array(places or [(0.0, 0.0)])
        return corners.min(axis=0) - self.surroundings, corners.max(axis=0) + self.surroundings

    @property
    def longest(self) -> float:
        """Length [m] of the diagonal of the box: no range is longer while the robot is in it."""
        low, high = self.box
        return float(np.linalg.norm(high - low))

    def sensors_carried(self) -> tuple[Sensor, ...]:
        """Make the sensors of one run: those of the beacons that are read, and "odometry" (2,) [m/s, rad/s]."""
        rate = 1.0 / (self.interval or self.period)
        read = tuple(
            BeaconSensor(self.places, kind, quality, self.longest, self.range_scale, rate)
            for kind, quality in enumerate(self.qualities)
            if quality is not None
        )
        return read if self.odometry_is_input else (*read, WheelOdometry(self.odometry, 1.0 / self.period))

    def difference(self, x: Array, truth: Array) -> Array:
        """Estimate x (3,) minus the truth (3,) [m, m, rad]."""
        difference: Array = np.asarray(x, np.float64) - truth
        difference[2] = wrapped(difference[2])
        return difference

    def error(self, x: Array, truth: Array) -> tuple[float, float]:
        """Lengths [m] and [rad] of the two parts of ``difference`` between x (3,) and the truth (3,)."""
        differences = self.difference(x, truth)
        return math.hypot(differences[0], differences[1]), abs(float(differences[2]))


@configuration
class BeaconFieldMission(RangingMission):
    """A robot within a wall that can read beacons as well as ranges of the wall; its pose is the one, not modulo
    symmetry, for the beacons tell images of it apart.
    """

    beacons: BeaconMission = field(kw_only=True)
    """beacons and how they are read; all else is that of this mission"""

    @property
    def beacon_mission(self) -> BeaconMission:
        """Mission of an estimator that reads the beacons."""
        return replace(
            self.beacons, odometry=self.odometry, start=self.start, speed_max=self.speed_max,
            turn_rate_max=self.turn_rate_max, period=self.period,
        )  # fmt: skip

    @property
    def wall_mission(self) -> RangingMission:
        """Mission of a robot that reads the wall alone."""
        return RangingMission(**{each.name: getattr(self, each.name) for each in fields(RangingMission)})

    def difference(self, x: Array, truth: Array) -> Array:
        """Estimate x (3,) minus the truth (3,) [m, m, rad]."""
        return self.beacons.difference(x, truth)


def beacons_of(mission: BeaconMission | BeaconFieldMission) -> BeaconMission:
    """Return what a mission says of beacons."""
    return mission.beacon_mission if isinstance(mission, BeaconFieldMission) else mission


def exact_readings(places: Array, kind: int, pose: Array) -> Array:
    """Readings (n,) of beacons at ``places`` (n, 2) from a pose (3,), of a kind, without errors; see the module."""
    offsets = places - pose[:2]
    rho: Array = np.hypot(offsets[:, 0], offsets[:, 1])
    if kind == 1:
        bearings: Array = wrapped(np.arctan2(offsets[:, 1], offsets[:, 0]) - pose[2])
        return bearings
    if kind == 2:
        rho = rho - rho[0]
        rho[0] = np.nan
    return rho


@dataclass
class BeaconSensor:
    """Readings (n,) of one kind of the beacons at ``places`` (n, 2), NaN where one was lost.

    The random numbers drawn do not depend on the size of the errors, so runs that differ in them only see the same
    noise. The scale error of a run is drawn at its first reading.
    """

    places: Array  # (n, 2) [m]
    kind: int
    quality: BeaconQuality
    longest: float  # [m] up to which an outlier may be
    range_scale: float  # standard deviation of c
    rate: float | None  # [Hz]
    partial: ClassVar[bool] = True  # single values of a reading may be NaN
    _scale: float | None = field(default=None, init=False, repr=False)  # c

    @property
    def name(self) -> str:
        """Name of the kind."""
        return (RANGES, BEARINGS, DIFFERENCES)[self.kind]

    @property
    def size(self) -> int:
        """Number n of beacons."""
        return len(self.places)

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the beacons from ``motion``, whose state is led by the pose; ``rng`` draws noise, outliers, losses."""
        if self._scale is None:
            self._scale = self.range_scale * float(rng.standard_normal())
        quality, n = self.quality, self.size
        exact = exact_readings(self.places, self.kind, motion.x[:3])
        scaled = exact if self.kind == 1 else (1.0 + self._scale) * exact
        length = exact_readings(self.places, 0, motion.x[:3]) if self.kind == 1 else np.abs(exact)
        reading = scaled + np.hypot(quality.relative * length, quality.absolute) * rng.standard_normal(n)
        chance, anything = rng.random(n), rng.random(n)
        low, high = ((0.0, self.longest), (-math.pi, math.pi), (-self.longest, self.longest))[self.kind]
        reading = np.where((chance < quality.outliers) & np.isfinite(exact), low + (high - low) * anything, reading)
        if self.kind == 1:
            reading = wrapped(reading)
        return np.where(rng.random(n) < quality.dropout, np.nan, reading)
