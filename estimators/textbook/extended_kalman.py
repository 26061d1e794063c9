"""The plug-in ``textbook_ekf``: the extended Kalman filter for any textbook system,

    x' = F(x, u) + w,   y = h(x, u) + v,

w white with one intensity on every component, v with the variance of the readings. The filter (filterpy's) propagates
x^ by the solution and its covariance by the Jacobian of one step of it, and conditions on the readings of those outputs
that are in sight from x^, with h linearised about the resulting estimate. A step on which the solution escapes is not
taken, and the estimate is lost until a step can be taken. Innovations are tested over windows
(``integrity.innovations``), and outputs with noise that repeat themselves are left out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mathnavi.estimators.integrity.innovations import InnovationMonitor
from mathnavi.estimators.integrity.windows import Flags
from mathnavi.estimators.kalman_steps import external_prediction_ekf
from mathnavi.estimators.timeout_monitor import InnovationMean, TimeoutMonitor, is_late, time_ahead, waiting, worst
from mathnavi.interfaces.bounds import Count, NonNegative, Positive, configuration
from mathnavi.interfaces.innovations import published
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.textbook.mission import TextbookMission
from mathnavi.models.textbook.slopes import output_and_slope, transition_slope
from mathnavi.models.tolerances import TIME_TOLERANCE

_MOST = 1e3  # normalised square of an innovation that counts
_SETTLED = 1e-10  # change of the estimate below which a linearisation is kept


@configuration
class TextbookEkfConfig:
    """Fields of ``--estimator``."""

    process: NonNegative = 0.01
    """square root of the intensity of w on each component [unit of the state per square root of a second]"""
    noise_floor: Positive = 1e-3
    """least standard deviation that the filter assumes for a reading [unit of the output]"""
    iterations: Count = 10
    """largest number of linearisations of h for one reading; 1 is the plain filter"""
    timeout: Positive = 0.5
    """time without a reading after which the estimate is lost [s]"""


class TextbookEkf:
    """The extended Kalman filter for any textbook system."""

    Config = TextbookEkfConfig

    def __init__(self, config: TextbookEkfConfig, mission: TextbookMission) -> None:
        self.period = mission.period
        self._config, self._system = config, mission.system
        n, m = len(mission.system.states), len(mission.system.outputs)
        self._transition, self._output = transition_slope(mission.system), output_and_slope(mission.system)
        self._filter = external_prediction_ekf(n, m)
        self._filter.x = mission.start_state
        self._filter.P = np.diag(np.square(mission.deviation))
        self._variance = max(mission.noise, config.noise_floor) ** 2
        self._t: float | None = None  # [s] of the filter's state; None before the first call
        self._timeout_monitor = TimeoutMonitor(config.timeout, mission.period)
        self._monitor, self._noisy = InnovationMonitor("readings of output", m, mission.period), mission.noise > 0.0
        self._followed = True  # the last step was taken
        self._counts, self._mean = ReadingCounts(), InnovationMean(_MOST)
        self._innovations = np.full((2, m), np.nan)  # of the last reading, and their deviations

    @staticmethod
    def build(config: TextbookEkfConfig, mission: TextbookMission) -> TextbookEkf:
        """Build the estimator of one run."""
        return TextbookEkf(config, mission)

    @staticmethod
    def sensors(config: TextbookEkfConfig, mission: TextbookMission) -> tuple[Sensor, ...]:
        """Sensors that the system has to carry for this estimator."""
        return (mission.sensor,)

    @staticmethod
    def quality(config: TextbookEkfConfig, mission: TextbookMission) -> None:
        """Return None: no plan is certified from these estimates."""

    @staticmethod
    def properties(config: TextbookEkfConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return ObserverProperties(
            Domain.LOCAL, Rate.ASYMPTOTIC, InputDependence.NON_UNIFORM, Domain.LOCAL, Domain.LOCAL,
            note="as far as the linearisation holds, and where the input makes the system observable",
        )  # fmt: skip

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (n,) at t [s] from the readings since the last call, ``command`` (p,) held in between.

        ``extra["innovations"]`` (m,) and ``extra["innovation_std"]`` (m,) are those of the outputs that were last read
        and in sight (``interfaces.innovations``), about the output of the prediction; ``extra["integrity"]`` (1,) is
        the worst statistic of their tests over its threshold; ``extra`` also counts the readings that were not used, by
        output.
        """
        self._innovations[:] = np.nan
        for reading in measurements:
            if reading.name != "output":
                self._counts.add(Unused.UNKNOWN_SENSOR)
            elif is_late(reading.t, self._t):
                self._counts.add(Unused.LATE)
            elif self._noisy and self._monitor.note_value(reading.t, reading.value):
                self._counts.add(Unused.OUTLIER)
            else:
                self._predict(reading.t, command)
                self._condition(reading, command)
        self._predict(t, command)
        P = self._monitor.inflation * 0.5 * (self._filter.P + self._filter.P.T)
        status = self._status(t, P)
        message = waiting(status, "a reading of output") or self._monitor.message or self._timeout_monitor.message
        extra = {
            "integrity": np.array([self._monitor.ratio]),
            **published(self._innovations),
            **self._counts.extra,
        }
        return Estimate(t, self._filter.x.copy(), P, status, extra, message)

    def _predict(self, t: float, u: Array) -> None:
        """Predict from the filter's time to t [s] with u (p,) held."""
        if self._t is None:
            self._t = t
        h = time_ahead(t, self._t)
        if h > TIME_TOLERANCE:
            self._filter.F = self._transition(self._filter.x, u, h)[0]
            noise = h * self._config.process**2
            self._filter.Q = noise * np.eye(len(self._filter.x))
            x, P = self._filter.x, self._filter.P
            after, reached = self._system.reach(x, u, h)
            self._filter.predict(after)
            self._followed = reached == h and bool(np.isfinite(self._filter.P).all())
            if not self._followed:
                self._filter.x, self._filter.P = x, P
            self._t = t

    def _condition(self, reading: Measurement, u: Array) -> None:
        """Condition on the outputs that are in sight, linearised at the resulting estimate, by Gauss-Newton."""
        prior, P, at = self._filter.x, self._filter.P, self._filter.x
        finite = np.isfinite(reading.value)
        seen = finite & (np.abs(self._outputs(at, u)[0]) <= self._system.output_max)
        if not seen.all():
            self._counts.add(Unused.NOT_FINITE, int(np.isinf(reading.value).sum()))
            self._counts.add(Unused.OUT_OF_RANGE, int((finite & ~seen).sum()))
        if not seen.any():
            return
        # State, reading and expectation are flat: filterpy broadcasts a flat array and a column to a square matrix.
        R = self._variance * np.eye(int(np.count_nonzero(seen)))
        self._test(reading, seen, u)
        for _ in range(self._config.iterations):
            expected, slope = (each[seen] for each in self._outputs(at, u))
            self._filter.x, self._filter.P = prior, P
            self._filter.update(
                reading.value[seen], lambda _, H=slope: H, lambda _, y=expected + slope @ (prior - at): y, R
            )
            at, before = self._filter.x, at
            if float(np.abs(at - before).max()) < _SETTLED:
                break
        y, monitor = self._filter.y, self._timeout_monitor
        squares = np.full(len(y), y @ self._filter.SI @ y / len(y))
        monitor.note(reading.t, agrees=self._mean.fits(squares, monitor.converged))

    def _test(self, reading: Measurement, seen: Flags, u: Array) -> None:
        """Test the innovations of the outputs that are ``seen`` (m,), about the prediction."""
        expected, slope = self._outputs(self._filter.x, u)
        R = self._variance * np.eye(len(seen))
        S, nu = slope @ self._filter.P @ slope.T + R, reading.value - expected
        if np.isfinite(S).all():  # P may be beyond all numbers
            self._innovations[:, seen] = nu[seen], np.sqrt(np.maximum(S.diagonal(), self._variance))[seen]
            self._monitor.note(reading.t, nu, S, R, seen)

    def _outputs(self, x: Array, u: Array) -> tuple[Array, Array]:
        """Output h(x, u) (m,) and its Jacobian (m, n)."""
        y, slope = self._output(x, u)
        return y.ravel(), slope

    def _status(self, t: float, covariance: Array) -> Status:
        status = self._timeout_monitor.status(t, covariance)
        if status is Status.INITIALISING:
            return status
        return worst(status, self._monitor.status(t)) if self._followed else Status.LOST
