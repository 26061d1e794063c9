"""Check of the readings of beacons against odometry, and against the places of the beacons.

While a robot drives a path of length s and turns by theta, a range changes by s at most, a range difference by 2 s, and
a bearing by -theta, but for the parallax. Of two beacons d apart

    |rho_i - rho_j| <= d <= rho_i + rho_j,        |delta_i| <= d,

rho being ranges from one place, and delta_i the difference to beacon 0, d away from beacon i. Readings in another unit
contradict both, by the ratio of the units; the first needs no place of a beacon. Where only the second is contradicted,
the places are in another unit, or readings and odometry are, and where only the first is, the speed of odometry.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mathnavi.estimators.plausibility.units import (
    CENTIMETRES,
    CENTIMETRES_PER_SECOND,
    CLOCKWISE,
    DEGREES,
    DEGREES_CLOCKWISE,
    DEGREES_PER_SECOND,
    LATITUDES,
    MILLIMETRES,
    MILLIMETRES_PER_SECOND,
    RADIO_SECONDS,
    SOUND_SECONDS,
    Unit,
    fit_only,
)
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.angles import wrapped
from mathnavi.models.beacon_names import BEARINGS, DIFFERENCES, RANGES, SENSORS
from mathnavi.models.unicycle.beacons import LEAST_NOISE, BeaconMission

_OUTLIERS = 0.25  # share of outliers, up to which medians are believed
_FEWEST, _MOST = 12, 400  # windows or pairs that are compared: at least, and of a beacon
_LONG = 10.0  # standard deviations of a reading: length of a path over which it is compared
_TYPICAL = 0.25  # of the longest range: at which a relative error counts
_TOO_FAST, _TOO_SLOW = 4.0, 0.03  # times the path: median change that contradicts it
_STRAIGHT, _CLEAR = 1.0, 0.25  # [rad] of a path, and median change of a robot that says its speed
_LIKELY = 0.12, 1.6  # times the path: median changes of a robot
_LEAST_APART = 1e-12  # [m] of two ranges
_INSTANT = 1.0  # [s] times of waves to beacons are shorter
_SMOOTH, _NOISE = 0.8, 4.0  # share of the changes that are within the path, but for so many standard deviations
_CONTRADICTED, _SLACK, _APART = 3.0, 1.5, 3.0  # factors beyond and within the places; standard deviations of a pair
_LEAST_TURN = 0.3  # [rad] over which bearings are compared
_OFF, _AGREES = 0.8, 0.4  # of the turn: median error of bearings that contradict it, and that agree with it

_LENGTHS, _WAVES = (CENTIMETRES, MILLIMETRES), (SOUND_SECONDS, RADIO_SECONDS)  # in a smaller unit all is smooth
_SPEEDS = (CENTIMETRES_PER_SECOND, MILLIMETRES_PER_SECOND)
_SPEED, _TURN_RATE = "column 0 of odometry, the speed", "column 1 of odometry, the turn rate"


@dataclass(frozen=True, eq=False)
class _Path:
    """Odometry of a log; NaN without one."""

    s: Array  # (n,) [m] length
    heading: Array  # (n,) [rad]


@dataclass(frozen=True, eq=False)
class _Sensor:
    """Readings of beacons of one kind."""

    name: str
    t: Array  # (n,) [s]
    y: Array  # (n, m), NaN where there is none
    sigma: float  # [m, rad] standard deviation of one in the surroundings
    relative: float  # share of a length that it is
    columns: Sequence[str]  # (m,) names; none if they are not known

    @property
    def read(self) -> list[int]:
        """Beacons of which there are readings."""
        found: list[int] = np.flatnonzero(np.isfinite(self.y).any(axis=0)).tolist()
        return found

    def called(self, beacons: Sequence[int]) -> str:
        """Words for columns: the numbers of their beacons, their names, and what they hold."""
        values = f"{np.nanmin(self.y[:, beacons]):.3g} to {np.nanmax(self.y[:, beacons]):.3g}"
        if list(beacons) == self.read:
            return f"{self.name} ({values})"
        many, numbers = "s" * (len(beacons) > 1), ", ".join(map(str, beacons))
        names = f" {', '.join(repr(self.columns[i]) for i in beacons)}," if self.columns else ""
        return f"beacon{many} {numbers} of {self.name} (column{many}{names or ' ' + numbers + ','} {values})"

    def fits(self, what: str, beacons: Mapping[Unit, Sequence[int]]) -> str:
        """Say that columns fit only in these units."""
        parts = [(unit.name, self.called(own), unit.allowed) for unit, own in beacons.items()]
        return fit_only(self.name, what, parts) if parts else ""


def misread(
    mission: BeaconMission,
    t: Array,
    readings: Mapping[str, Array],
    inputs: Array,
    columns: Mapping[str, Sequence[str]],
) -> str:
    """Say in which unit alone the ``readings`` (n, m) by sensor at t (n,) [s] fit; "" if they fit, or do in none.

    ``inputs`` (n, 2) [m/s, rad/s] are the odometry of a mission that has it as an input; ``columns`` (m,) are the names
    of the columns of a sensor, where they are known.
    """
    if mission.odometry_is_input:
        odometry = np.vstack([inputs[:1], inputs[:-1]])  # until each time
    else:
        odometry = readings.get("odometry", np.full((len(t), 2), np.nan))
    path = _path(t, odometry)
    for name, quality in zip(SENSORS.values(), mission.qualities, strict=True):
        if quality is None or name not in readings or quality.outliers > _OUTLIERS:
            continue
        y = np.where(np.isfinite(readings[name]), readings[name], np.nan)
        if not np.isfinite(y).any():
            continue
        longest = min(_TYPICAL * mission.longest, float(np.nanmedian(np.abs(y))))  # in any unit
        relative = 0.0 if name == BEARINGS else quality.relative * longest
        sigma = math.hypot(max(quality.absolute, LEAST_NOISE), relative)
        sensor = _Sensor(name, t, y, sigma, quality.relative, columns.get(name, ()))
        said = _bearings(sensor, path) if name == BEARINGS else _lengths(sensor, path, mission)
        if said:
            return said
    return ""


def _path(t: Array, odometry: Array) -> _Path:
    """Path of odometry (n, 2) [m/s, rad/s], the last reading of which is held."""
    known = np.isfinite(odometry).all(axis=1)
    if not known.any():
        return _Path(np.full(len(t), np.nan), np.full(len(t), np.nan))
    last = np.maximum.accumulate(np.where(known, np.arange(len(t)), int(np.argmax(known))))
    steps = np.diff(t, prepend=t[0])[:, None] * odometry[last]
    return _Path(np.cumsum(np.abs(steps[:, 0])), np.cumsum(steps[:, 1]))


def _windows(at: Array, least: float) -> tuple[Integers, Integers]:
    """Indices (k,) at which windows begin and end over which ``at`` (n,), in order, grows by ``least``."""
    later = np.searchsorted(at, at + least)
    first = np.flatnonzero(later < len(at))
    if len(first):
        first = first[np.unique(np.linspace(0, len(first) - 1, _MOST).astype(np.intp))]
    return first, later[first]


# ---- ranges and range differences


def _lengths(sensor: _Sensor, path: _Path, mission: BeaconMission) -> str:
    """Message about ranges or range differences, or none."""
    low, high = _factors(sensor, mission.places, mission.speed_max)
    changes = {i: _changes(sensor, path, i) for i in sensor.read}
    changes = {i: each for i, each in changes.items() if len(each)}
    pooled = np.concatenate([*changes.values(), np.empty((0, 2))])
    too_long = high * _CONTRADICTED < 1.0
    if len(pooled) < _FEWEST:
        unit = next((each for each in _LENGTHS if too_long and _is_within(each.factor, low, high)), None)
        return "" if unit is None else sensor.fits("the places of the beacons", {unit: sensor.read})
    if too_long and (said := _of_all_lengths(sensor, path, mission.places, low, high)):
        return said
    judged = {i: each for i, each in changes.items() if len(each) >= _FEWEST}
    fast = any(_share(each) > _TOO_FAST for each in judged.values())
    beyond = {i: each for i, each in judged.items() if not _is_smooth(each, sensor.sigma)}
    share = _share(pooled)
    if fast and len(beyond) < len(judged):
        found = _units_of(beyond, sensor.sigma)
        return sensor.fits("odometry", found) if sum(map(len, found.values())) == len(beyond) else ""
    instants = share < _TOO_SLOW and float(np.nanquantile(np.abs(sensor.y), 0.9)) < _INSTANT
    if fast or instants:
        for unit in _LENGTHS if fast else _WAVES:
            if _agrees(pooled * [unit.factor, 1.0], sensor.sigma) and _is_within(unit.factor, low, high):
                return sensor.fits("odometry", {unit: sensor.read})
    if share < _TOO_SLOW and sensor.name == RANGES and _is_within(1.0, low, high):  # far off, differences stay
        return _of_speed(sensor, path)
    return _of_places(sensor, mission, low, high) if _agrees(pooled, sensor.sigma) else ""


def _of_speed(sensor: _Sensor, path: _Path) -> str:
    """Message about odometry where ranges change too little, on paths that are nearly straight too."""
    straight = np.concatenate([_changes(sensor, path, i, _STRAIGHT) for i in sensor.read])
    if len(straight) < _FEWEST or _share(straight) >= _TOO_SLOW:
        return ""
    for unit in _SPEEDS:
        slower = np.concatenate([_changes(sensor, replace(path, s=unit.factor * path.s), i) for i in sensor.read])
        if _agrees(slower, sensor.sigma):
            sure = _share(slower) >= _CLEAR
            return fit_only("odometry", sensor.name, [(unit.name, _SPEED, unit.allowed)]) if sure else ""
    return ""


def _of_all_lengths(sensor: _Sensor, path: _Path, places: Array, low: float, high: float) -> str:
    """Message about readings and odometry in one unit, where the places are in metres."""
    apart = np.ptp(places[np.isfinite(places).all(axis=1)], axis=0).max() > _APART * sensor.sigma
    for unit, speed in zip(_LENGTHS, _SPEEDS, strict=True):
        scaled = replace(sensor, y=unit.factor * sensor.y), replace(path, s=unit.factor * path.s)
        changes = np.concatenate([_changes(*scaled, i) for i in sensor.read])
        if apart and _is_within(unit.factor, low, high) and _agrees(changes, sensor.sigma):
            both = [(unit.name, sensor.called(sensor.read), unit.allowed), (speed.name, _SPEED, speed.allowed)]
            return fit_only(f"{sensor.name} and odometry", "the places of the beacons", both)
    return ""


def _changes(sensor: _Sensor, path: _Path, beacon: int, turn: float = math.inf) -> Array:
    """Changes (k, 2) [m] of the readings of a beacon, and most that they can be, over paths that are longer than noise.

    Of paths on which the robot turns by more than ``turn`` [rad] there is none.
    """
    y = sensor.y[:, beacon]
    rows = np.flatnonzero(np.isfinite(y) & np.isfinite(path.s))
    first, last = _windows(path.s[rows], _LONG * sensor.sigma)
    turned = np.cumsum(np.abs(np.diff(path.heading, prepend=path.heading[:1])))[rows]
    near = turned[last] - turned[first] <= turn
    first, last = first[near], last[near]
    most = (2.0 if sensor.name == DIFFERENCES else 1.0) * (path.s[rows[last]] - path.s[rows[first]])
    return np.column_stack([np.abs(y[rows[last]] - y[rows[first]]), most])


def _share(changes: Array) -> float:
    """Median share of the most by which readings can change."""
    return float(np.median(changes[:, 0] / changes[:, 1]))


def _is_smooth(changes: Array, sigma: float) -> bool:
    """True if readings change by no more than the path allows, but for noise."""
    return float(np.mean(changes[:, 0] <= changes[:, 1] + _NOISE * sigma)) >= _SMOOTH


def _agrees(changes: Array, sigma: float) -> bool:
    """True if readings change by a likely part of what the path allows."""
    return (
        len(changes) >= _FEWEST and _is_smooth(changes, sigma) and _LIKELY[0] <= _share(changes) <= _LIKELY[1]
    )  # fmt: skip


def _units_of(changes: Mapping[int, Array], sigma: float) -> dict[Unit, list[int]]:
    """Beacons by the unit in which their readings agree with odometry."""
    found: dict[Unit, list[int]] = {}
    for i, each in changes.items():
        for unit in _LENGTHS:
            if _agrees(each * [unit.factor, 1.0], sigma):
                found.setdefault(unit, []).append(i)
                break
    return found


def _factors(sensor: _Sensor, places: Array, speed_max: float) -> tuple[float, float]:
    """Least and largest factor of readings that fit the ``places`` (m, 2), but for some; 0 and inf if any do."""
    known = np.isfinite(places).all(axis=1)
    rows, beacons = np.nonzero(np.isfinite(sensor.y) & known)
    y, t, at = sensor.y[rows, beacons], sensor.t[rows], places[beacons]
    if sensor.name == DIFFERENCES:
        d, apart, together, moved = np.linalg.norm(at - places[0], axis=1), np.abs(y), np.full(len(y), np.inf), 0.0 * y
    else:
        lags = range(1, int(known.sum()))
        parts = [
            np.array([np.linalg.norm(at[k:] - at[:-k], axis=1), np.abs(y[k:] - y[:-k]), y[k:] + y[:-k], t[k:] - t[:-k]])
            for k in lags
            if k < len(y)
        ]
        d, apart, together, moved = np.concatenate([*parts, np.empty((4, 0))], axis=1)
        d, apart, together, moved = (each[d > 0.0] for each in (d, apart, together, speed_max * moved))
    finite = np.isfinite(d)
    if finite.sum() < _FEWEST:
        return 0.0, math.inf
    farther = np.where(np.isfinite(together), together, apart)
    noise = _APART * np.hypot(sensor.sigma, sensor.relative * farther) + moved
    low = np.maximum(d - noise, 0.0) / np.maximum(together, _LEAST_APART)
    high = (d + noise) / np.maximum(apart, _LEAST_APART)
    return float(np.median(low[finite])), float(np.median(high[finite]))


def _is_within(factor: float, low: float, high: float) -> bool:
    return low / _SLACK <= factor <= high * _SLACK


def _of_places(sensor: _Sensor, mission: BeaconMission, low: float, high: float) -> str:
    """Message where readings agree with odometry and contradict the places."""
    places = mission.places
    if low > _CONTRADICTED:
        exact = next((each for each in _LENGTHS if low <= 1.0 / each.factor <= high), None)
        unit = exact or next((each for each in _LENGTHS if _is_within(1.0 / each.factor, low, high)), None)
    elif high * _CONTRADICTED < 1.0:
        metres = _factors(sensor, LATITUDES.factor * places, mission.speed_max)
        on_earth = bool((np.nan_to_num(np.abs(places)) <= 180.0).all())
        unit = LATITUDES if on_earth and _is_within(1.0, metres[0] / _CONTRADICTED, metres[1]) else None
    else:
        unit = None
    if unit is None:
        return ""
    shown = f"the places of the beacons ({np.nanmin(places):.6g} to {np.nanmax(places):.6g})"
    return fit_only(sensor.name, "the mission", [(unit.name, shown, unit.allowed)])


# ---- bearings

_BEARINGS = (DEGREES, CLOCKWISE, DEGREES_CLOCKWISE)


def _bearings(sensor: _Sensor, path: _Path) -> str:
    """Message about bearings, or none."""
    off = [i for i in sensor.read if _median(_errors(sensor, path, [i])) > _OFF]
    right = any(_median(_errors(sensor, path, [i])) < _AGREES for i in sensor.read)
    if not off:
        return ""
    if not right:
        for unit in _BEARINGS:
            if _median(_errors(replace(sensor, y=unit.factor * sensor.y), path, sensor.read)) < _AGREES:
                return sensor.fits("the turn rate of odometry", {unit: sensor.read})
        turned = replace(path, heading=DEGREES_PER_SECOND.factor * path.heading)
        if _median(_errors(sensor, turned, sensor.read)) < _AGREES:
            part = DEGREES_PER_SECOND.name, _TURN_RATE, DEGREES_PER_SECOND.allowed
            return fit_only("odometry", sensor.name, [part])
    found: dict[Unit, list[int]] = {}
    for i in off:
        for unit in _BEARINGS:
            if _median(_errors(replace(sensor, y=unit.factor * sensor.y), path, [i])) < _AGREES:
                found.setdefault(unit, []).append(i)
                break
    return sensor.fits("the turn rate of odometry", found)


def _median(errors: Array) -> float:
    """Median of errors (k,); NaN of too few."""
    return float(np.median(errors)) if len(errors) >= _FEWEST else math.nan


def _errors(sensor: _Sensor, path: _Path, beacons: Sequence[int]) -> Array:
    """Errors (k,) of the bearings of beacons as shares of the turns between them, or of a quarter of a turn."""
    shares, turned = [], np.cumsum(np.abs(np.diff(path.heading, prepend=path.heading[:1])))
    for i in beacons:
        y = sensor.y[:, i]
        rows = np.flatnonzero(np.isfinite(y) & np.isfinite(path.heading))
        first, last = _windows(turned[rows], max(_LEAST_TURN, _LONG * sensor.sigma))
        turn = path.heading[rows[last]] - path.heading[rows[first]]
        clear = np.abs(turn) >= 0.5 * _LEAST_TURN
        error = np.abs(wrapped(y[rows[last]] - y[rows[first]] + turn))
        shares.append((error / np.minimum(np.abs(turn), 0.5 * math.pi))[clear])
    return np.concatenate(shares)
