"""Beacons of a flight: points at known places of which the vehicle reads ranges, bearings and range differences.

What is read of a beacon is h of ``beacon_readings`` with noise, ``rate`` times a second, NaN where there is no return:
a reading was lost, the beacon is beyond the greatest range, or the ground hides it. A fraction ``outliers`` is anything
that the sensor can read: of ranges between zero and the greatest range, or the diagonal of the box around all beacons.

**What a reading tells of a place.** Four beacons that are not in one plane tell it by ranges. Beacons in one plane tell
it but for its mirror image on the other side, those on one line but for a circle about the line, and one but for a
sphere. Differences tell what ranges tell to an error that is common to all: they need one beacon more. Bearings have no
mirror image: those of two beacons tell the place, unless it is on their line, and those of one the line that it is on.
``least_information`` is the least eigenvalue of the information about the position of all readings of an instant.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.bounds import Condition, Each, Fraction, NonNegative, Positive, configuration
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.protocols import StateView
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.beacon_readings import DIFFERENCE, LEAST_ANGLE, NEAREST, BeaconRows
from mathnavi.models.angles import wrapped
from mathnavi.models.beacon_names import BEARINGS, DIFFERENCES, RANGES, SENSORS, BeaconKind
from mathnavi.models.terrain.height_field import HeightField

_LEAST_NOISE = 1e-3  # [m]
SpatialPlace = tuple[float, float, float]
SpatialPlaces = Annotated[
    tuple[SpatialPlace | None, ...],
    Condition(len, "one beacon or more"),
    Each(Condition(lambda place: place is None or all(map(math.isfinite, place)), "three finite numbers, or None")),
]


@configuration
class FlightBeacons:
    """Beacons at ``places`` (n, 3) [m] in the map frame, what is read of them, and the declared errors.

    A place that is None is not known: an estimator has to find it by what is read of it. Raises MissionError for two
    beacons at one place, if nothing is read, and for range differences to fewer than two beacons, or to a beacon 0 at a
    place that is not known: places are found one by one, and a difference tells of two.
    """

    places: SpatialPlaces  # (n, 3) [m] map frame; None: not known
    noise: NonNegative = 1.0  # [m] standard deviation of a range, and of each of the two arrivals of a difference
    rate: Positive = 10.0  # [Hz] at which all are read
    maximum: Positive | None = None  # [m] greatest range, beyond which there is no return; None: no limit
    dropout: Fraction = 0.0  # fraction of single readings that are lost
    outliers: Fraction = 0.0  # fraction of single readings that are anything
    line_of_sight: bool = False  # whether a beacon that the ground hides has no return; else readings pass through it
    read: tuple[BeaconKind, ...] = ("ranges",)  # kinds of readings of each beacon; differences are to beacon 0
    bearing_noise: NonNegative = 0.02  # [rad] standard deviation of an azimuth and of an elevation

    def __post_init__(self) -> None:
        places = (None if place is None else tuple(map(float, place)) for place in self.places)
        object.__setattr__(self, "places", tuple(places))  # of NumPy's numbers, which are given too
        known = [place for place in self.places if place is not None]
        if len(set(known)) < len(known):
            raise MissionError(f"beacons: places = {self.places!r} holds one place twice; allowed: different places")
        if not self.read:
            raise MissionError(f"beacons: read is empty; allowed: {', '.join(SENSORS)}")
        if "range-differences" in self.read and len(self.places) < 2:
            raise MissionError("beacons: range differences to one beacon; allowed: two beacons or more")
        if "range-differences" in self.read and self.places[0] is None:
            raise MissionError(
                f"beacons: the place of beacon 0 is not known, with read = {self.read!r}; allowed: a place of beacon 0 "
                "that is known, to which range differences are taken, or no range-differences"
            )

    @property
    def unknown(self) -> tuple[int, ...]:
        """Numbers of the beacons at places that are not known."""
        return tuple(i for i, place in enumerate(self.places) if place is None)

    @property
    def known(self) -> FlightBeacons | None:
        """The beacons at known places alone, with what is read of them; None if nothing is.

        Of a single one there is no difference.
        """
        places = tuple(place for place in self.places if place is not None)
        read = tuple(kind for kind in self.read if kind != "range-differences" or len(places) > 1)
        return replace(self, places=places, read=read) if places and read else None

    @property
    def sensor_names(self) -> tuple[str, ...]:
        """Names of the sensors that read them, in the order of the kinds."""
        return tuple(name for kind, name in SENSORS.items() if kind in self.read)

    @property
    def array(self) -> Array:
        """Places (n, 3) [m], NaN for one that is not known."""
        return np.array([(math.nan,) * 3 if place is None else place for place in self.places], dtype=np.float64)

    @property
    def longest(self) -> float:
        """Range [m] up to which an outlier may be."""
        places = np.array([place for place in self.places if place is not None] or [(0.0, 0.0, 0.0)])
        widest = float(np.linalg.norm(np.ptp(places, axis=0)))
        return self.maximum or max(widest, 1.0)

    def sensors(self, terrain: HeightField) -> tuple[FlightBeaconSensor, ...]:
        """Sensors over a terrain, one for each kind of readings."""
        return tuple(FlightBeaconSensor(self, terrain, self.rate, name) for name in self.sensor_names)

    def returns(self, terrain: HeightField, points: Array) -> NDArray[np.bool_]:
        """True (k, n) for the beacons within reach, and in sight if they need it, of ``points`` (k, 3) [m]."""
        places = self.array
        within = np.ones((len(points), len(places)), dtype=np.bool_)
        if self.maximum is not None:
            within &= np.linalg.norm(points[:, None, :] - places, axis=2) < self.maximum
        if self.line_of_sight:
            for i, place in enumerate(places):
                within[:, i] &= terrain.visible(place, points)
        return within

    def names(self) -> tuple[str, ...]:
        """Names (n,) of the beacons in messages."""
        return tuple(f"beacon {i}" for i in range(len(self.places)))


def slant_ranges(places: Array, p: Array) -> tuple[Array, Array]:
    """Ranges (n,) [m] from p (3,) to ``places`` (n, 3), and their derivatives (n, 3) by p, the unit vectors from each
    beacon.
    """
    offsets = p - places
    ranges = np.sqrt(np.einsum("ij,ij->i", offsets, offsets))
    return ranges, offsets / np.maximum(ranges, NEAREST)[:, None]


def bearings(places: Array, p: Array) -> tuple[Array, Array]:
    """Azimuths (n,) and elevations (n,) [rad] of ``places`` (n, 3) from p (3,); see ``beacon_readings``."""
    q = places - p
    return np.arctan2(q[:, 1], q[:, 0]), np.arctan2(q[:, 2], np.hypot(q[:, 0], q[:, 1]))


def least_information(beacons: FlightBeacons, terrain: HeightField, points: Array) -> Array:
    """Least eigenvalue (k,) [1/m^2] of the information about the position of an instant's readings at ``points`` (k, 3)
    [m], of the beacons that have a return there; 0, where a direction is not observed.

    Readings are worth at least as much as fixes of the position of a variance of one over this. Noise below 1 mm and
    1e-4 rad counts as that.
    """
    rows = BeaconRows(beacons, _LEAST_NOISE, LEAST_ANGLE)
    read = beacons.returns(terrain, points)
    J = np.zeros((len(points), 3, 3))
    for k, p in enumerate(points):
        answered = np.flatnonzero(answers(rows, read[k]))
        if len(answered):
            J[k] = rows.information(p, answered)
    least: Array = np.maximum(np.linalg.eigvalsh(J)[:, 0], 0.0)
    return least


def answers(rows: BeaconRows, read: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """True (m,) for the rows that are read where beacons (n,) have a return: no difference without beacon 0."""
    shared = rows.kinds == DIFFERENCE
    answered: NDArray[np.bool_] = read[rows.beacons] & ~(shared & ((rows.beacons == 0) | (not read[0])))
    return answered


@dataclass(frozen=True)
class FlightBeaconSensor:
    """Sensor of one kind of readings of the beacons, NaN where there is no return: ranges (n,) [m], bearings (2 n,)
    [rad], the azimuths of all beacons before their elevations, or range differences (n,) [m] to beacon 0.

    The random numbers drawn do not depend on the size of the errors, so runs that differ in them only see the same
    noise.
    """

    beacons: FlightBeacons
    terrain: HeightField
    rate: float | None  # [Hz]
    name: str = RANGES
    partial: ClassVar[bool] = True  # single values of a reading may be NaN

    @property
    def size(self) -> int:
        """Number of values: of beacons, or twice that of bearings."""
        return len(self.beacons.places) * (2 if self.name == BEARINGS else 1)

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the beacons from ``motion``; ``rng`` draws noise, outliers and losses."""
        beacons, p, m = self.beacons, motion.x[:3], self.size
        returns = beacons.returns(self.terrain, motion.x[None, :3])[0]
        noise = rng.standard_normal(m)
        chance, anything, lost = rng.random(m), rng.random(m), rng.random(m)
        if self.name == BEARINGS:
            n = len(beacons.places)
            azimuths, elevations = bearings(beacons.array, p)
            wild = chance[:n] < beacons.outliers  # of a beacon both or none
            azimuths = np.where(
                wild, math.pi * (2.0 * anything[:n] - 1.0), azimuths + beacons.bearing_noise * noise[:n]
            )
            elevations = elevations + beacons.bearing_noise * noise[n:]
            elevations = np.where(wild, math.pi * (anything[n:] - 0.5), elevations)
            return np.where(np.tile((lost[:n] < beacons.dropout) | ~returns, 2), np.nan, folded(azimuths, elevations))
        exact, _ = slant_ranges(beacons.array, p)
        reading = exact + beacons.noise * noise
        wild = chance < beacons.outliers
        if self.name == DIFFERENCES:
            reading = np.where(wild, beacons.longest * (2.0 * anything - 1.0), reading - reading[0])
            reading[0] = np.nan
            return np.where((lost < beacons.dropout) | ~returns | (not returns[0]), np.nan, reading)
        reading = np.where(wild, beacons.longest * anything, np.abs(reading))
        unread = (lost < beacons.dropout) | ~returns
        if beacons.maximum is not None:  # by its noise
            unread |= reading >= beacons.maximum
        return np.where(unread, np.nan, reading)


def folded(azimuths: Array, elevations: Array) -> Array:
    """Azimuths (n,) in [-pi, pi) and elevations (n,) in [-pi/2, pi/2] of the same directions, one after the other."""
    elevations = wrapped(elevations)
    over = np.abs(elevations) > 0.5 * math.pi  # past the zenith: the same direction seen from the other side
    elevations = np.where(over, np.copysign(math.pi, elevations) - elevations, elevations)
    return np.concatenate([wrapped(np.where(over, azimuths + math.pi, azimuths)), elevations])


class FailingBeacons:
    """A sensor of beacons some of which fail from a time on: stuck at their last reading, or off by a constant.

    All differences have the arrival from beacon 0 in common: where that is stuck, it is the one of its last reading. It
    counts readings to know the time, and belongs to one vehicle and one run.
    """

    partial: ClassVar[bool] = True

    def __init__(
        self,
        sensor: FlightBeaconSensor,
        failing: Sequence[int],
        begin: float,
        offset: float | None,
        angle: float = 0.0,
    ) -> None:
        """``failing`` are the numbers of the beacons, ``begin`` [s] the time, ``offset`` [m] the error of a length,
        ``angle`` [rad] that of a bearing; ``offset`` None: stuck.
        """
        self.name, self.size, self.rate = sensor.name, sensor.size, sensor.rate
        self._sensor, self._begin = sensor, begin
        self._failing = np.array(failing, dtype=np.int64)
        if self.name == BEARINGS:
            self._failing = np.append(self._failing, self._failing + self.size // 2)
        self._shared = self.name == DIFFERENCES and 0 in failing
        self._is_stuck, self._offset, self._angle = offset is None, offset or 0.0, angle
        self._count = 0
        self._held, self._arrival = np.full(sensor.size, np.nan), 0.0  # last readings before, and range to beacon 0 [m]

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the beacons from ``motion``, those that fail with their error."""
        reading, failing = self._sensor.read(motion, rng), self._failing
        t = 0.0 if self.rate is None else self._count / self.rate
        self._count += 1
        first = math.dist(motion.x[:3].tolist(), self._sensor.beacons.array[0].tolist())
        if t < self._begin:
            self._held, self._arrival = np.where(np.isfinite(reading), reading, self._held), first
            return reading
        if self._is_stuck:
            reading += first - self._arrival if self._shared else 0.0
            reading[failing] = np.where(np.isfinite(reading[failing]), self._held[failing], np.nan)
        elif self.name == BEARINGS:
            reading[failing] += self._angle
            reading = folded(*np.split(reading, 2))
        elif self.name == DIFFERENCES:
            reading[failing] += self._offset
            reading -= self._offset if self._shared else 0.0
        else:
            reading[failing] = np.abs(reading[failing] + self._offset)
        return reading
