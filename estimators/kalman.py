"""The Kalman filter for position fixes under gusts.

Each axis has the state (p, v, g), position, velocity and a first-order Gauss-Markov gust, and the known input u:

    p' = v,   v' = u + g,   g' = -g / tau + w,   w white with intensity 2 rms^2 / tau,

and fixes y = p + noise of variance R. The axes are independent and alike, so one filter carries all three: its state is
the matrix x (3, 3) with one column an axis, and its covariance P (3, 3) is that of any one of them. The model is
discretised exactly. The filter predicts at its period and conditions on each fix at the time of the fix, with the
covariance in Joseph's form, which rounding leaves positive:

    x <- F x + B u,   P <- F P F' + Q;   x <- x + K (y - H x),   P <- (I - K H) P (I - K H)' + K R K',

H = (1, 0, 0), K = P H' / (H P H' + R).

The filter watches the normalised innovations nu' S^-1 nu of its fixes, chi-squared with three degrees of freedom while
gusts and noise are what the mission declares. A very unlikely fix is an outlier and is not used, unless many follow
each other: then the filter is wrong. If the last fixes together are unlikely, the gusts or the noise are stronger than
declared, or the fixes are not of their time: the estimate is DEGRADED, or LOST, and its covariance is that of the
filter, scaled up accordingly (see ``integrity.innovations``). It stays DEGRADED while the fixes may be late,
and after any other leap of them its covariance covers both places (``flight_leaps``).

Of a mission with beacons it reads ranges to them instead, or both (``beacons.flight``), and finds the places of those
at unknown places (``beacons.flight_places``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np
from scipy.linalg import solve_discrete_are
from scipy.special import chdtri

from mathnavi.estimators.flight_leap_filters import FixRows
from mathnavi.estimators.flight_leaps import Leaps
from mathnavi.estimators.flight_model import OF_BEACONS, AxisModel, KalmanConfig, as_stated
from mathnavi.estimators.integrity.innovations import InnovationMonitor
from mathnavi.estimators.timeout_monitor import InnovationMean, TimeoutMonitor, is_late, time_ahead, waiting, worst
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.innovations import published
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Estimator, Sensor
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.aerial.mission import EstimateQuality, FlightMission, PositionSensor
from mathnavi.models.sensor_faults import longest_gap
from mathnavi.models.tolerances import TIME_TOLERANCE

_H = np.array([[1.0, 0.0, 0.0]])  # a fix reads the position
_EYE = np.eye(3)
_AXES = 3
_OUTLIER = float(chdtri(_AXES, 1e-9))
_LASTING = 10  # outliers in a row


class Kalman:
    """Estimator of position, velocity and gust from position fixes."""

    Config = KalmanConfig

    def __init__(self, config: KalmanConfig, mission: FlightMission) -> None:
        self.period = mission.control_period
        self._timeout_monitor = TimeoutMonitor(config.timeout, 1.0 / mission.position_rate, of="fixes")  # of the fixes
        self._model = AxisModel.from_config(config, mission)
        self._discrete: dict[float, tuple[Array, Array, Array]] = {}
        self._x = np.vstack([mission.start, np.zeros((2, 3))])  # (3, 3) one column an axis
        self._P = first_covariance(config, mission)  # (3, 3) of an axis
        self._R = self._model.fix_std**2  # [m^2]
        self._t: float | None = None  # [s] of the filter's state; None before the first call
        self._monitor = InnovationMonitor("fixes", _AXES, 1.0 / mission.position_rate)
        self._noisy = mission.position_noise > 0.0
        self._leaps = Leaps(self._model, FixRows(self._R), 1.0 / mission.position_rate)
        self._outliers = 0  # in a row
        self._counts, self._since_gap = ReadingCounts(), InnovationMean(_OUTLIER)
        self._nothing = published(np.full((2, _AXES), np.nan))
        for each in self._nothing.values():
            each.flags.writeable = False  # all estimates without a fix share it
        self._innovations = self._nothing  # of the last fix

    @staticmethod
    def build(config: KalmanConfig, mission: FlightMission) -> Estimator:
        """Build the estimator of one run: by ranges where the mission has beacons, else by fixes."""
        if mission.beacons is None:
            _check_without_beacons(config)
            return Kalman(config, mission)
        from mathnavi.estimators.beacons.flight import guarded  # takes a while to import

        beacons = mission.beacons
        if not beacons.unknown:
            return guarded(config, mission)
        from mathnavi.estimators.beacons.flight_places import PlacedFlight, check_carried

        check_carried(config, beacons)
        placed = replace(mission, beacons=beacons.known)
        by_fixes = KalmanConfig(
            **{each.name: getattr(config, each.name) for each in fields(config) if each.name not in OF_BEACONS}
        )
        carrier: Estimator = Kalman(by_fixes, placed) if placed.beacons is None else guarded(config, placed)
        return PlacedFlight(carrier, config, mission, beacons)

    @staticmethod
    def sensors(config: KalmanConfig, mission: FlightMission) -> tuple[Sensor, ...]:
        """Sensors that the vehicle has to carry for this estimator."""
        fixes = PositionSensor(mission.position_noise, mission.position_rate)
        if mission.beacons is None:
            return (fixes,)
        readings = mission.beacons.sensors(mission.terrain)
        return (*readings, fixes) if config.fixes else readings

    @staticmethod
    def quality(config: KalmanConfig, mission: FlightMission) -> EstimateQuality:
        """Quality of the stationary filter, by its discrete Riccati equation at the rate of the fixes.

        P is the covariance just before a fix, when each variance is largest; each fix changes the estimate with
        covariance K S K', S = H P H' + R. The time between fixes is the longest that there can be while the estimate is
        not lost. By ranges to beacons it is that at a bad place among them, and with fixes in addition the better
        of both.
        """
        by_ranges = None
        if mission.beacons is not None and mission.beacons.unknown:
            from mathnavi.estimators.beacons.flight_places import check_carried

            check_carried(config, mission.beacons)
            mission = replace(mission, beacons=mission.beacons.known)  # what it has from the start
        elif mission.beacons is None:
            _check_without_beacons(config)
        if mission.beacons is not None:
            from mathnavi.estimators.beacons.flight_quality import quality

            by_ranges = quality(config, mission)
            if not config.fixes:
                return by_ranges
        model = AxisModel.from_config(config, mission)
        interval = longest_gap(1.0 / mission.position_rate, mission.dropout_rate, config.timeout)
        F, _, Q = model.discretised(interval)
        R = np.array([[model.fix_std**2]])
        before = solve_discrete_are(F.T, _H.T, Q, R)
        before = 0.5 * (before + before.T)
        correction = before @ _H.T @ np.linalg.solve(_H @ before @ _H.T + R, _H @ before)
        found = EstimateQuality(before, 0.5 * (correction + correction.T) / interval, estimates_gust=True, age=interval)
        return by_ranges if by_ranges is not None and by_ranges.error[0, 0] < before[0, 0] else found

    @staticmethod
    def properties(config: KalmanConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1): linear and observable from fixes under any known input."""
        return ObserverProperties(
            Domain.GLOBAL, Rate.EXPONENTIAL, InputDependence.UNIFORM, Domain.GLOBAL, Domain.GLOBAL,
            note="linear; gusts and noise leave an error in proportion to them",
        )  # fmt: skip

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (6,) [m, m/s] at t [s] from the fixes since the last call, ``command`` (3,) [m/s^2] held in between.

        ``extra["gust"]`` (3,) [m/s^2] is the estimated gust, ``extra["integrity"]`` (1,) the worst statistic of the
        fixes over its threshold, ``extra["innovations"]`` (3,) [m] are those of the last fix and
        ``extra["innovation_std"]`` (3,) [m] their standard deviations (``interfaces.innovations``); ``extra`` also
        counts the readings that were not used.
        """
        self._innovations = self._nothing
        for fix in measurements:
            if fix.name != "position":
                self._counts.add(Unused.UNKNOWN_SENSOR)
            elif is_late(fix.t, self._t):
                self._counts.add(Unused.LATE)
            elif self._is_stuck(fix):
                self._counts.add(Unused.OUTLIER)
            else:
                self._predict(fix.t, command)
                self._leaps.step(fix.t, command, fix.value)
                self._condition(fix)
        self._predict(t, command)
        integrity, message = self._doubted(t, command)
        x, covariance, leapt = self._x, self._covariance(), self._leaps.covariance
        if leapt is not None:
            covariance[:3, :3] += leapt
        extra = {
            "gust": x[2].copy(),
            "integrity": np.array([self._monitor.ratio]),
            **self._innovations,
            **self._counts.extra,
        }
        status = worst(self._timeout_monitor.status(t, covariance), integrity)
        message = waiting(status, "a fix") or message or self._timeout_monitor.message
        return Estimate(t, x[:2].flatten(), covariance, status, extra, message)

    def _doubted(self, t: float, command: Array) -> tuple[Status, str]:
        """Status at t [s] as far as fixes agree, and are not late, and why."""
        monitor = self._monitor
        alarming, surprising = monitor.alarming, monitor.surprising
        self._leaps.follow(t, command, None, lambda: self.moments, alarming=alarming, surprising=surprising)
        status = monitor.status(t)
        if status is Status.OK and (doubt := self._leaps.doubt("fixes")):
            return Status.DEGRADED, doubt
        return status, monitor.message

    @property
    def moments(self) -> tuple[Array, Array]:
        """State (p, v, g) (9,) of the filter and its covariance (9, 9)."""
        return self._x.ravel().copy(), np.asarray(np.kron(self._monitor.inflation * self._P, _EYE), np.float64)

    def _covariance(self) -> Array:
        """Covariance (6, 6) [m, m/s] of position and velocity: that of an axis, symmetric, on each of the three."""
        (p, c, _), (d, v, _), _ = (self._monitor.inflation * self._P).tolist()
        covariance = np.zeros(36)  # written along its diagonals
        covariance[:15:7], covariance[21::7] = p, v
        covariance[3:18:7] = covariance[18:33:7] = 0.5 * (c + d)
        return covariance.reshape(6, 6)

    def _predict(self, t: float, command: Array) -> None:
        """Predict from the filter's time to t [s] with the input held."""
        if self._t is None:
            self._t = t
        h = time_ahead(t, self._t)
        if h > TIME_TOLERANCE:
            key = round(h, 10)  # so that the last bit of a time does not cost a matrix exponential
            if key not in self._discrete:
                self._discrete[key] = self._model.discretised(h)
            F, B, Q = self._discrete[key]
            self._x = F.dot(self._x) + B * command
            self._P = F.dot(self._P).dot(F.T) + Q
            self._t = t

    def _is_stuck(self, fix: Measurement) -> bool:
        """True for a fix with noise that has read the same many times: it is none."""
        return self._noisy and self._monitor.note_value(fix.t, fix.value)

    def _condition(self, fix: Measurement) -> None:
        variance = float(self._P[0, 0]) + self._R
        difference = fix.value - self._x[0]
        normalised = float(difference @ difference) / variance
        if not math.isfinite(normalised):
            self._counts.add(Unused.NOT_FINITE)
            return
        self._innovations = published(np.array([difference, np.full(_AXES, math.sqrt(variance))]))
        self._monitor.note(fix.t, difference, variance * _EYE, self._R * _EYE)
        fits = self._since_gap.fits(np.array([normalised / _AXES]), self._timeout_monitor.converged)
        if normalised > _OUTLIER:
            self._outliers += 1
            if self._outliers <= _LASTING:
                self._counts.add(Unused.OUTLIER)
                return
            self._P = self._P * (normalised / _AXES)
            variance = float(self._P[0, 0]) + self._R
            self._monitor.begin_again()
        self._outliers = 0
        gain = self._P[:, :1] * (1.0 / variance)  # (3, 1)
        kept = _EYE - gain * _H
        self._x = self._x + gain * difference
        self._P = kept.dot(self._P).dot(kept.T) + (gain * self._R) * gain.T
        self._timeout_monitor.note(fix.t, agrees=fits)
        explained = self._model.gust_rms**2 - float(self._P[2, 2])
        if explained > 0.0:
            self._monitor.note_state(fix.t, float(self._x[2] @ self._x[2]) / explained, "a gust")


def _check_without_beacons(config: KalmanConfig) -> None:
    """Raise FieldError for a field that says how beacons are read."""
    for each in fields(config):
        if each.name in OF_BEACONS and (value := getattr(config, each.name)) != each.default:
            raise FieldError(
                f"estimator.{each.name} = {value!r} without beacons; allowed: {each.default!r}, or beacons"
            )


def first_covariance(config: KalmanConfig, mission: FlightMission) -> Array:
    """Initial covariance (3, 3) of the filter: the stationary one, except where the configuration gives a standard
    deviation.

    Anything wider would let the first fixes move the estimate by more than the declared quality says.
    """
    return as_stated(Kalman.quality(config, mission).error, config)
