"""A flight that finds the places of beacons which it was not given, and then flies by them too.

A carrier, the filter with its monitor by fixes and by the ranges to beacons at known places, never sees the ranges to
the others. These are kept with all other readings of the last minute, and tried every two seconds:

1. A batch fit about the carrier's way finds all places that explain them (``flight_place_fit``).
2. A joint filter of flight and places, ``flight_joint``, is run from the carrier's state before the first of these
   readings, once for each such place. A place is believed if no other is as likely as 1 to e^20, its residuals are
   those of its declared noise, the joint filter agrees with the batch fit, and its deviation sigma is so small that the
   bend of the sphere on which a range leaves it, sigma^2 / (2 rho), is at most half that of the noise.

From then on the joint filter goes on with each new reading, and its state is what is published. It has used each
reading once, and the carrier is what it was: so both can be compared. Where the means of a place's innovations or of
their squares, over the last readings, or the distance from the carrier, cannot be chance, all places are dropped: the
carrier's estimate is published, and places are searched again from readings since then. Where the carrier is not OK, or
leaves a channel out, nothing that it says is used for places, and these are dropped too.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.beacons.flight_joint import OUTLIER, JointFlight, Noise, Step
from mathnavi.estimators.beacons.flight_place_fit import PlaceFit, place_fits
from mathnavi.estimators.flight_model import AxisModel, KalmanConfig, clipped_rms
from mathnavi.estimators.integrity.guard import alone
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.reading_counts import COUNTS, Unused
from mathnavi.interfaces.signals import Array, Estimate, Integers, Measurement, Status
from mathnavi.models.aerial.beacon_readings import BeaconRows
from mathnavi.models.aerial.beacons import FlightBeacons
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.beacon_names import RANGES

_MEMORY, _EVERY = 60.0, 2.0  # [s] for which readings are kept, and between two searches
_FEWEST, _SHORTEST = 30, 5.0  # ranges of a beacon, and time [s] that they span, before it is searched
_MOST = 4  # places that are compared
_EXCLUDED = 20.0  # logarithm of how much likelier the best place is than another one
_CHANCE = 1e-7  # of an alarm of a test
_WINDOWS = (3, 10, 30)  # innovations
_AGREED, _REPEATED = 0.1, 3  # squared distance in deviations of the batch fit from the joint filter; runs until it is
_CARRIES = 3  # beacons at known places that carry a flight without fixes
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
        known = beacons.known
        std = max(beacons.noise, config.noise_floor)
        axis = AxisModel(max(clipped_rms(mission.gust), config.gust_floor), mission.gust.time_constant, std)
        rows = None if known is None else BeaconRows(known, config.noise_floor)
        fix_variance = max(mission.position_noise, config.noise_floor) ** 2
        self._noise = Noise(axis, rows, self._known, fix_variance, std**2)
        self._std = std
        self._window: deque[tuple[Step, float, Array, Array, Array]] = deque()  # with t, p, x and P before and after it
        self._joint: JointFlight | None = None
        self._before: tuple[float, Array, Array] | None = None  # t, x and P of the carrier
        self._due = -math.inf
        self._tests: dict[int, deque[float]] = {i: deque(maxlen=_WINDOWS[-1]) for i in self._unknown}
        self._doubted: set[int] = set()
        self._said = dict.fromkeys(self._unknown, "waits for its ranges")
        self._malformed = 0

    # ---- readings

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (6,) [m, m/s] at t [s]; ``command`` (3,) [m/s^2] was held since the last call."""
        step, given = self._split(t, measurements, command)
        estimate = self._carrier.update(t, given, command)
        out = estimate.extra.get("left_out")
        trusted = estimate.status is Status.OK and (out is None or not out.any())
        source = alone(self._carrier)
        assert isinstance(source, WholeState)
        moments = source.moments if trusted else None
        if moments is None:
            self._forget("waits until the flight knows where it is without it")
            self._before = None
            return self._published(estimate)
        if self._before is not None:
            self._window.append((step, *self._before, estimate.x[:3].copy()))
            while step.t - self._window[0][0].t > _MEMORY:
                self._window.popleft()
            if self._joint is not None:
                self._go_on(step, moments)
            if t >= self._due and (self._joint is None or len(self._joint.numbers) < len(self._unknown)):
                self._search(t, moments)
        self._before = (t, *moments)
        return self._published(estimate)

    def _split(self, t: float, measurements: Sequence[Measurement], command: Array) -> tuple[Step, list[Measurement]]:
        """What was read, and the part of it that the carrier may see."""
        given, fixes, ranges = [], [], []
        n, since = len(self._beacons.places), -math.inf if self._before is None else self._before[0]
        for each in measurements:
            if each.name == RANGES and each.value.shape == (n,):
                y = np.where(np.isfinite(each.value) & (each.value >= 0.0), each.value, np.nan)
                if each.t > since:
                    ranges.append((each.t, y))
                if self._known:
                    given.append(replace(each, value=each.value[list(self._known)]))
            elif each.name == RANGES:
                self._malformed += 1
            else:
                whole = each.value.shape == (3,) and bool(np.isfinite(each.value).all())
                if each.name == _FIXES and self._fixes and whole and each.t > since:
                    fixes.append((each.t, each.value.copy()))
                given.append(each)
        return Step(t, command.copy(), fixes, ranges), given

    # ---- places

    def _forget(self, why: str) -> None:
        """Drop all places, and all readings so far."""
        self._joint, self._due = None, -math.inf
        self._window.clear()
        for i in self._unknown:
            self._tests[i].clear()
            self._said[i] = why

    def _go_on(self, step: Step, moments: tuple[Array, Array]) -> None:
        """Use a step, and test what it says of the places."""
        joint = self._joint
        assert joint is not None
        for i, e in joint.advance(step):
            self._tests[i].append(e)
        wrong = [i for i in joint.numbers if _alarms(self._tests[i])]
        x, P = moments
        d = joint.x[:3] - x[:3]
        apart = float(d @ np.linalg.solve(P[:3, :3], d)) > chdtri(3, _CHANCE)
        if wrong or apart:
            self._forget("waits for ranges since its place was dropped")
            self._doubted |= set(wrong or joint.numbers)
            for i in wrong:
                self._said[i] = "was dropped: its ranges contradict its place"

    def _search(self, t: float, moments: tuple[Array, Array]) -> None:
        """Search places that are not known by all readings that are kept."""
        self._due = t + _EVERY
        placed = () if self._joint is None else self._joint.numbers
        for i in self._unknown:
            if i in placed:
                continue
            fits = self._fits(i)
            if fits and self._believed(i, fits):
                placed = () if self._joint is None else self._joint.numbers

    def _fits(self, i: int) -> list[PlaceFit]:
        """Places that a batch fit finds for beacon i; none where it cannot be known yet."""
        told = [(at, y[i], p, P) for step, _, _, P, p in self._window for at, y in step.ranges if math.isfinite(y[i])]
        if len(told) < _FEWEST or told[-1][0] - told[0][0] < _SHORTEST:
            return []
        y, p = np.array([each[1] for each in told]), np.array([each[2] for each in told])
        P = np.array([each[3][:3, :3] for each in told])
        fits = place_fits(p, P, y, self._std, outliers=self._beacons.outliers > 0.0)
        deviation, limit = fits[0].deviation, self._limit(float(y.min()))
        if len(fits) > _MOST or deviation > 4.0 * limit:
            many = f"its place is known to {deviation:.3g} m, one sigma, in a direction"
            self._said[i] = "other places explain its ranges as well" if len(fits) > _MOST else many
            return []
        return fits

    def _limit(self, rho: float) -> float:
        """Standard deviation [m] of a place up to which its ranges are used, at least rho [m]."""
        return math.sqrt(rho * self._std)

    def _believed(self, i: int, fits: list[PlaceFit]) -> bool:
        """Go on with a joint filter that has beacon i too, if one of the fits is the only one that can be."""
        runs = [self._run(i, fit.place) for fit in fits]
        likelihoods = [run[0].log_likelihood for run in runs]
        best = int(np.argmax(likelihoods))
        if sum(each > likelihoods[best] - _EXCLUDED for each in likelihoods) > 1:
            self._said[i] = "another place explains its ranges as well, such as a mirror image"
            return False
        joint, squares, nearest = runs[best]
        for _ in range(_REPEATED):
            place, P = joint.place(i)
            assert joint.about is not None
            d = place - joint.about[i]
            if settled := float(d @ np.linalg.solve(P, d)) < _AGREED:
                break
            joint, squares, nearest = self._run(i, place)
        place, P = joint.place(i)
        deviation = math.sqrt(float(np.linalg.eigvalsh(P)[-1]))
        if not settled or deviation > self._limit(nearest):
            self._said[i] = f"its place is known to {deviation:.3g} m, one sigma, in a direction"
            return False
        if squares.sum() > chdtri(len(squares), _CHANCE):
            self._said[i] = "no place explains its ranges within their declared noise"
            return False
        joint.about = None
        self._joint = joint
        self._doubted.discard(i)
        for k in joint.numbers:
            self._tests[k].clear()
        return True

    def _run(self, i: int, place: Array) -> tuple[JointFlight, Array, float]:
        """A joint filter over all that is kept, with beacon i about a place and those that were placed before; the
        squares of the innovations of beacon i, and its least range [m].
        """
        told = {k: self._joint.place(k)[0] for k in self._joint.numbers} if self._joint is not None else {}
        _, t, x, P, p = self._window[0]
        about = {k: (each, math.dist(each, p)) for k, each in (*told.items(), (i, place))}
        joint, found = JointFlight(self._noise, t, x, P, about), list[float]()
        for step, *_ in self._window:
            found += [e for k, e in joint.advance(step) if k == i]
        squares = np.minimum(np.square(found), OUTLIER if self._beacons.outliers == 0.0 else 9.0)
        least = min(float(y[i]) for step, *_ in self._window for _, y in step.ranges if math.isfinite(y[i]))
        return joint, squares, least

    # ---- what is said

    def _published(self, estimate: Estimate) -> Estimate:
        n, joint = len(self._beacons.places), self._joint
        places, covariance = self._beacons.array, np.zeros((n, 3, 3))
        covariance[list(self._unknown)] = np.nan
        if joint is not None:
            for i in joint.numbers:
                places[i], covariance[i] = joint.place(i)
        extra = dict(estimate.extra)
        channels = np.append(self._known, np.arange(n, n + 3 * self._fixes)).astype(np.int64)
        extra["left_out"] = _spread(estimate.extra.get("left_out"), channels, n + 3 * self._fixes, 0.0)
        extra["left_out"][sorted(self._doubted)] = 1.0
        for name in ("innovations", "innovation_std"):
            extra[name] = _spread(estimate.extra.get(name), np.array(self._known, dtype=np.int64), n, math.nan)
        extra |= {"beacon_places": places, "beacon_places_covariance": covariance}
        if self._malformed and COUNTS in extra:
            counts = np.array(extra[COUNTS])
            counts[list(Unused).index(Unused.MALFORMED)] += self._malformed
            extra[COUNTS] = counts
        message = estimate.message
        lacking = [i for i in self._unknown if joint is None or i not in joint.numbers]
        if lacking and not message:
            message = "; ".join(f"beacon {i}: {self._said[i]}" for i in lacking)
        if joint is None:
            return replace(estimate, extra=extra, message=message)
        extra["gust"] = joint.x[6:9].copy()
        return replace(estimate, x=joint.x[:6].copy(), covariance=joint.P[:6, :6].copy(), extra=extra, message=message)


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
            if squares > chdtri(length, _CHANCE) or float(last.sum()) ** 2 / length > chdtri(1, _CHANCE):
                return True
    return False


def check_carried(config: KalmanConfig, beacons: FlightBeacons) -> None:
    """MissionError for unknown places where nothing else tells the flight where it is."""
    known = len(beacons.places) - len(beacons.unknown)
    if beacons.unknown and not config.fixes and known < _CARRIES:
        raise MissionError(
            f"beacons {beacons.unknown!r} at unknown places, and {known} at known ones without fixes: nothing tells "
            f"the flight where it is while it finds them; allowed: estimator.fixes, or {_CARRIES} beacons or more at "
            "known places"
        )
