"""The robot that reads beacons as a ``StagewiseModel``, for its filter and its smoother.

The state is that of ``kernels``: the pose, the scale errors of the odometry and that of the ranges, and the places of
beacons that are not known, about which nothing is known at the start. A reading of a stage is an array with the entries
of all sensors in the order of their kinds, NaN where one is missing.

Odometry is the mean input since the reading of odometry before. Where beacons are read in between, the last odometry
is held until then, and what remains of the motion is made up for once the odometry is there: distance and turn over
the whole are those that were read. Where odometry is missing for longer, the robot may have moved in any way that it
can. An input of a piece is (u_1, u_2, w_1, w_2): odometry, and the densities of its noise.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np

from mathnavi.estimators.beacons.kernels import BEARING, DIFFERENCE, STATES, expected, transition
from mathnavi.estimators.stagewise.model import Piece
from mathnavi.estimators.timeout_monitor import is_late
from mathnavi.interfaces.errors import ArgumentError, MissionError
from mathnavi.interfaces.reading_counts import Unused
from mathnavi.interfaces.signals import NOTHING, Array, Measurement
from mathnavi.models.angles import wrapped
from mathnavi.models.beacon_names import RANGES, SENSORS
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.models.unicycle.beacons import LEAST_NOISE, BeaconMission

ODOMETRY = "odometry"
_LEAST_DENSITY = 1e-9  # [m^2/s, rad^2/s] of the noise of odometry
_LARGEST = 6.0  # standard deviations of the scale errors
_MADE_UP = 2.5  # periods between two readings of odometry, over which the former is made up for
_SHORTEST = 0.05  # of a period: what is made up for in less would be a leap
_TOO_FAST = 10.0  # times the robot's limits
_ARC = 9.0  # square of the standard deviations over which an arc's rise counts
_ANYHOW, _LASTS = 0.5, 1.0  # of its limits: how it may move without odometry, and for how long it moves likewise [s]


class BeaconModel:
    """Model of pose, scale errors and m unknown places (x_1, x_2, phi, b_1, b_2, c, places) [m, m, rad, -, -, -, m].

    Raises MissionError if neither the start nor the place of a beacon is known.
    """

    has_constants = True
    """scale errors and places: a fault that reaches these reaches the whole run"""

    def __init__(self, mission: BeaconMission) -> None:
        self.mission = mission
        self.places = mission.places
        self._n = len(self.places)
        self.columns = np.full(self._n, -1)
        """index (n,) in the state of the place of each beacon; -1 for one that is known"""
        self.columns[list(mission.unknown)] = STATES + 2 * np.arange(len(mission.unknown))
        self.placed = self.columns < 0
        """whether (n,) a place is known or was found, so that readings of the beacon say something of the pose"""
        self.size = STATES + 2 * len(mission.unknown)
        self._kinds = [kind for kind, quality in enumerate(mission.qualities) if quality is not None]
        self.names = tuple(tuple(SENSORS.values())[kind] for kind in self._kinds)
        """names of the sensors of beacons"""
        self.rows = self._n * len(self._kinds)
        self.entries = [(kind, i) for kind in self._kinds for i in range(self._n)]
        """kind and beacon of each entry of a reading"""
        if mission.start is None and not any(self.says(*each) for each in self.entries if each != (DIFFERENCE, 0)):
            enough = "two at known places, beacon 0 among them" if self.placed.any() else "a beacon at a known place"
            raise MissionError(
                "neither the start nor the place of a beacon is known, so that nothing says in what frame the pose is; "
                f"allowed: start=KnownStart((0, 0, 0)), the frame of the robot's start, or {enough}"
            )
        lengths = {kind: (2.0 * math.pi if kind == BEARING else mission.longest) for kind in self._kinds}
        self.errors = {}
        """absolute and relative deviation, share of outliers and their length of each kind"""
        for kind in self._kinds:
            quality = mission.qualities[kind]
            assert quality is not None
            absolute = math.hypot(quality.absolute, LEAST_NOISE)
            length = lengths[kind] * (2.0 if kind == DIFFERENCE else 1.0)
            self.errors[kind] = np.array([absolute, quality.relative, quality.outliers, length])
        odometry = mission.odometry
        per_reading = np.square(odometry.noise) + np.square(odometry.slip)
        self.W: Array = per_reading * mission.period + _LEAST_DENSITY  # (2,) [m^2/s, rad^2/s]
        fastest = np.array([mission.speed_max, mission.turn_rate_max])
        self._unknown: Array = np.square(_ANYHOW * fastest) * _LASTS
        self._limits = _TOO_FAST * np.array([mission.speed_max, mission.turn_rate_max])
        self.scales: Array = np.array([odometry.bias, odometry.bias, mission.range_scale])
        """standard deviations (3,) of the scale errors"""
        self._begun: tuple[Array, Array] | None = None  # start that was found
        self._last: Array | None = None  # (2,) odometry
        self._since, self._moved = -math.inf, np.zeros(2)  # [s] of it, and the motion (2,) since

    def __deepcopy__(self, memo: object) -> Self:
        made = copy.copy(self)
        made.placed, made._moved = self.placed.copy(), self._moved.copy()
        return made

    # ---- stages

    def start(self, reading: Array | None) -> tuple[Array, Array] | None:
        if self._begun is not None:
            x, P = self._begun
            return x.copy(), P.copy()
        known = self.mission.start
        if known is None:
            return None
        return self.state(np.array(known.pose)), self.covariance(np.array(known.deviation))

    def begin(self, x: Array, P: Array) -> None:
        """Take a state (d,) and its covariance (d, d) for the start that is not known."""
        self._begun = x.copy(), P.copy()

    def covariance(self, deviation: Array) -> Array:
        """Covariance (d, d) of a pose known to standard deviations (3,), of scale errors as declared, and of places of
        which nothing is known.
        """
        nothing = [self.mission.longest] * (self.size - STATES)
        P: Array = np.diag(np.square([*deviation, *self.scales, *nothing]))
        return P

    def state(self, pose: Array) -> Array:
        """State (d,) at a pose (3,), without scale errors, with unknown places in the middle of the surroundings."""
        middle = np.mean(self.mission.box, axis=0)
        return np.concatenate([pose, np.zeros(3), np.tile(middle, (self.size - STATES) // 2)])

    def inputs(self, begin: float, end: float, measurements: Sequence[Measurement], command: Array) -> Sequence[Piece]:
        h = end - begin
        if self.mission.odometry_is_input:
            return ((h, np.concatenate([command, self.W])),)
        newest, period = self._odometry_at(end, measurements), self.mission.period
        if newest is None:
            held = command if self._last is None else self._last
            self._moved += held * h
            missing = self._last is not None and end - self._since > _MADE_UP * period
            return ((h, np.concatenate([held, self.W + self._unknown if missing else self.W])),)
        u, span = newest, end - self._since
        first, lately = self._last is None, span <= _MADE_UP * period
        if not first and lately and span > h + TIME_TOLERANCE and h > _SHORTEST * period:
            u = (newest * span - self._moved) / h
        self._last, self._since, self._moved = newest, end, np.zeros(2)
        return ((h, np.concatenate([u, self.W if first or lately else self.W + self._unknown])),)

    def restart(self) -> bool:
        return False

    def odometry(self, measurement: Measurement) -> Array | None:
        """Odometry (2,) [m/s, rad/s] of a measurement that is possible; None for another one."""
        if measurement.name != ODOMETRY or self.mission.odometry_is_input:
            return None
        u = np.asarray(measurement.value, np.float64)
        if u.shape != (2,):
            raise ArgumentError(f"a reading of odometry has shape {u.shape}; allowed: (2,)")
        return u if bool((np.abs(u) <= self._limits).all()) else None

    def _odometry_at(self, t: float, measurements: Sequence[Measurement]) -> Array | None:
        found = None
        for each in measurements:
            u = self.odometry(each)
            if u is not None and abs(each.t - t) <= TIME_TOLERANCE and not is_late(each.t, self._since):
                found = u
        return found

    def reading(self, measurement: Measurement) -> Array | None:
        if measurement.name not in self.names:
            return None
        values = np.asarray(measurement.value, np.float64)
        if values.shape != (self._n,):
            raise ArgumentError(f"a reading of {measurement.name} has shape {values.shape}; allowed: ({self._n},)")
        possible = np.isfinite(values)
        if measurement.name == RANGES:
            possible &= values > 0.0
        if not possible.any():
            return None
        first = self.names.index(measurement.name) * self._n
        y = np.full(self.rows, np.nan)
        y[first : first + self._n] = np.where(possible, values, np.nan)
        return y

    def unused(self, measurement: Measurement) -> Unused | None:
        """Reason why nothing of a measurement is used; None for one of which something is, or that is empty."""
        if measurement.name == ODOMETRY and not self.mission.odometry_is_input:
            if self.odometry(measurement) is not None:
                return None
            return Unused.OUT_OF_RANGE if np.isfinite(measurement.value).all() else Unused.NOT_FINITE
        if measurement.name not in self.names:
            return Unused.UNKNOWN_SENSOR
        if self.reading(measurement) is not None:
            return None
        values = np.asarray(measurement.value)
        return Unused.OUT_OF_RANGE if np.isfinite(values).any() else Unused.NOT_FINITE

    # ---- equations

    def says(self, kind: int, i: int) -> bool:
        """True if a reading of beacon i says something of the pose: its place is known or found."""
        return bool(self.placed[i] and (kind != DIFFERENCE or self.placed[0]))

    def finds(self, kind: int, i: int) -> int | None:
        """Number of the beacon whose place follows from a reading of beacon i, as far as it does; None without one.

        A range difference finds either of its two beacons once the other is placed.
        """
        if not self.placed[i]:
            return i if kind != DIFFERENCE or self.placed[0] else None
        return 0 if kind == DIFFERENCE and not self.placed[0] else None

    def contradicted(self, kind: int, i: int) -> int:
        """Number of the beacon at an unknown place that a refused reading of beacon i contradicts: i if it can be."""
        return 0 if kind == DIFFERENCE and self.columns[i] < 0 else i

    def transition(self, x: Array, u: Array, h: float) -> tuple[Array, Array, Array]:
        after: tuple[Array, Array, Array] = transition(x, u[0], u[1], h, u[2], u[3])
        return after

    def residual(self, x: Array, y: Array) -> tuple[Array, Array]:
        r, W = np.full(self.rows, np.nan), np.full((self.rows, self.size), np.nan)
        for row in np.flatnonzero(np.isfinite(y)):
            kind, i = self.entries[row]
            h, H, _, rho = expected(x, kind, i, self.places, self.columns)
            if not H.any() or not self.says(kind, i):
                continue
            absolute, relative, *_ = self.errors[kind]
            sigma = math.hypot(absolute, relative * rho)
            nu = float(y[row]) - h
            r[row], W[row] = (wrapped(nu) if kind == BEARING else nu) / sigma, H / sigma
        return r, W

    def sum(self, x: Array, e: Array) -> Array:
        after: Array = x + e
        after[2] = wrapped(float(after[2]))
        return after

    def difference(self, other: Array, x: Array) -> Array:
        error: Array = other - x
        error[2] = wrapped(float(error[2]))
        return error

    def limits(self, x: Array) -> tuple[Array, Array]:
        """Limits of the error: the scale errors are within six standard deviations."""
        high = np.full(self.size, np.inf)
        high[3:STATES] = np.maximum(_LARGEST * self.scales, 1e-9)
        return -high - x, high - x

    def extra(self, x: Array, P: Array) -> Mapping[str, Array]:
        """Places and their covariance, NaN for one that was not found, if some are not known.

        ``beacons`` (2 n,) [m] are the places of all beacons, two numbers each, ``beacons_covariance`` (2 n, 2 n) [m^2],
        with what the bend of the circles adds to them, on which a beacon can be by other readings than bearings
        (``bend``).
        """
        if not self.mission.unknown:
            return NOTHING
        places, covariance = self.places.ravel().copy(), np.zeros((2 * self._n, 2 * self._n))
        found = [i for i in self.mission.unknown if self.placed[i]]
        at = np.array([[2 * i, 2 * i + 1] for i in found], dtype=np.int64).ravel()
        columns = np.array([[self.columns[i], self.columns[i] + 1] for i in found], dtype=np.int64).ravel()
        places[at] = x[columns]
        covariance[np.ix_(at, at)] = P[np.ix_(columns, columns)]
        for i in found if self.errors.keys() != {BEARING} else ():
            own = slice(2 * i, 2 * i + 2)
            covariance[own, own] += bend(covariance[own, own], math.dist(places[own], x[:2]))
        missing = np.isnan(places)
        covariance[missing, :] = covariance[:, missing] = np.nan
        return {"beacons": places, "beacons_covariance": covariance}

    @property
    def figures(self) -> Mapping[str, tuple[str, ...]]:
        """Names of the numbers of ``extra``."""
        names = tuple(f"beacon {i}, x_{axis} [m]" for i in range(self._n) for axis in (1, 2))
        return {"beacons": names} if self.mission.unknown else {}

    def reported(self, x: Array, P: Array) -> tuple[Array, Array]:
        return x[:3].copy(), P[:3, :3].copy()


def bend(P: Array, rho: float) -> Array:
    """Covariance (2, 2) that the arc adds to that P (2, 2) of a place at a distance rho [m].

    Ranges leave an arc. Along it a place is known to sigma, the root of the largest eigenvalue of P; across it, much
    better. Over three sigma the arc rises by 9 sigma^2 / (2 rho) off its tangent: that counts as a standard deviation
    across it, but no more than sigma.
    """
    values, vectors = np.linalg.eigh(P)
    sigma = math.sqrt(max(float(values[1]), 0.0))
    across = vectors[:, 0] * min(_ARC * sigma * sigma / (2.0 * max(rho, 1e-9)), sigma)
    return np.outer(across, across)
