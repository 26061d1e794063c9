"""Estimator of (x, v) from readings "position" and the input held between them, with any ``VelocityLaw``.

It predicts to each reading, conditions on it, and predicts to the time of the estimate. If a step of the law fails,
beyond the range of its coordinates or with a result that is not finite, it keeps the last finite state and is lost; it
starts again at the next reading. An estimate that cannot be (``possible``) is lost too, and the law starts again if its
covariance is none, or if it is too fast for longer than the timeout. Where readings were refused so long that the law
is wrong and not they, the estimate is degraded until it has settled again, and also while its innovations are not what
the errors of the readings make them (``innovation_tests``). A ``SafeAnswer`` checks the estimate against
the readings, and replaces it by their differences while they contradict it; both changes are events.

Law of constant gains that refuses readings that the system cannot have reached, unless they persist.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np

from mathnavi.estimators.timeout_monitor import FARTHEST, TimeoutMonitor, waiting, worst
from mathnavi.estimators.velocity.chain_opening import ChainOpening, residual_of
from mathnavi.estimators.velocity.gain_covariance import GainCovariance, Residual
from mathnavi.estimators.velocity.innovation_tests import InnovationTests, tested_variance
from mathnavi.estimators.velocity.possible import is_covariance, possible_or_lost
from mathnavi.estimators.velocity.reading_errors import ReadingErrors
from mathnavi.estimators.velocity.readings import (
    LASTING,
    OutlierCounter,
    PositionReader,
    SpeedGate,
    innovation,
    reading_variance,
    rounding_steps,
)
from mathnavi.estimators.velocity.refusals import refusal
from mathnavi.estimators.velocity.safe_answer import SafeAnswer
from mathnavi.estimators.velocity.standing_joints import StandingJoints
from mathnavi.interfaces.innovations import published
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.manifold.manifold import CutLocusError
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.system import closure, stepped
from mathnavi.models.tolerances import TIME_TOLERANCE

TIME_CONSTANTS = 10.0
"""number of the time constants 1 / omega of a multiple pole in which an error is down to a thousandth, or nearly"""


class GatedLaw(ABC):
    """Base of a ``VelocityLaw`` that starts it and accepts or refuses its readings."""

    state_covariance: Array | None = None
    doubt = ""

    def __init__(self, mission: LagrangianMission, bandwidth: float) -> None:
        """``bandwidth`` [1/s] is that of the poles of its errors."""
        self._mission, self._manifold = mission, mission.system.manifold
        self._variance: Array | None = None  # (n,) of a reading, if it is not the declared one
        self._steps: Array | None = None  # (n,) likewise
        self._closure, self._stepped = closure(mission.system), stepped(mission.system)
        self._errors = GainCovariance(self._manifold.dimension)
        self._opening = ChainOpening.of(mission.system, mission.period)
        self.residual: Residual | None = None
        self._gains: tuple[float, tuple[float, float, float], tuple[Array, Array, Array]] | None = None
        self.settling = TIME_CONSTANTS / bandwidth

    @property
    def state(self) -> Array:
        """State (size + vector_size,) (x, v)."""
        if self._opening is None:
            return self._state
        return self._opening.added(*np.split(self._state, [self._manifold.size]))

    @property
    def deviation(self) -> Array:
        """Standard deviations (2 n,) of position and velocity, by the gains and the noise alone."""
        known = self._errors.deviation
        return known if self._opening is None else self._opening.deviation(known)

    def start(self, y: Array) -> None:
        """Start at the point y (size,) with v = 0."""
        x = y if self._closure is None else self._closure.nearest(y)
        self._state = np.concatenate([x, np.zeros(self._manifold.vector_size)])
        self._y = y  # the last reading that was used
        self._gate, self._outlier_counter = SpeedGate(self._mission, y, self._variance), OutlierCounter()
        mission = self._mission
        variance = reading_variance(mission, y) if self._variance is None else self._variance
        steps = rounding_steps(mission, y) if self._steps is None else self._steps
        self._errors.start(variance, steps, mission.speed_max)
        if self._opening is not None:
            self._opening.start(variance, steps)
        self.residual = None

    def learn(self, variance: Array, steps: Array) -> None:
        """Assume these errors of a reading from now on."""
        self._variance, self._steps = variance, steps
        self._gate.learn(variance)
        self._errors.learn(variance, steps)
        if self._opening is not None:
            self._opening.learn(variance, steps)

    def predict(self, h: float, u: Array, y: Array | None) -> None:
        """Predict over h [s] with u (nu,) held."""
        self._predict(h, u)
        self._errors.predict(h, None if self._stepped is None else self._stepped.constraint_acceleration)
        if self._opening is not None:
            self._opening.predict(h)

    def correct(self, y: Array, h: float) -> bool:
        """Condition on a reading y (size,), h [s] after the last that was used; True if it was used."""
        manifold, size = self._manifold, self._manifold.size
        x, v = self._state[:size], self._state[size:]
        moved, L = innovation(manifold, self._y, y), innovation(manifold, x, y)
        good = moved is not None and L is not None and self._gate.passes(moved, h)
        self.residual = None
        if not self._outlier_counter.admits(good):
            return False
        if L is None or not good:
            self.start(y)
            return True
        whole, opened = L, None
        if self._opening is not None and self._closure is not None:
            L = self._closure.tangent(x, whole)
            opened = self._opening.correct(x, whole - L, manifold.components(x, v), h)
        if self._gains is None or self._gains[0] != h:
            weights = self._weights(h)
            alpha, beta, gamma = (np.full(manifold.dimension, each) for each in weights)
            self._gains = h, weights, (alpha, beta, gamma)
        _, weights, gains = self._gains
        self._state = self._corrected(x, v, L, weights)
        self._errors.correct(L, gains, manifold.components(x, v), h)
        self.residual = residual_of(L, self._errors.predicted, gains[0], opened)
        self._y = y
        return True

    @abstractmethod
    def _predict(self, h: float, u: Array) -> None:
        """Predict the state over h [s] with u (nu,) held."""

    @abstractmethod
    def _weights(self, h: float) -> tuple[float, float, float]:
        """Weights alpha, beta [1/s] and gamma [1/s^2] of a reading h [s] after the one before."""

    @abstractmethod
    def _corrected(self, x: Array, v: Array, L: Array, weights: tuple[float, float, float]) -> Array:
        """State (size + vector_size,) after the innovation L (n,) at x (size,), v (vector_size,)."""


class VelocityLaw(Protocol):
    """Law of one observer: the part that differs between the observers."""

    @property
    def state(self) -> Array:
        """State (size + vector_size,) (x, v)."""
        ...

    @property
    def state_covariance(self) -> Array | None:
        """Covariance (size + vector_size, size + vector_size) of the state; None of a law that has none."""
        ...

    @property
    def deviation(self) -> Array:
        """Standard deviations (2 n,) of the components of position and velocity, as far as the law knows them."""
        ...

    @property
    def residual(self) -> Residual | None:
        """Residual of the last reading; None if the law did not use it, or has no model that it tests."""
        ...

    @property
    def doubt(self) -> str:
        """Why its estimate is degraded if the readings show that its velocity is off; "" if it is not."""
        ...

    @property
    def settling(self) -> float:
        """Time [s] in which its errors decay; 0 of a law whose covariance says so."""
        ...

    @property
    def extra(self) -> Mapping[str, Array]:
        """Further arrays of the estimate, (k,) each; NaN for values that do not exist yet."""
        ...

    def start(self, y: Array) -> None:
        """Start at the point y (size,) with v = 0."""
        ...

    def learn(self, variance: Array, steps: Array) -> None:
        """Assume from now on, and after later starts, that the coordinates of a reading have this variance (n,), and
        that encoders round them to ``steps`` (n,), 0 without. It is called after ``start`` only.
        """
        ...

    def predict(self, h: float, u: Array, y: Array | None) -> None:
        """Predict over h [s] with u (nu,) held, to a reading y (size,), which ``correct`` then uses, or to none.

        Raises CutLocusError, LinAlgError or ArithmeticError if the prediction fails.
        """
        ...

    def correct(self, y: Array, h: float) -> bool:
        """Condition on a reading y (size,), h [s] after the last that was used; True if it was used."""
        ...


class PositionObserver:
    """Estimator of (x, v) from readings of x; before the first one x is the manifold's origin."""

    def __init__(
        self, law: VelocityLaw, mission: LagrangianMission, timeout: float, safe_answer: SafeAnswer | None = None
    ) -> None:
        """``timeout`` is the time [s] without a usable reading after which the estimate is lost."""
        self.period = mission.period
        self._law, self._manifold = law, mission.system.manifold
        self._reader = PositionReader(self._manifold)
        self._timeout_monitor = TimeoutMonitor(
            timeout, mission.period, settling=max(timeout, law.settling), of="positions"
        )
        self.counts = ReadingCounts()  # of the readings that were not used
        self._x = np.concatenate([self._manifold.origin, np.zeros(self._manifold.vector_size)])
        self._t: float | None = None  # [s] of the law's state; None before it is started
        self._farthest = max(FARTHEST, 100.0 * mission.period)  # [s] of one prediction
        self._mission, self._timeout = mission, timeout
        self._impossible_since = math.inf  # [s]
        self._refused, self._restarts = 0, 0
        self._refused_in_a_row = 0
        self._extra = dict(law.extra)
        self._safe_answer = safe_answer
        self._tests = InnovationTests(mission, law.settling)
        self._noise: tuple[Array, Array] | None = None  # variances and steps (n,) of a reading
        self._innovations = np.full((2, self._manifold.dimension), np.nan)  # of the last call, and their deviations
        self._unread = slice(0)  # coordinates that nothing reads
        self.reading_errors = ReadingErrors(mission)
        """errors of the readings"""
        self._standing = StandingJoints(mission)

    def ignore(self, coordinates: slice) -> None:
        """Do not test these coordinates of its readings, which nothing reads."""
        self._unread = coordinates
        self.reading_errors.ignore(coordinates)
        self._tests.ignore(coordinates)
        if self._safe_answer is not None:
            self._safe_answer.ignore(coordinates)

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (size + vector_size,) at t [s] from the readings since the last call, ``command`` (nu,) held in
        between.

        ``extra`` has the arrays of the law; ``deviation`` (2 n,), standard deviations of the components of position
        and velocity; ``integrity`` (1,), the worst statistic of the innovations over its threshold; ``refused`` (1,)
        readings so far; and ``restarts`` (1,), the number of starts after a failed step or after a minute without
        calls. Of a law that predicts its readings ``innovations`` (n,) [rad, m] are those that the last one was tested
        by and ``innovation_std`` (n,) [rad, m] their standard deviations (``interfaces.innovations``); both are NaN
        where it was not, as at a start and while the noise is not known. It also counts the readings that were not
        used.
        """
        self._innovations[:] = np.nan
        for reading in measurements:
            y = self._reader.read(reading)
            if y is None:
                if (reason := refusal(self._manifold, reading)) is not None:
                    self.counts.add(reason)
            elif reading.t > self._timeout_monitor.t + TIME_TOLERANCE:
                self._read(reading.t, y, command)
            else:
                self.counts.add(Unused.LATE)
        self._move(t, command)
        counts = {"refused": np.array([float(self._refused)]), "restarts": np.array([float(self._restarts)])}
        extra = {name: values.copy() for name, values in self._extra.items()}
        safe, t_read = self._safe_answer, self._timeout_monitor.t
        by_differences = safe is not None and not safe.trusted and t_read > -math.inf
        x = safe.state(t - t_read) if safe is not None and by_differences else self._x.copy()
        covariance = None if self._t is None else self._law.state_covariance
        status = self._status(t, covariance)
        message = waiting(status, "a position" if t_read == -math.inf else "rates that are those of the readings")
        if covariance is not None:
            covariance = self.reading_errors.widened(self._tests.covariance(covariance), self._x)
        if not message and self._tests.message:  # of which noise is the cause, if there is more than declared
            message = self.reading_errors.faults.doubt(t) or self.reading_errors.doubt or self._tests.message
        integrity = {"deviation": self._deviation(), "integrity": np.array([self._tests.ratio])}
        estimate = self.reading_errors.doubted(
            Estimate(
                t,
                x,
                covariance,
                status,
                {**extra, **integrity, **counts, **published(self._innovations), **self.counts.extra},
                message or self._law.doubt or self._timeout_monitor.message,
            )
        )
        found = possible_or_lost(self._mission, estimate)
        if found is estimate:
            self._impossible_since = math.inf
        else:
            self._give_up(t, covariance)
        return found

    def _deviation(self) -> Array:
        """Standard deviations (2 n,) of the components of position and velocity; NaN while there is no estimate."""
        if self._t is None:
            return np.full(2 * self._manifold.dimension, np.nan)
        return self.reading_errors.widened_deviation(self._tests.deviation(self._law.deviation))

    def _give_up(self, t: float, covariance: Array | None) -> None:
        """Start the law again at the next reading if an estimate that cannot be will not mend by itself."""
        self._impossible_since = min(self._impossible_since, t)
        beyond_repair = covariance is not None and not is_covariance(covariance)
        if beyond_repair or t - self._impossible_since > self._timeout:
            self._t, self._impossible_since = None, math.inf

    def events(self) -> list[tuple[str, str]]:
        """Return the kinds and messages of what has happened since the last call."""
        return [] if self._safe_answer is None else self._safe_answer.events()

    def _read(self, t: float, y: Array, u: Array) -> None:
        self._move(t, u, y)
        predicted = None if self._t is None else self._x[: self._manifold.size]
        self.reading_errors.lose_turns(self._reader.unknown_turns)
        if self.reading_errors.read(t, y, predicted) and self._t is not None:
            self._noise = (self.reading_errors.variance, self.reading_errors.steps)
            self._law.learn(*self._noise)
        before = self._timeout_monitor.t
        fresh = self._take(t, y)
        used = self._timeout_monitor.t == t
        h = t - before if math.isfinite(before) else 0.0
        self._test(t, y, h, fresh)
        errors = self.reading_errors
        repeats = errors.faults.repeats[: len(errors.joint_errors)]
        if self._t is not None and self._law.residual is not None and repeats.any():
            joint = self._standing.doubted(self._x, y, u, h, repeats, errors.joint_errors)
            if joint:
                errors.faults.stands(t, joint)
        if self._safe_answer is None:
            return
        if used:
            self._safe_answer.read(y, h, None if fresh or self._t is None else self._x)
        if self._safe_answer.ran_away:
            self._t = None

    def _test(self, t: float, y: Array, h: float, fresh: bool) -> None:
        """Test what the law made of a reading y (size,) of t [s], h [s] after the one before."""
        if fresh:
            self._tests.begin(t)
        residual = None if fresh or self._t is None else self._law.residual
        if residual is None or not self.reading_errors.known:
            return
        if self._noise is None:
            self._noise = (reading_variance(self._mission, y), rounding_steps(self._mission, y))
        x, v = self._x[: self._manifold.size], self._x[self._manifold.size :]
        self._tests.note(t, h, residual, self._noise, self._manifold.components(x, v))
        self._innovations[0] = residual.value
        np.sqrt(tested_variance(residual.variance, self._noise[0]), out=self._innovations[1])
        self._innovations[:, self._unread] = np.nan

    def _take(self, t: float, y: Array) -> bool:
        """Condition the law on a reading; True if the law was started at it."""
        if self._t is None:
            again = self._timeout_monitor.t > -math.inf
            self._restarts += again
            self._t = t
            self._timeout_monitor.note(t, agrees=False)
            if again and self._safe_answer is None:  # nothing is known of the velocity, and nothing else asks
                self._timeout_monitor.restart(t)
            self._try(lambda: self._law.start(y))
            return True
        if t < self._t - TIME_TOLERANCE:  # too late: the law is ahead
            self.counts.add(Unused.LATE)
            return False
        used: list[bool] = []
        self._try(lambda: used.append(self._law.correct(y, t - self._timeout_monitor.t)))
        self._timeout_monitor.note(t, used == [True])
        if used == [False]:
            self._refused += 1
            self._refused_in_a_row += 1
            self.counts.add(Unused.OUTLIER)
        elif used:
            if self._refused_in_a_row >= LASTING:  # they were none: the law was wrong
                self._timeout_monitor.restart(t)
                self._tests.begin(t)
            self._refused_in_a_row = 0
        return False

    def _move(self, t: float, u: Array, y: Array | None = None) -> None:
        """Predict from the law's time to t [s] with u (nu,) held, with or without a reading y there."""
        if self._t is not None and t > self._t + TIME_TOLERANCE:
            h, self._t = t - self._t, t
            if h > self._farthest:
                self._t = None
            else:
                self._try(lambda: self._law.predict(h, u, y))

    def _try(self, step: Callable[[], None]) -> None:
        """Take a step of the law; if it fails, the law has to be started again."""
        try:
            step()
            x, extra = self._law.state, self._law.extra
        except (CutLocusError, np.linalg.LinAlgError, ArithmeticError):
            self._t = None
            return
        if np.isfinite(x).all() and not any(np.isinf(values).any() for values in extra.values()):
            self._x, self._extra = x, dict(extra)
        else:
            self._t = None

    def _status(self, t: float, covariance: Array | None) -> Status:
        status, safe = self._timeout_monitor.status(t, covariance), self._safe_answer
        if status.usable and self._t is not None:
            doubted = bool(self._law.doubt) and self._tests.shows_error(t)
            tested = worst(self._tests.status(t), Status.DEGRADED if doubted else Status.OK)
            return worst(status, tested) if safe is None else worst(status, safe.status, tested)
        return status if self._t is not None or status is Status.INITIALISING else Status.LOST
