"""Readings "position" of a Lagrangian system's observer: coordinates, variances and the gate that refuses outliers.

A reading is usable if it is a point of the manifold and newer than the last. It may still be wrong. An observer without
a covariance compares it with the distance that the system can have moved: with the reading before, h [s] ago,

    |y - y_before| <= 2 v_max h + 6 sqrt(2) |sigma|

for every joint, and for the turn and the way of every body that moves freely, where v_max [rad/s, m/s] is the mission's
``speed_max`` and sigma the standard deviations of the coordinates. If more than ten readings in a row are refused they
are no outliers: the observer is wrong.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise
from statistics import median_low

import numpy as np

from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.manifold.manifold import CutLocusError, Manifold, greatest_rate
from mathnavi.models.manifold.mission import POSITION, LagrangianMission
from mathnavi.models.mechanism.geometry import MechanismManifold

_TURN = 2.0 * math.pi
_LAST = 4  # readings that say where the next one is
_AHEAD, _SPANS = 1.0, 10.0  # [s], and times that of the last readings, for which a speed lasts at most
_SILENT, _INTERVALS = 0.2, 10.0  # [s], and times the longest interval of the last readings: of a gap, at least
_SLACK = 0.1  # [rad] by which a reading may be beyond a limit or a turn
LASTING = 10
"""readings in a row that are refused, after which the next one is used"""
TOO_FAST = 2.0
"""times the greatest speed of a mission, that nothing is believed to have"""
_DEVIATIONS = 6.0 * math.sqrt(2.0)  # of the difference of two readings
_PROBES = 64  # readings that are rounded to find the error of rounding
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)  # its multiples are spread evenly over [0, 1), for any encoder


class PositionReader:
    """Reader of positions: points of the manifold, in which angles go on from turn to turn.

    An encoder of a hinge may start again after a turn, at 2 pi, at pi or elsewhere. A reading is then the angle nearest
    to where the readings before lead, or the one within the joint's limits. An encoder whose readings are more than a
    turn apart counts turns itself. After a gap the angle is the one nearest to the last; where the joint can have moved
    by a quarter of a turn meanwhile, its turns are not known any more.
    """

    def __init__(self, manifold: Manifold) -> None:
        self._manifold = manifold
        hinges = manifold.hinges if isinstance(manifold, MechanismManifold) else ()
        self._encoders = [_Encoder(*hinge) for hinge in hinges]

    @property
    def unknown_turns(self) -> list[int]:
        """Places in a point of the hinges whose turns are not known."""
        return [encoder.index for encoder in self._encoders if encoder.lost]

    def read(self, reading: Measurement) -> Array | None:
        """Point (size,) of the manifold; None for a reading of another sensor, and for one that is not a point."""
        if reading.name != POSITION:
            return None
        try:
            y = self._manifold.check(reading.value)
        except ValueError:
            return None
        turns = [encoder.turns(reading.t, float(y[encoder.index])) for encoder in self._encoders]
        if any(turns):
            y = y.copy()
            y[[encoder.index for encoder in self._encoders]] += _TURN * np.array(turns)
        return y


class _Encoder:
    """Encoder of one hinge, at ``index`` of a point, whose limits are ``low`` and ``high`` [rad]."""

    def __init__(self, index: int, low: float, high: float) -> None:
        self.index, self._low, self._high = index, low, high
        self._least, self._greatest = math.inf, -math.inf  # [rad] of its readings
        self._last: deque[tuple[float, float]] = deque(maxlen=_LAST)  # [s], [rad] with their turns
        self.lost = False
        """whether its turns are not known since a gap"""

    def turns(self, t: float, angle: float) -> int:
        """Whole turns to add to a reading of t [s]."""
        self._least, self._greatest = min(self._least, angle), max(self._greatest, angle)
        turns = 0 if self._stands(angle) else round((self._expected(t, angle) - angle) / _TURN)
        if not self._last or t > self._last[-1][0]:
            self._last.append((t, angle + _TURN * turns))
        return turns

    def _stands(self, angle: float) -> bool:
        """Return True if a reading needs no turns: the encoder counts them, or it is within the limits of its joint."""
        if self._greatest - self._least > _TURN + _SLACK:
            self.lost = False
            return True
        return self._high - self._low <= _TURN and self._low - _SLACK <= angle <= self._high + _SLACK

    def _expected(self, t: float, angle: float) -> float:
        """Angle [rad] near which the joint is at t [s]: one outlier among the last readings does not matter."""
        if not self._last:
            return 0.5 * (self._low + self._high) if self._high - self._low <= _TURN else angle
        speeds = [(after - before) / (then - at) for (at, before), (then, after) in pairwise(self._last)]
        speed = min(speeds, key=abs, default=0.0)
        last, place = self._last[-1]
        longest = max((then - at for (at, _), (then, _) in pairwise(self._last)), default=math.inf)
        if t - last > max(_SILENT, _INTERVALS * longest):
            self.lost |= max(map(abs, speeds)) * (t - last) > 0.25 * _TURN
            self._last.clear()
            return place
        farthest = max(_AHEAD, _SPANS * (self._last[-1][0] - self._last[0][0]))
        return median_low([before + min(max(t - at, 0.0), farthest) * speed for at, before in self._last])


def innovation(manifold: Manifold, x: Array, y: Array) -> Array | None:
    """Coordinates (n,) of y (size,) about x (size,); None at the cut locus of x."""
    try:
        return manifold.coordinates(x, y)
    except CutLocusError:
        return None


def reading_variance(mission: LagrangianMission, y: Array) -> Array:
    """Variances (n,) [rad^2, m^2] of the coordinates of a reading near y (size,): those of noise plus those of
    rounding, a twelfth of the square of a step.
    """
    manifold, reading = mission.system.manifold, mission.reading
    noise = np.full(manifold.dimension, reading.noise**2)
    return noise + _rounding_variance(mission, y) if reading.resolution else noise


def rounding_steps(mission: LagrangianMission, y: Array) -> Array:
    """Steps (n,) [rad, m] to which the coordinates of a reading near y (size,) are rounded; 0 without encoders."""
    if not mission.reading.resolution:
        return np.zeros(mission.system.manifold.dimension)
    steps: Array = np.sqrt(12.0 * _rounding_variance(mission, y))
    return steps


def _rounding_variance(mission: LagrangianMission, y: Array) -> Array:
    """Variances (n,) [rad^2, m^2] of the rounding of readings that are spread evenly about y (size,)."""
    manifold, reading = mission.system.manifold, mission.reading
    spread = np.outer(np.arange(_PROBES) * _GOLDEN % 1.0 - 0.5, np.ones(manifold.dimension))
    exact = [manifold.point(y, c) for c in spread]
    moved = [manifold.coordinates(p, manifold.rounded(p, reading.resolution)) for p in exact]
    variance: Array = np.mean(np.square(moved), axis=0)
    return variance


class OutlierCounter:
    """Counter that distinguishes single outliers from a lasting deviation."""

    def __init__(self) -> None:
        self._refused = 0  # in a row

    def admits(self, good: bool) -> bool:
        """True if a reading is to be used: if it is good, or if many in a row were refused."""
        self._refused = 0 if good else self._refused + 1
        return self._refused == 0 or self._refused > LASTING


class SpeedGate:
    """Gate that refuses readings that the system cannot have reached."""

    def __init__(self, mission: LagrangianMission, y: Array, variance: Array | None = None) -> None:
        """``y`` is the first reading, ``variance`` (n,) that of its coordinates if it is not the declared one."""
        self._manifold, self._fastest = mission.system.manifold, TOO_FAST * mission.speed_max
        self.learn(reading_variance(mission, y) if variance is None else variance)

    def learn(self, variance: Array) -> None:
        """Assume a variance (n,) of the coordinates of a reading from now on."""
        self._noise = _DEVIATIONS * greatest_rate(self._manifold, np.sqrt(variance))

    def passes(self, moved: Array, h: float) -> bool:
        """True if the system can have reached a reading with coordinates ``moved`` (n,) about the one before, h [s]
        ago.
        """
        return greatest_rate(self._manifold, moved) <= self._fastest * h + self._noise
