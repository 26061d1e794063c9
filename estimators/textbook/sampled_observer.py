"""An observer in continuous time, run on sampled outputs (Definition 2.1; the inputs are counted in y there).

    z' = F^(z, u, y(t)),   x^ = Phi(z)

Over each period y(t) is the polynomial through the last readings, four at most, the newest among them, and z follows
its equation to the error of ``mathnavi.models.runge_kutta``: the sampling error is of fourth order in the period, and
x^ has no lag. If the newest reading is missing, x^ is propagated as a copy of the system, and z = Psi(x^). An observer
whose state escapes keeps its last state, and is lost. Its accuracy is that of ``error_covariance``; while the last
reading is off by more than that allows, it is degraded. Once the error of its start has decayed, what its readings are
off is tested over windows too (``integrity.innovations``): its means are less than those of white noise, since x^
follows the readings. Readings with noise that repeat themselves are left out.

Parts of an observer in the sense of Definition 2.1.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated

import casadi
import numpy as np
from annotated_types import Interval

from mathnavi.estimators.integrity.innovations import InnovationMonitor
from mathnavi.estimators.textbook.error_covariance import ErrorCovariance
from mathnavi.estimators.timeout_monitor import TimeoutMonitor, waiting, worst
from mathnavi.interfaces.bounds import Each, Within
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import NumberList
from mathnavi.interfaces.innovations import published
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.runge_kutta import Flow
from mathnavi.models.textbook.mission import TextbookMission
from mathnavi.models.tolerances import TIME_TOLERANCE

LARGEST_RATE = 1e4  # [1/s] of a gain or a pole: faster ones would need too small steps
_ALLOWED = f"finite values from -{LARGEST_RATE:g} to {LARGEST_RATE:g}"
_RATES = Interval(ge=-LARGEST_RATE, le=LARGEST_RATE)

RateOfError = Annotated[float, Within(_RATES, allowed=_ALLOWED)]
Poles = Annotated[NumberList, Each(_RATES, allowed=_ALLOWED)]


@dataclass(frozen=True, eq=False)
class ObserverLaw:
    """Observer z' = F^(z, u, y), x^ = Phi(z); z tracks Psi(x) (Figure 2.1)."""

    size: int  # of z
    F: Callable[[casadi.SX, casadi.SX, casadi.SX], casadi.SX]  # (z, u, y) -> z'
    Psi: Callable[[Array], Array]  # (n,) -> (size,)
    Phi: Callable[[Array, Array], Array | None]  # (z, an x nearby) -> x^ (n,); None if there is none


def identity(x: Array, near: Array | None = None) -> Array:
    """Copy of x (n,): Psi and Phi of an identity observer (Definition 2.3)."""
    return x.copy()


def check_system(fits: bool, mission: TextbookMission, allowed: str) -> None:
    """Raise FieldError unless the mission's system ``fits`` the observer."""
    if not fits:
        raise FieldError(f"system = {mission.system.name!r}; allowed with this observer: {allowed}")


_POINTS = 4  # that the polynomial goes through
_DEVIATIONS, _OFF = 6.0, 0.02  # of an output, and share of the last readings, that an output is off at most
_TIME_CONSTANTS = 3.0  # of the slowest error, in which it is down to a twentieth


class SampledObserver:
    """Estimator of x^ from readings "output", for any ``ObserverLaw``."""

    def __init__(self, law: ObserverLaw, mission: TextbookMission, timeout: float, slowest: float) -> None:
        """``timeout`` is the time [s] without a reading after which the estimate is lost, ``slowest`` the least rate
        [1/s] at which an error decays; 0 or less if one does not.
        """
        self.period = mission.period
        settling = max(timeout, _TIME_CONSTANTS / slowest) if slowest > 0.0 else math.inf
        self._law, self._system = law, mission.system
        self._timeout_monitor = TimeoutMonitor(timeout, mission.period, settling=settling)
        self._counts = ReadingCounts()
        self._monitor = InnovationMonitor("readings of output", len(mission.system.outputs), mission.period)
        self._noisy, self._slowest = mission.noise > 0.0, slowest
        self._tested_from: float | None = None  # [s] once what the start was off has decayed; None: not known yet
        self._flow = _flow(law, mission)
        self._errors = ErrorCovariance(law.F, law.size, None if law.Psi is identity else law.Psi, mission)
        self._x = mission.start_state
        self._z = law.Psi(self._x)
        self._t: float | None = None  # [s] of z; None before the first call
        self._readings: deque[tuple[float, Array]] = deque(maxlen=_POINTS)  # (time [s], y (m,))
        self._followed = True  # z has not escaped, and Phi has found an x^ for it
        self._agrees = True  # x^ fits the last reading
        self._innovations = np.full((2, len(self._system.outputs)), np.nan)  # of the last call, and their deviations

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (n,) at t [s] from the readings since the last call, ``command`` (p,) held in between.

        ``extra["z"]`` is the observer's state; ``extra["innovations"]`` (m,) are what the reading of t is off from the
        output of x^, which the last period alone has led to it by that reading, and ``extra["innovation_std"]`` (m,)
        the standard deviations of that (``interfaces.innovations``); ``extra["integrity"]`` (1,) is the worst statistic
        of their tests over its threshold; ``extra`` also counts the readings that were not used.
        """
        self._innovations[:] = np.nan
        for reading in measurements:
            if reading.name != "output":
                self._counts.add(Unused.UNKNOWN_SENSOR)
            elif not np.isfinite(reading.value).all():
                self._counts.add(Unused.NOT_FINITE)
            elif self._readings and reading.t <= self._readings[-1][0]:
                self._counts.add(Unused.LATE)
            elif self._noisy and self._monitor.note_value(reading.t, reading.value):
                self._counts.add(Unused.OUTLIER)
            else:
                self._readings.append((reading.t, np.array(reading.value)))
                self._timeout_monitor.note(reading.t, agrees=self._agrees)
        if self._t is not None and t > self._t:
            self._advance(self._t, t - self._t, command)
        self._t = t
        P = self._errors.of_state(self._x)
        newest = self._readings[-1][0] if self._readings else -math.inf
        if newest > t - TIME_TOLERANCE or not self._timeout_monitor.converged:  # an older one is of an older state
            self._agrees = self._followed and self._fits(P, command, newest > t - TIME_TOLERANCE)
        P = self._monitor.inflation * P
        extra = {
            "z": self._z.copy(),
            "integrity": np.array([self._monitor.ratio]),
            **published(self._innovations),
            **self._counts.extra,
        }
        status, message = self._status(t, P)
        return Estimate(t, self._x.copy(), P, status, extra, message)

    def _fits(self, P: Array, u: Array, new: bool) -> bool:
        """True if the last reading is near the output of x^, whose covariance is P (n, n), with u (p,) held.

        Keeps the innovations of a ``new`` one, and tests them.
        """
        if not self._readings:
            return True
        t, y = self._readings[-1]
        nu, largest = y - self._system.output(self._x, u), max(np.abs(each).max() for _, each in self._readings)
        S = self._errors.output_covariance(self._x, P, u)
        deviation = np.sqrt(S.diagonal())
        if new:
            self._innovations[0], self._innovations[1] = nu, deviation
            self._test(t, nu, S, 0.0 if self._noisy else (_OFF * largest) ** 2)
        return bool((np.abs(nu) <= _DEVIATIONS * deviation + _OFF * largest).all())

    def _test(self, t: float, nu: Array, S: Array, more: float) -> None:
        """Test what a reading of t [s] is off, nu (m,) of covariance S (m, m) and a variance ``more``, over windows.

        What the start is off lasts, and is no noise: it has to be small against that first.
        """
        own = self._errors.variance
        if self._tested_from is None:
            if self._slowest <= 0.0:
                return
            constants = _TIME_CONSTANTS + 0.5 * math.log(max(1.0, float(np.trace(S)) / (len(S) * own)))
            self._tested_from = t + constants / self._slowest
        if t < self._tested_from:
            return
        identity = np.eye(len(nu))
        self._monitor.note(t, nu, S + more * identity, (own + more) * identity)

    def _advance(self, begin: float, h: float, u: Array) -> None:
        """Advance from the time ``begin`` [s] by h [s] with u (p,) held."""
        if self._timeout_monitor.t > begin + TIME_TOLERANCE:
            self._followed = self._observe(begin, h, u)
            return
        copied, reached = self._system.reach(self._x, u, h)
        if self._timeout_monitor.status(begin + h) is Status.LOST:
            self._tested_from = None
        if reached == h:
            self._errors.copy(self._x, copied, u, h)
            self._x, self._z = copied, self._law.Psi(copied)

    def _observe(self, begin: float, h: float, u: Array) -> bool:
        """Advance z with the outputs of the period; True if z does not escape and there is an x^ for it."""
        outputs = self._output_after(begin)
        held = np.concatenate([u, outputs.ravel()])
        self._errors.observe(self._z, u, outputs[:, 0], h)
        after, reached = self._flow.reach(np.append(self._z, 0.0), held, h)
        if reached < h:
            return False
        self._z = after[:-1]
        found = self._law.Phi(self._z, self._x)
        self._x = self._system.flow(self._x, u, h) if found is None else found
        return found is not None

    def _output_after(self, begin: float) -> Array:
        """Coefficients (m, 4) of y in powers of the periods after ``begin`` [s], by the readings that are not old."""
        oldest = begin - (_POINTS - 1.5) * self.period
        recent = [(t, y) for t, y in self._readings if t > oldest]
        s = np.array([(t - begin) / self.period for t, _ in recent])
        fitted = np.linalg.solve(np.vander(s, increasing=True), np.array([y for _, y in recent]))  # (k, m)
        coefficients = np.zeros((fitted.shape[1], _POINTS))
        coefficients[:, : len(fitted)] = fitted.T
        return coefficients

    def _status(self, t: float, covariance: Array) -> tuple[Status, str]:
        """Status at t [s] of an estimate with its ``covariance`` (n, n), and why."""
        status, tested = self._timeout_monitor.status(t, covariance), self._monitor.status(t)
        if status is Status.INITIALISING:
            return status, waiting(status, "a reading of output")
        if not self._followed:
            return Status.LOST, "has a z to which no state belongs"
        if not self._agrees:
            return worst(status, tested, Status.DEGRADED), "disagrees with its readings"
        return worst(status, tested), self._monitor.message or self._timeout_monitor.message


def _flow(law: ObserverLaw, mission: TextbookMission) -> Flow:
    """Flow of (z, seconds since the beginning) with (u, coefficients of y) held."""
    p, m = len(mission.system.inputs), len(mission.system.outputs)

    def rate(state: casadi.SX, held: casadi.SX) -> casadi.SX:
        s = state[law.size] / mission.period
        coefficients = casadi.reshape(held[p:], _POINTS, m)  # row by row of (m, 4)
        y = coefficients.T @ casadi.vertcat(*(s**k for k in range(_POINTS)))
        return casadi.vertcat(law.F(state[: law.size], held[:p], y), 1.0)

    return Flow(rate, law.size + 1, p + _POINTS * m)
