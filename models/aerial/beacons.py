"""Beacons of a flight: points at known places to which the vehicle reads slant ranges.

Of beacon i at b_i (3,) [m] in the map frame a vehicle at p (3,) reads, ``rate`` times a second,

    y_i = |p - b_i| + noise,      h = |p - b_i|,      u = (p - b_i) / h,      dh/dp = u',      d2h/dp2 = (I - u u') / h,

NaN where there is no return: a reading was lost, the beacon is beyond the greatest range, or the ground hides it. A
fraction ``outliers`` is anything between zero and the greatest range, or the diagonal of the box around all beacons.

**What ranges tell of a place.** Four beacons that are not in one plane tell it. Beacons in one plane tell it but for
its mirror image on the other side, those on one line but for a circle about the line, and one but for a sphere. The
information of a reading about the position is u u' / noise^2; ``least_information`` is the least eigenvalue of their
sum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.bounds import Condition, Each, Fraction, NonNegative, Positive, configuration
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.protocols import Sensor, StateView
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField

RANGES = "beacon_ranges"
"""name of the sensor, that of a robot's too"""
_NEAREST = 1e-6  # [m] from a beacon, where its direction is anything

SpatialPlace = tuple[float, float, float]
SpatialPlaces = Annotated[
    tuple[SpatialPlace, ...],
    Condition(bool, "one beacon or more"),
    Each(Condition(lambda place: all(map(math.isfinite, place)), "three finite numbers")),
]


@configuration
class FlightBeacons:
    """Beacons at ``places`` (n, 3) [m] in the map frame, and the declared errors of the ranges to them.

    Raises MissionError for two beacons at one place.
    """

    places: SpatialPlaces  # (n, 3) [m] map frame
    noise: NonNegative = 1.0  # [m] standard deviation of a range
    rate: Positive = 10.0  # [Hz] at which all are read
    maximum: Positive | None = None  # [m] greatest range, beyond which there is no return; None: no limit
    dropout: Fraction = 0.0  # fraction of single ranges that are lost
    outliers: Fraction = 0.0  # fraction of single ranges that are anything
    line_of_sight: bool = False  # whether a beacon that the ground hides has no return; else ranges pass through it

    def __post_init__(self) -> None:
        if len(set(self.places)) < len(self.places):
            raise MissionError(f"beacons: places = {self.places!r} holds one place twice; allowed: different places")

    @property
    def array(self) -> Array:
        """Places (n, 3) [m]."""
        return np.array(self.places, dtype=np.float64)

    @property
    def longest(self) -> float:
        """Range [m] up to which an outlier may be."""
        places = self.array
        widest = float(np.linalg.norm(np.ptp(places, axis=0)))
        return self.maximum or max(widest, 1.0)

    def sensor(self, terrain: HeightField) -> SlantRangeSensor:
        """Sensor over a terrain."""
        return SlantRangeSensor(self, terrain, self.rate)

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
    return ranges, offsets / np.maximum(ranges, _NEAREST)[:, None]


def curvature_effects(P: Array, u: Array, h: float) -> tuple[float, float]:
    """Mean [m] and variance [m^2] that the second derivative adds to a range h [m] of direction u (3,), for a position
    of covariance P (3, 3) [m^2].

    tr(A) / 2 and tr(A A) / 2 with A = (I - u u') P / h.
    """
    Pu = P @ u
    along = float(u @ Pu)
    square = float(np.vdot(P, P)) - 2.0 * float(Pu @ Pu) + along * along
    return 0.5 * (float(P.trace()) - along) / h, 0.5 * max(square, 0.0) / (h * h)


def least_information(beacons: FlightBeacons, terrain: HeightField, points: Array) -> Array:
    """Least eigenvalue (k,) of sum u u' over the beacons that ``points`` (k, 3) [m] have a return of.

    Between 0, where a direction is not observed, and a third of the number of beacons. Ranges of variance R are worth
    at least as much as fixes of the position of variance R over this.
    """
    offsets = points[:, None, :] - beacons.array
    u = offsets / np.maximum(np.linalg.norm(offsets, axis=2), _NEAREST)[:, :, None]
    u = u * beacons.returns(terrain, points)[:, :, None]
    values: Array = np.linalg.eigvalsh(np.einsum("kni,knj->kij", u, u))[:, 0]
    return np.maximum(values, 0.0)


@dataclass(frozen=True)
class SlantRangeSensor:
    """Ranges (n,) [m] to the beacons, NaN where there is no return.

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
        """Number n of beacons."""
        return len(self.beacons.places)

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the ranges (n,) [m] of ``motion``; ``rng`` draws noise, outliers and losses."""
        beacons, n = self.beacons, self.size
        exact, _ = slant_ranges(beacons.array, motion.x[:3])
        reading = exact + beacons.noise * rng.standard_normal(n)
        chance, anything, lost = rng.random(n), rng.random(n), rng.random(n)
        reading = np.where(chance < beacons.outliers, beacons.longest * anything, np.abs(reading))
        unread = (lost < beacons.dropout) | ~beacons.returns(self.terrain, motion.x[None, :3])[0]
        if beacons.maximum is not None:  # by its noise
            unread |= reading >= beacons.maximum
        return np.where(unread, np.nan, reading)


class FailingBeacons:
    """A sensor of beacons some of which fail from a time on: stuck at their last range, or off by a constant.

    It counts readings to know the time, and belongs to one vehicle and one run.
    """

    partial: ClassVar[bool] = True

    def __init__(self, sensor: Sensor, failing: tuple[int, ...], begin: float, offset: float | None) -> None:
        """``failing`` are the numbers of the beacons, ``begin`` [s] the time, ``offset`` [m] the error; None: stuck."""
        self.name, self.size, self.rate = sensor.name, sensor.size, sensor.rate
        self._sensor, self._failing, self._begin, self._offset = sensor, list(failing), begin, offset
        self._count = 0
        self._held = np.full(sensor.size, np.nan)  # (n,) [m] last readings before

    def read(self, motion: StateView, rng: np.random.Generator) -> Array | None:
        """Read the ranges (n,) [m] of ``motion``, those of the failing beacons with their error.

        None where all are lost.
        """
        reading = self._sensor.read(motion, rng)
        t = 0.0 if self.rate is None else self._count / self.rate
        self._count += 1
        if reading is None:
            return None
        if t < self._begin:
            self._held = np.where(np.isfinite(reading), reading, self._held)
            return reading
        reading = reading.copy()
        failing = self._failing
        if self._offset is None:
            reading[failing] = np.where(np.isfinite(reading[failing]), self._held[failing], np.nan)
        else:
            reading[failing] = np.abs(reading[failing] + self._offset)
        return reading
