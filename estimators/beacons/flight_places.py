"""A flight that finds the places of beacons which it was not given, and then flies by them too.

A carrier, the filter with its monitor by fixes and by what is read of beacons at known places, never sees what is read
of the others: ranges, bearings, and range differences to beacon 0, whose place is known. That is kept with all other
readings of the last minute, and searched every two seconds (``flight_place_search``). Once a place is believed, the
joint filter of flight and places goes on with each new reading, and its state is what is published. It has used each
reading once, and the carrier is what it was: so both can be compared. Where the means of the innovations of one of a
place's numbers or of their squares, over the last readings, or the distance from the carrier, cannot be chance, all
places are dropped: the carrier's estimate is published, and places are searched again from readings since then. So they
are where a test of the carrier alarms, or the channels change that it leaves out; those are not used for places either.

Where the carrier has too few readings, such as without fixes, but none of its tests alarms, the joint filter goes on by
the beacons that it has found. Nothing else tells how right that is: the status is DEGRADED.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.beacons.flight_joint import OUTLIER, JointFlight, Noise, Step
from mathnavi.estimators.beacons.flight_place_search import CHANCE, Kept, PlaceSearch
from mathnavi.estimators.flight_model import AxisModel, KalmanConfig, clipped_rms
from mathnavi.estimators.integrity.guard import alone
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.reading_counts import COUNTS, Unused
from mathnavi.interfaces.signal_names import figure_names
from mathnavi.interfaces.signals import Array, Estimate, Integers, Measurement, Status
from mathnavi.models.aerial.beacon_readings import AZIMUTH, DIFFERENCE, LEAST_ANGLE, RANGE, BeaconRows
from mathnavi.models.aerial.beacons import FlightBeacons
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.beacon_names import BEARINGS

_MEMORY, _EVERY = 60.0, 2.0  # [s] for which readings are kept, and between two searches
_STEPS = 40  # of a filter that a search takes in one update
_WINDOWS = (3, 10, 30)  # innovations
_CARRIES = {RANGE: 3, AZIMUTH: 2, DIFFERENCE: 3}  # numbers of a kind that carry a flight without fixes
_FIXES = "position"


@runtime_checkable
class WholeState(Protocol):
    """An estimator of a flight with the whole state of its filter."""

    @property
    def moments(self) -> tuple[Array, Array] | None:
        """State (p, v, g) (9,) and covariance (9, 9); None where these do not describe what it knows."""


class PlacedFlight:
    """Estimator of a flight among beacons, some of them at unknown places.

    ``extra["beacon_places"]`` (n, 3) [m] are the places of all beacons, as given or as found, NaN for those that are
    not, and ``extra["beacon_places_covariance"]`` (n, 3, 3) [m^2] their covariances.
    """

    def __init__(
        self, carrier: Estimator, config: KalmanConfig, mission: FlightMission, beacons: FlightBeacons
    ) -> None:
        self.period = carrier.period
        self._carrier, self._beacons, self._fixes = carrier, beacons, config.fixes
        self._unknown, n = beacons.unknown, len(beacons.places)
        self._known = tuple(i for i in range(n) if i not in self._unknown)
        self._channels = np.append(self._known, np.arange(n, n + 3 * self._fixes)).astype(np.int64)
        self._rows = rows = BeaconRows(beacons, config.noise_floor, LEAST_ANGLE)
        names = [*beacons.names(), *(f"fix {axis}" for axis in "xyz" if config.fixes)]
        self.figures: Mapping[str, tuple[str, ...]] = {**figure_names(carrier), "left_out": tuple(names)}
        """names of the numbers of further figures of an estimate"""
        self._given = _values_of_known(beacons)
        starts = {name: rows.slices[name].start for name in self._given}
        self._numbers = np.array(  # rows that the carrier reads, in its order
            [starts[name] + k for name, own in self._given.items() for k in own], dtype=np.int64
        )
        std = max(beacons.noise, config.noise_floor)
        axis = AxisModel(max(clipped_rms(mission.gust), config.gust_floor), mission.gust.time_constant, std)
        fix_variance = max(mission.position_noise, config.noise_floor) ** 2
        self._noise, self._timeout = Noise(axis, rows, fix_variance), config.timeout
        self._window: deque[Kept] = deque()
        self._joint: JointFlight | None = None
        self._search: PlaceSearch | None = None
        self._t = -math.inf  # [s] of the last update
        self._before: tuple[float, Array, Array] | None = None  # t, x and P of the carrier
        self._due = -math.inf
        self._heard = np.full(rows.size, -math.inf)  # [s] of the last number of each row
        self._out = np.zeros(len(self._channels))  # 1 for a channel that the carrier leaves out
        self._tests: dict[int, deque[float]] = {  # of the rows of beacons at unknown places
            k: deque(maxlen=_WINDOWS[-1]) for k in np.flatnonzero(np.isin(rows.beacons, self._unknown)).tolist()
        }
        self._doubted: set[int] = set()
        self._said = dict.fromkeys(self._unknown, "waits for its readings")
        self._malformed = 0

    # ---- readings

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (6,) [m, m/s] at t [s]; ``command`` (3,) [m/s^2] was held since the last call."""
        fixes, readings, given = self._split(measurements)
        estimate = self._carrier.update(t, given, command)
        out = estimate.extra.get("left_out", np.zeros(len(self._out)))
        alarmed = float(estimate.extra["integrity"][0]) >= 1.0
        if alarmed or not np.array_equal(out, self._out):
            self._forget("waits until the flight knows where it is without it")
            self._out = out.copy()
        step = self._step(t, command, fixes, readings)
        self._t = t
        source = alone(self._carrier)
        assert isinstance(source, WholeState)
        moments = None if alarmed else source.moments
        if self._joint is not None:
            self._go_on(step, moments)
        if moments is None or not (estimate.status is Status.OK or out.any()):
            self._window.clear()
            self._search, self._before = None, None
            return self._published(t, estimate)
        if self._before is not None:
            self._keep(step, moments)
        self._before = (t, *moments)
        return self._published(t, estimate)

    def _split(
        self, measurements: Sequence[Measurement]
    ) -> tuple[list[tuple[float, Array]], list[tuple[float, Array]], list[Measurement]]:
        """Fixes (3,) and numbers (m,) since the last update with their times [s], and what the carrier may see."""
        given, fixes, readings = [], [], []
        for each in measurements:
            own = self._rows.slices.get(each.name)
            if own is not None and each.value.shape != (own.stop - own.start,):
                self._malformed += 1
            elif own is not None:
                good = np.isfinite(each.value) & self._rows.possible(each.name, each.value)
                if each.t > self._t:
                    y = np.full(self._rows.size, np.nan)
                    y[own] = np.where(good, each.value, np.nan)
                    readings.append((each.t, y))
                if each.name in self._given:
                    given.append(replace(each, value=each.value[self._given[each.name]]))
            else:
                whole = each.value.shape == (3,) and bool(np.isfinite(each.value).all())
                if each.name == _FIXES and self._fixes and whole and each.t > self._t:
                    fixes.append((each.t, each.value.copy()))
                given.append(each)
        return fixes, readings, given

    def _step(
        self, t: float, command: Array, fixes: list[tuple[float, Array]], readings: list[tuple[float, Array]]
    ) -> Step:
        """Readings without the channels that the carrier leaves out, of beacon 0 with all differences to it."""
        n, out, rows = len(self._beacons.places), self._channels[self._out > 0.0], self._rows
        for at, y in readings:
            y[np.isin(rows.beacons, out) | ((rows.kinds == DIFFERENCE) & (0 in out))] = np.nan
            self._heard[np.isfinite(y)] = at
        for _, fix in fixes:
            fix[out[out >= n] - n] = np.nan
        return Step(t, command.copy(), fixes, readings)

    # ---- places

    def _forget(self, why: str) -> None:
        """Drop all places, and all readings so far."""
        self._joint, self._search, self._before, self._due = None, None, None, -math.inf
        self._window.clear()
        for tests in self._tests.values():
            tests.clear()
        self._said = dict.fromkeys(self._unknown, why)

    def _go_on(self, step: Step, moments: tuple[Array, Array] | None) -> None:
        """Use a step, and test what it says of the places."""
        joint = self._joint
        assert joint is not None
        for k, e in joint.advance(step):
            self._tests[k].append(e)
        alarmed = {int(self._rows.beacons[k]) for k, tests in self._tests.items() if _alarms(tests)}
        wrong = [i for i in joint.numbers if i in alarmed]
        apart = False
        if moments is not None:
            x, P = moments
            d = joint.x[:3] - x[:3]
            apart = float(d @ np.linalg.solve(P[:3, :3], d)) > chdtri(3, CHANCE)
        if wrong or apart:
            self._forget("waits for readings since its place was dropped")
            self._doubted |= set(wrong or joint.numbers)
            for i in wrong:
                self._said[i] = "was dropped: its readings contradict its place"

    def _keep(self, step: Step, moments: tuple[Array, Array]) -> None:
        """Keep a step that the carrier is sure of, and search places that are not known."""
        assert self._before is not None
        self._window.append(Kept(step, *self._before, moments[0][:3].copy()))
        while step.t - self._window[0].t > _MEMORY:
            self._window.popleft()
        if self._search is not None:
            self._search.add(step)
        elif step.t >= self._due:
            placed = () if self._joint is None else self._joint.numbers
            lacking = [i for i in self._unknown if i not in placed]
            self._due = step.t + _EVERY
            if lacking:
                outliers = self._beacons.outliers > 0.0
                self._search = PlaceSearch(self._noise, self._window, self._joint, lacking, outliers)
        if self._search is None or not self._search.go_on(_STEPS):
            return
        self._said |= self._search.said
        if self._search.found:
            self._joint = self._search.joint
            assert self._joint is not None
            self._doubted -= set(self._joint.numbers)
            for tests in self._tests.values():
                tests.clear()
        self._search = None

    # ---- what is said

    def _published(self, t: float, estimate: Estimate) -> Estimate:
        n, joint = len(self._beacons.places), self._joint
        places, covariance = self._beacons.array, np.zeros((n, 3, 3))
        covariance[list(self._unknown)] = np.nan
        if joint is not None:
            for i in joint.numbers:
                places[i], covariance[i] = joint.place(i)
        extra = dict(estimate.extra)
        extra["left_out"] = _spread(estimate.extra.get("left_out"), self._channels, n + 3 * self._fixes, 0.0)
        extra["left_out"][sorted(self._doubted)] = 1.0
        for name in ("innovations", "innovation_std"):
            extra[name] = _spread(estimate.extra.get(name), self._numbers, self._rows.size, math.nan)
        extra |= {"beacon_places": places, "beacon_places_covariance": covariance}
        if self._malformed and COUNTS in extra:
            counts = np.array(extra[COUNTS])
            counts[list(Unused).index(Unused.MALFORMED)] += self._malformed
            extra[COUNTS] = counts
        message, status = estimate.message, estimate.status
        lacking = [i for i in self._unknown if joint is None or i not in joint.numbers]
        if lacking and not message:
            message = "; ".join(f"beacon {i}: {self._said[i]}" for i in lacking)
        if joint is None:
            return replace(estimate, extra=extra, message=message)
        if status is Status.LOST and self._is_carried(t, joint):
            status = Status.DEGRADED
            message = f"flies by beacons at places that it has found, which nothing else confirms: {message}"
        extra["gust"] = joint.x[6:9].copy()
        x, P = joint.x[:6].copy(), joint.P[:6, :6].copy()
        if "protection" in extra:  # of the carrier, from which this differs
            d = (x - estimate.x).reshape(2, 3)
            extra["protection"] = extra["protection"] + np.linalg.norm(d, axis=1)
        return replace(estimate, x=x, covariance=P, status=status, extra=extra, message=message)

    def _is_carried(self, t: float, joint: JointFlight) -> bool:
        """True while as many numbers of a kind are read, of beacons at places given and found, as carry a flight."""
        placed = np.isin(self._rows.beacons, [*self._known, *joint.numbers])
        heard = self._rows.kinds[placed & (t - self._heard <= self._timeout)]
        return any(int((heard == kind).sum()) >= fewest for kind, fewest in _CARRIES.items())


def _values_of_known(beacons: FlightBeacons) -> dict[str, Integers]:
    """Indices of the values that are of beacons at known places, by sensor that the carrier reads."""
    if beacons.known is None:
        return {}
    known = np.flatnonzero(np.isfinite(beacons.array).all(axis=1))
    both = np.append(known, len(beacons.places) + known)
    return {name: both if name == BEARINGS else known for name in beacons.known.sensor_names}


def _spread(values: Array | None, at: Integers, size: int, nothing: float) -> Array:
    """Values (k,) at their places (k,) among ``size``, ``nothing`` elsewhere."""
    out = np.full(size, nothing)
    if values is not None and len(values) == len(at):
        out[at] = values
    return out


def _alarms(innovations: Sequence[float]) -> bool:
    """True where the means of the last normalised innovations, or of their squares, cannot be chance."""
    e = np.array(innovations)
    for length in _WINDOWS:
        last = e[-length:]
        if len(last) == length:
            squares = float(np.minimum(last * last, OUTLIER).sum())
            if squares > chdtri(length, CHANCE) or float(last.sum()) ** 2 / length > chdtri(1, CHANCE):
                return True
    return False


def check_carried(config: KalmanConfig, beacons: FlightBeacons) -> None:
    """MissionError for unknown places where nothing else tells the flight where it is."""
    known = len(beacons.places) - len(beacons.unknown)
    enough = {"ranges": _CARRIES[RANGE], "bearings": _CARRIES[AZIMUTH], "range-differences": _CARRIES[DIFFERENCE] + 1}
    fewest = min(enough[kind] for kind in beacons.read)
    if beacons.unknown and not config.fixes and known < fewest:
        raise MissionError(
            f"beacons {beacons.unknown!r} at unknown places, and {known} at known ones without fixes: nothing tells "
            f"the flight where it is while it finds them; allowed: estimator.fixes, or {fewest} beacons or more at "
            "known places"
        )
