"""The Kalman filter of a flight that reads beacons, instead of position fixes or in addition.

The state x = (p, v, g) (9,) is position, velocity and gust, with the model of each axis of ``kalman``, which is exact
over any time. Readings of an instant are used one after the other, each by the second-order extended Kalman filter,
which is exact for h up to its second derivatives. With H = (dh/dp, 0, 0), A = (d2h/dp2) P_pp, and the noise R,

    nu = y - h(p) - tr(A) / 2,    S = H P H' + R + tr(A A) / 2,    K = P H' / S,
    x <- x + K nu,                P <- P - K S K',

so that near a beacon a range says less of the place than a straight line would have it, and an azimuth nothing below
or above one. Range differences share the noise of one arrival, which is a number of the state for that long (``Side``).

Where the position is so uncertain that no derivative at it means anything, readings are used only if those of an
instant tell a place by themselves (``flight_geometry.located``), which is a fix.

**Mirror images.** The ranges to beacons in one plane, or nearly, and their differences, fit the mirror image too; a
bearing does not. The start is known, and so the side, until the position may be on the other: by its Gaussian, with the
probability of a tail, or where that covers both, as likely as not. From when on both are apart, two filters are run,
one on either side, until one is 1e5 times as likely by four numbers or more: the input is known, and the motion that it
causes on the other side is the mirrored one only without any.

**What is said OK**: readings come, those of beacons at fault are left out (``flight_witness``), the standard deviation
of the position is at most ``position_std_max`` in every direction, and no image is left that is farther away than that;
the covariance covers both. With fewer than three numbers, four ranges in a plane, or ranges on a line, a direction is
not observed or seldom, and its variance grows as that of dead reckoning does: the estimate is OK for as long as that is
within the bound. Once it was not, ranges to beacons on a line do not make it OK again: derivatives at a wrong place
seem to tell the angle about the line. With three numbers nothing reveals a fault of one of them that grows slower than
gusts would explain.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtri, log_ndtr

from mathnavi.estimators.beacons.flight_geometry import (
    EXCLUDED,
    beacons_of_rows,
    image_separation,
    located,
    plane_of,
)
from mathnavi.estimators.beacons.flight_quality import axis_model, beacons_of, start_covariance, thrice
from mathnavi.estimators.beacons.flight_separation import FlightSeparation
from mathnavi.estimators.beacons.flight_side import Side
from mathnavi.estimators.beacons.flight_witness import FIXES, UNREFERENCED, UNTRUSTED, BeaconWitness
from mathnavi.estimators.flight_leaps import Leaps
from mathnavi.estimators.flight_model import KalmanConfig
from mathnavi.estimators.integrity.guard import Guarded
from mathnavi.estimators.integrity.innovations import LATCHED
from mathnavi.estimators.timeout_monitor import InnovationMean, TimeoutMonitor, is_late, time_ahead, waiting, worst
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused
from mathnavi.interfaces.signals import Array, Estimate, Integers, Measurement, Status
from mathnavi.models.aerial.beacon_readings import (
    AZIMUTH,
    DIFFERENCE,
    LEAST_ANGLE,
    RANGE,
    BeaconRows,
)
from mathnavi.models.aerial.beacons import slant_ranges
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.beacon_names import DIFFERENCES
from mathnavi.models.tolerances import TIME_TOLERANCE

_I9, _I3 = np.eye(9), np.eye(3)
_OUTLIER = float(chdtri(1, 1e-9))
_LASTING = 10  # readings of which most are refused, in a row
_LINEAR = 0.1  # of the nearest range: largest deviation of a position at which a derivative means something
_SURE = math.log(1e5)  # how much likelier one of two sides is, to be the only one
_EVIDENCE = 0.25  # of it that the motion may tell in an instant: what a fault does passes
_NO_SPARE = 3  # numbers, of which each is needed: then a fault of one is no less likely than the other side
_RANGES_ENOUGH, _DIFFERENCES_ENOUGH = 3, 4  # that tell a place but for its mirror image
_FALSE_ALARM, _HORIZON, _EACH = 1e-3, 60.0, 0.25  # in a time [s] in which each quarter of a gust's is a look
_KNOWN = 0.25  # of the gusts' variance: the least that counts as explained of a gust
_COST, _NUMBERS = 2e-4, 6  # [s] of an update, and numbers of an instant up to which that is so


class FlightBeaconFilter:
    """Estimator of position, velocity and gust from readings of beacons, and from fixes if ``fixes`` is set."""

    def __init__(self, config: KalmanConfig, mission: FlightMission) -> None:
        beacons = beacons_of(mission)
        self.period = mission.control_period
        self._rows, self._fixes = BeaconRows(beacons, config.noise_floor, LEAST_ANGLE), config.fixes
        self._model = axis_model(config, mission)
        self._fix_variance = max(mission.position_noise, config.noise_floor) ** 2
        self._bound = config.position_std_max**2
        interval = 1.0 / max(beacons.rate, mission.position_rate if config.fixes else 0.0)
        self._timeout = TimeoutMonitor(config.timeout, interval, of="readings of beacons")
        self._discrete: dict[float, tuple[Array, ...]] = {}
        self._now = Side(np.array([*mission.start, *np.zeros(6)]), thrice(start_covariance(config, mission)))
        self._other: Side | None = None  # on the other side of the plane of the beacons
        self._separation = 0.0  # D of it
        self._instants = max(1.0, beacons.rate * config.timeout)  # at which they are read while it is not lost
        self._likelier = 0.0  # logarithm of how much less likely that is
        self._covers_both = False  # whether the position is on either side as far as its covariance says
        self._wide = False  # whether it was too uncertain since beacons in a plane, or a fix, told the position
        self._t: float | None = None  # [s] of the state
        self._counts, self._since_gap = ReadingCounts(), InnovationMean(_OUTLIER)
        self._heard = np.full(self._rows.size, -math.inf)  # [s] of the last number used of each row
        self._refused = 0  # readings in a row of which most numbers were refused
        self._arrived = dict.fromkeys(self._rows.slices, -math.inf)  # [s] of the last reading of each sensor
        self._nu = np.full((2, self._rows.size), np.nan)  # innovations of the last readings, and their deviations
        self._pending: dict[str, Array] = {}  # readings of beacons of the time of the state, not used yet
        self._beside = FlightSeparation(
            self._rows, _OUTLIER, self._fix_variance if config.fixes else None, mission.speed_max, self._model.gust_rms
        )
        self._beside.begin(self._now.x, self._now.P)

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (6,) [m, m/s] at t [s]; ``command`` (3,) [m/s^2] was held since the last call.

        ``extra["gust"]`` (3,) [m/s^2] is the estimated gust; ``extra["innovations"]`` (m,) are those of the numbers
        read since the last call, in the order of ``BeaconRows`` [m, rad], NaN where there was none, with the standard
        deviations ``extra["innovation_std"]`` (m,); ``extra["protection"]`` (2,) [m], [m/s] is the protection level of
        position and velocity (``flight_separation``).
        """
        self._nu[:] = np.nan
        for reading in measurements:
            name = DIFFERENCES if reading.name == UNREFERENCED else reading.name
            own = self._rows.slices.get(name)
            if own is None and not (self._fixes and name == FIXES):
                self._counts.add(Unused.UNKNOWN_SENSOR)
            elif is_late(reading.t, self._t):
                self._counts.add(Unused.LATE)
            elif reading.value.shape != (3 if own is None else own.stop - own.start,):
                self._counts.add(Unused.MALFORMED)
            else:
                if own is None or name in self._pending or not self._is_now(reading.t):
                    self._use_pending()
                self._predict(reading.t, command)
                if own is None:
                    self._take(reading.t, reading.value, beacons=False)
                else:
                    self._pending[reading.name] = reading.value
                    self._arrived[name] = reading.t
        self._use_pending()
        self._predict(t, command)
        return self._estimate(t)

    def _is_now(self, t: float) -> bool:
        """True for the time [s] of the state."""
        return self._t is not None and abs(t - self._t) <= TIME_TOLERANCE

    def _use_pending(self) -> None:
        """Use all readings of the beacons of one instant together."""
        if not self._pending:
            return
        y = np.full(self._rows.size, np.nan)
        for name, value in self._pending.items():
            own = DIFFERENCES if name == UNREFERENCED else name
            y[self._rows.slices[own]] = np.where(self._rows.possible(own, value), value, -math.inf)
        referenced = UNREFERENCED not in self._pending
        self._pending = {}
        assert self._t is not None
        self._take(self._t, y, beacons=True, common=self._rows.common if referenced else UNTRUSTED)

    def _predict(self, t: float, command: Array) -> None:
        if self._t is None:
            self._t = t
        h = time_ahead(t, self._t)
        if h <= TIME_TOLERANCE:
            return
        key = round(h, 10)
        if key not in self._discrete:
            F, B, Q = self._model.discretised(h)
            self._discrete[key] = np.ascontiguousarray(F), B, Q, thrice(F), thrice(Q)
        F, B, Q, F_all, Q_all = self._discrete[key]
        effect = np.outer(B, command).ravel()
        for side in self._sides():
            side.predict(F_all, effect, Q_all)
        self._beside.predict(F, effect, Q)
        self._t = t

    def _sides(self) -> tuple[Side, ...]:
        return (self._now,) if self._other is None else (self._now, self._other)

    def _take(self, t: float, value: Array, *, beacons: bool, common: float = 0.0) -> None:
        """Condition on the numbers (m,) of beacons, or the fix (3,), of t [s]; ``common`` [m^2] is the variance of the
        arrival from beacon 0.
        """
        infinite, impossible = np.isinf(value), (value == -math.inf) & beacons
        for reason, numbers in ((Unused.NOT_FINITE, infinite & ~impossible), (Unused.OUT_OF_RANGE, impossible)):
            if numbers.any():
                self._counts.add(reason, int(numbers.sum()))
        good = np.flatnonzero(np.isfinite(value))
        if not len(good):
            return
        self._beside.condition(value, beacons=beacons, common=common)
        if beacons and self._is_lost():
            self._find(t, value, good[(self._rows.kinds[good] != DIFFERENCE) | (common < UNTRUSTED)])
            return
        squares = self._use_all(self._now, value, good, common if beacons else None)
        if self._other is not None:
            self._use_all(self._other, value, good, common if beacons else None, counted=False)
            more, most = self._now.gained - self._other.gained, max(_EVIDENCE, self._separation / 8.0)
            self._likelier += min(max(more, -most), most)
        for side in self._sides():
            side.gained = 0.0
        refused = np.array(squares) > _OUTLIER
        if refused.any():
            self._counts.add(Unused.OUTLIER, int(refused.sum()))
        fits = self._since_gap.fits(np.array(squares), self._timeout.converged)
        self._refused = self._refused + 1 if 2 * refused.sum() > len(good) else 0
        if self._refused > _LASTING:  # the filter is wrong
            self._now.P *= max(squares)
            self._beside.begin_again(self._now.x)
            self._refused, self._other = 0, None
        if not refused.all():
            self._timeout.note(t, agrees=fits)
        if beacons:
            self._heard[good[~refused]] = t
            self._choose_side(t)
        elif not refused.any():
            self._wide = self._covers_both = False

    def _use_all(
        self, side: Side, value: Array, good: Integers, common: float | None, *, counted: bool = True
    ) -> list[float]:
        """Use numbers of beacons, or of a fix if ``common`` is None, one after the other; return their squares."""
        shares = self._rows.kinds[good] == DIFFERENCE if common is not None else np.zeros(len(good), dtype=bool)
        alone, shared = good[~shares], good[shares]
        squares = [self._use(side, k, value[k], common is not None, counted=counted) for k in alone.tolist()]
        if common is None or not len(shared):
            return squares
        before, gained = (side.x, side.P), side.gained
        for variance in (common, UNTRUSTED):
            side.share(variance)
            own = [self._use(side, k, value[k], True, counted=counted) for k in shared.tolist()]
            side.share(None)
            if len(own) == 1 or 2 * sum(each > _OUTLIER for each in own) <= len(own) or variance == UNTRUSTED:
                break
            (side.x, side.P), side.gained = before, gained  # it is the arrival from beacon 0 that is the outlier
        return squares + own

    def _use(self, side: Side, k: int, y: float, of_beacon: bool, *, counted: bool) -> float:
        """Use row k of the beacons, or number k of a fix; return the normalised square of its innovation."""
        shared = of_beacon and bool(self._rows.kinds[k] == DIFFERENCE)
        if of_beacon:
            expected, H, R = side.expected(self._rows, k)
            nu = self._rows.innovation(k, y, expected)
        else:
            H, R = _I3[k], self._fix_variance
            nu = y - float(side.x[k])
        PH, S = side.spread(H, R, shared=shared)
        square = nu * nu / S
        side.gained -= 0.5 * (min(square, _OUTLIER) + math.log(S))
        if of_beacon and counted:
            self._nu[:, k] = nu, math.sqrt(S)
        if square <= _OUTLIER:
            side.condition(PH, nu, S)
        return square

    @property
    def moments(self) -> tuple[Array, Array] | None:
        """State (p, v, g) (9,) of the filter and its covariance (9, 9); None where it may be on either of two sides."""
        return None if self._other is not None else (self._now.x.copy(), self._now.P.copy())

    # ---- what is not known

    def _is_lost(self) -> bool:
        """True where the position is so uncertain that derivatives at it mean nothing."""
        P = self._now.P[:3, :3]
        if float(P.trace()) <= self._bound:  # which is no less than the largest eigenvalue
            return False
        largest = float(np.linalg.eigvalsh(P)[-1])
        h, _ = slant_ranges(self._rows.places, self._now.x[:3])
        return largest > max(self._bound, (_LINEAR * float(h.min())) ** 2)

    def _find(self, t: float, y: Array, good: Integers) -> None:
        """Begin again from readings of an instant that tell a place by themselves."""
        self._other, self._refused = None, 0
        found = located(self._rows, y, good)
        if found is None:
            return
        p, R = found
        x, P = self._now.x, self._now.P
        K = np.linalg.solve(P[:3, :3] + R, P[:3]).T
        kept = _I9.copy()
        kept[:, :3] -= K
        P = kept @ P @ kept.T + K @ R @ K.T
        self._now = Side(x + K @ (p - x[:3]), 0.5 * (P + P.T))
        self._beside.begin_again(self._now.x)
        self._heard[good], self._covers_both, self._wide = t, False, False
        self._timeout.note(t)
        self._timeout.restart(t)

    def _are_apart(self) -> bool:
        """True where it may be on either side, and these are farther from each other than a deviation that is OK."""
        if self._other is None:
            return False
        d = self._other.x[:3] - self._now.x[:3]
        return float(d @ d) > self._bound

    def _is_wide(self) -> bool:
        """True where the standard deviation of the position in a direction is more than is OK."""
        P = self._now.P[:3, :3]
        return float(P.trace()) > self._bound and float(np.linalg.eigvalsh(P)[-1]) > self._bound

    def _choose_side(self, t: float) -> None:
        """Keep a filter on the other side of the plane of the beacons while that may be the right one.

        It may be as far as the Gaussian of the position reaches there, and once that covers both sides alike, both are
        as likely from when on they part again.
        """
        heard = np.flatnonzero(self._heard >= t - self._timeout.longest)
        kinds, places = self._rows.kinds[heard], self._rows.places[beacons_of_rows(self._rows, heard)]
        if self._other is not None:
            if self._likelier < 0.0:
                self._now, self._other, self._likelier = self._other, self._now, -self._likelier
            d = self._other.x[:3] - self._now.x[:3]
            met = float(d @ np.linalg.solve(self._now.P[:3, :3], d)) < 1.0  # readings have led both to one place
            if met or (self._likelier > _SURE and len(heard) > _NO_SPARE):
                self._other = None
        if self._is_wide():  # it may have gone about a line of beacons to the other side of any plane
            self._wide = self._covers_both = True
        elif (kinds == AZIMUTH).any():  # which has no other place to lead to
            self._wide = self._covers_both = False
        plane = plane_of(places)
        if plane is None:
            return
        if (kinds == RANGE).sum() >= _RANGES_ENOUGH or (kinds == DIFFERENCE).sum() >= _DIFFERENCES_ENOUGH:
            self._wide = False
        centre, normal = plane
        P, p = self._now.P[:3, :3], self._now.x[:3]
        deviations = abs(float(normal @ (p - centre))) / math.sqrt(max(float(normal @ P @ normal), 1e-12))
        self._separation = image_separation(self._rows, heard, p)
        if deviations < 1.0:
            self._covers_both, self._other = True, None
        elif self._separation * self._instants > EXCLUDED:
            self._covers_both, self._other = False, None
        else:
            beyond = 0.0 if self._covers_both else float(log_ndtr(-deviations) - log_ndtr(deviations))
            self._covers_both = False
            if beyond > -_SURE:
                if self._other is None:
                    self._other, self._likelier = self._now.image(centre, normal), -beyond
                self._likelier = min(self._likelier, -beyond)

    def _estimate(self, t: float) -> Estimate:
        x, P = self._now.x, self._now.P[:6, :6].copy()
        if self._other is not None:  # either side: one by its probability, where it is far, else both alike
            d = self._other.x[:6] - x[:6]
            P += np.outer(d, d) * (1.0 / (1.0 + math.exp(self._likelier)) if self._are_apart() else 0.5)
        status, message = self._status(t, P)
        heard = np.flatnonzero(self._heard >= t - self._timeout.longest)
        level = self._beside.judge(x, P, heard=heard).copy()
        extra: Mapping[str, Array] = {
            "gust": x[6:].copy(),
            "innovations": self._nu[0].copy(),
            "innovation_std": self._nu[1].copy(),
            "protection": np.full(2, math.inf) if self._are_apart() or status is Status.LOST else level,
            **self._counts.extra,
        }
        return Estimate(t, x[:6].copy(), P, status, extra, message)

    def _status(self, t: float, P: Array) -> tuple[Status, str]:
        status = self._timeout.status(t, P)
        if status is Status.INITIALISING:
            return status, waiting(status, "a reading of a beacon")
        if self._wide:
            return Status.LOST, "has lost its place about a line of beacons, or a single one"
        if self._is_lost():
            return Status.LOST, "does not know where it is well enough to use single readings"
        if self._are_apart():
            return worst(status, Status.DEGRADED), "cannot tell on which side of the plane of its beacons it is"
        if (deviation := math.sqrt(float(np.linalg.eigvalsh(P[:3, :3])[-1]))) > math.sqrt(self._bound):
            return worst(status, Status.DEGRADED), f"knows its position to {deviation:.3g} m, one sigma, in a direction"
        missing = [name for name, last in self._arrived.items() if t - last > self._timeout.longest]
        if missing:
            return worst(status, Status.DEGRADED), f"has had no {missing[0]} for long"
        return status, self._timeout.message


class GuardedFlight(Guarded):
    """The filter with its monitor.

    What disagreed once, and agrees again, says nothing where each reading is needed: the filter has followed a beacon
    at fault. There an alarm is remembered until there are readings to spare, more than three numbers, and a leap of the
    readings is one: nothing else tells of a fault that the filter follows.

    An alarm that no beacon explains may be of all readings, and the filter follows these too: for 20 s the estimate is
    DEGRADED then, as one with a single sensor is (``integrity.innovations``), and for as long as the readings may be
    late (``flight_leaps``). So it is where the estimated gust is larger than declared: g' (s^2 I - P_gg)^-1 g is
    chi-squared while gusts are as declared.
    """

    def __init__(self, config: KalmanConfig, mission: FlightMission) -> None:
        witness = BeaconWitness(beacons_of(mission), mission, config)
        spare, rows = len(witness.names) - 1, BeaconRows(beacons_of(mission))
        cost = _COST * max(1.0, rows.size / _NUMBERS)
        super().__init__(FlightBeaconFilter(config, mission), witness, most_out=min(2, spare), cost=cost)
        self._alarm, self._timeout, self._fixed = False, config.timeout, -math.inf
        self._heard_at = np.full(rows.size, -math.inf)  # [s]
        self._fixes = config.fixes
        model = axis_model(config, mission)
        self._variance, self._leaps = model.gust_rms**2, Leaps(model, self._tests.rows, 1.0 / beacons_of(mission).rate)
        looks = _HORIZON / (_EACH * mission.gust.time_constant)
        self._largest = float(chdtri(3, _FALSE_ALARM / looks))
        self._remembered, self._doubt = -math.inf, ""  # [s] last time when an alarm had no explanation, and why

    @property
    def _tests(self) -> BeaconWitness:
        witness = self._now.witness
        assert isinstance(witness, BeaconWitness)
        return witness

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        estimate = super().update(t, measurements, command)
        extra = estimate.extra
        self._heard_at[np.isfinite(extra["innovations"])] = t
        if self._fixes and any(each.name == FIXES and np.isfinite(each.value).all() for each in measurements):
            self._fixed = t
        numbers = int((self._heard_at >= t - self._timeout).sum()) + 3 * (self._fixed >= t - self._timeout)
        spare = numbers > _NO_SPARE
        self._alarm = self._alarm or float(extra["integrity"][0]) > 1.0 or (not spare and self._tests.leap > 1.0)
        if self._state is Status.LOST:
            self._remembered, self._doubt = t, "disagreed with its readings, and no beacon at fault explains that"
        elif self._gust > self._largest:
            self._remembered, self._doubt = t, "finds a gust that is larger than declared"
        alarming = float(extra["integrity"][0]) > 1.0 or self._state is Status.LOST
        y = self._tests.read(measurements, self.left_out)
        self._leaps.follow(t, command, y, lambda: self._filter.moments, alarming=alarming)
        if self._leaps.tau > 0.0:
            self._remembered, self._doubt = t, self._leaps.doubt("readings")
        if estimate.status is not Status.OK:
            return estimate
        message = self._doubt if t - self._remembered < LATCHED - TIME_TOLERANCE else ""
        if self._alarm and not spare:
            message = "disagreed with a beacon, and has none to spare that would tell which"
        self._alarm = self._alarm and not spare
        return replace(estimate, status=Status.DEGRADED, message=message) if message else estimate

    @property
    def _filter(self) -> FlightBeaconFilter:
        flight = self.estimator
        assert isinstance(flight, FlightBeaconFilter)
        return flight

    @property
    def _gust(self) -> float:
        """g' (s^2 I - P_gg)^-1 g of the estimated gust, with eigenvalues of a share of s^2 at least."""
        moments = self._filter.moments
        if moments is None:
            return 0.0
        x, P = moments
        values, axes = np.linalg.eigh(self._variance * _I3 - P[6:, 6:])
        along = axes.T @ x[6:]
        return float((along * along / np.maximum(values, _KNOWN * self._variance)).sum())


def guarded(config: KalmanConfig, mission: FlightMission) -> Guarded:
    """The filter with its monitor."""
    return GuardedFlight(config, mission)
