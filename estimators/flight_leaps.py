"""Leaps of the readings of a flight: are they late since then, or off, or was the vehicle moved?

A flight does not leap. After an alarm three filters run from before it on, with the model of ``flight_model`` for
(p, v, g) and the input u:

    nothing      y = h(p) + noise
    moved        likewise, with a position that is anything from the leap on
    late         y = h(p - tau v + tau^2 (u + g) / 2) + noise, with tau' = w_tau, which is anything from the leap on

The leap is at the reading from which on ``moved`` makes the readings the most likely. After ten readings the three are
compared by their sums of normalised squared innovations.

**Late.** Readings of tau [s] ago, with stamps of when they came, differ from those of now by tau v. A filter follows
them: it flies the same path tau later, which only gusts distinguish from another flight. What tells is the moment in
which that begins, or ends: the leap is tau v, against the velocity. The readings may be late if ``late`` explains them
far better than ``nothing`` and not much worse than ``moved``, for as long as its innovations pass a chi-square test and
its tau is larger than three standard deviations. A vehicle that was moved by as much against its velocity reads the
same.

**Moved.** After any other leap d either the readings before it or those since then are off by d, and a single sensor
does not tell which. Leaps are added up to D, which vanishes once the sensor reads what it did before. An estimate that
follows the readings has the covariance P + D D'. A leap is not told where readings are more than 0.5 s apart, or where
their innovations have twice the declared variance.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable
from copy import copy
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.flight_model import AxisModel
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.tolerances import TIME_TOLERANCE

_I3 = np.eye(3)
_KEPT, _OLD, _BETWEEN = 4.0, 2.0, 0.5  # [s] of steps, age of the state that is begun from, and between two of them
_APART = 0.5  # [s] between readings at most: over more a vehicle may go anywhere before they are enough
_SINCE = 1.5  # [s] before the alarm in which the leap is: no less than between two attempts
_LATEST, _WANDERS = 1.0, 0.01  # [s] deviation of tau at a leap; [s/sqrt(s)] of its random walk
_AGAIN, _QUIET = 1.0, 5.0  # [s] between two attempts at least; without an alarm until the estimate is trusted again
_READ = 10  # readings after a leap until filters are compared
_CHANCE, _FAR, _IN_A_ROW = 1e-4, 1e-9, 4  # of all readings since a leap; of one; that far ones come in a row
_SURE = 3.0  # deviations of tau that make it one
_INTERVALS = 64  # that are kept
_MOVED = 300.0  # [m] deviation of a position that is anything
_LESS, _MORE = 20.0, float(chdtri(2, 1e-3))  # sums of squares by which it is better than nothing, worse than moved
_NOISIER = 2.0  # times the declared variance from which on a leap does not show
_BACK = float(chdtri(3, 1e-3))  # of a sum of leaps that is none


class Rows(Protocol):
    """What is read: ``BeaconRows``, or ``FixRows``."""

    def linear(self, p: Array, rows: Iterable[int]) -> tuple[Array, Array]:
        """Numbers of some rows from p (3,), and their derivatives."""

    def innovations(self, y: Array, h: Array, rows: Integers) -> Array:
        """Numbers y of some rows minus expected ones."""

    def covariance(self, rows: Integers) -> Array:
        """Covariance of the noise of some rows."""


@dataclass(frozen=True)
class FixRows:
    """The three numbers of a position fix."""

    variance: float  # [m^2]

    def linear(self, p: Array, rows: Iterable[int]) -> tuple[Array, Array]:
        chosen = list(rows)
        return p[chosen], _I3[chosen]

    def innovations(self, y: Array, h: Array, rows: Integers) -> Array:
        return y - h

    def covariance(self, rows: Integers) -> Array:
        return self.variance * np.eye(len(rows))


class Step(NamedTuple):
    """What came until t: the input held since the step before, and numbers, NaN for those that did not come."""

    t: float  # [s]
    command: Array  # (3,) [m/s^2]
    y: Array | None  # (m,)


@dataclass
class _Filter:
    """A filter of (p, v, g, tau), and how well its readings fit since its leap."""

    t: float
    x: Array  # (10,)
    P: Array  # (10, 10)
    fit: float = 0.0  # sum of normalised squares
    numbers: int = 0
    readings: int = 0
    far: int = 0  # readings in a row that cannot be
    cost: float = 0.0  # sum of all normalised squares since it was begun, those that cannot be as if they just could
    counted: int = 0  # numbers of it

    def begun(self) -> _Filter:
        """This filter without readings yet."""
        return _Filter(self.t, self.x, self.P)

    def leap(self, *, moved: bool) -> _Filter:
        """This filter, with a position that is anything, or a tau."""
        P = self.P.copy()
        if moved:
            P[:3, :3] += _MOVED**2 * _I3
        else:
            P[9, :] = P[:, 9] = 0.0
            P[9, 9] = _LATEST**2
        return _Filter(self.t, self.x, P, cost=self.cost, counted=self.counted)

    @property
    def tau(self) -> float:
        """tau [s], or 0 where it is within its deviations."""
        tau, deviation = float(self.x[9]), math.sqrt(max(float(self.P[9, 9]), 0.0))
        return tau if abs(tau) > _SURE * deviation else 0.0

    @property
    def fits(self) -> bool:
        """False once its readings cannot be those of this model."""
        possible = not self.numbers or self.fit < float(chdtri(self.numbers, _CHANCE))
        return possible and self.far < _IN_A_ROW and math.isfinite(self.fit)


class _Compared(NamedTuple):
    """The three filters, and one from before the leap on that has read nothing since."""

    nothing: _Filter
    moved: _Filter
    late: _Filter
    blind: _Filter

    @property
    def larger(self) -> float:
        """Variance of the innovations over the declared one, by which differences of sums become larger."""
        return max(1.0, self.moved.cost / max(1, self.moved.counted))

    @property
    def are_late(self) -> bool:
        """True if late readings explain what is read."""
        better = self.nothing.cost - self.late.cost > self.larger * _LESS
        return better and self.late.cost - self.moved.cost < self.larger * _MORE and self.late.far == 0

    @property
    def has_leapt(self) -> bool:
        """True if a leap explains it."""
        better = self.nothing.cost - self.moved.cost > self.larger * _LESS
        return better and self.moved.far == 0 and self.larger < _NOISIER

    @property
    def leap(self) -> tuple[Array, Array]:
        """d (3,) [m] and its covariance (3, 3)."""
        spread = self.moved.P[:3, :3] + self.blind.P[:3, :3]
        return self.moved.x[:3] - self.blind.x[:3], self.larger * spread


class Leaps:
    """Leaps of the readings of a flight."""

    def __init__(self, model: AxisModel, rows: Rows) -> None:
        self._model, self._rows = model, rows
        self._discrete: dict[float, tuple[Array, Array, Array]] = {}
        self._steps: deque[Step] = deque()
        self._states: deque[_Filter] = deque()  # at times apart, of the filter of late readings where it runs
        self._compared: _Compared | None = None
        self._now: _Filter | None = None  # of late readings
        self._sum = np.zeros(3), np.zeros((3, 3))  # of leaps, D [m] and its covariance
        self._moved: _Filter | None = None  # after a leap, until the estimate has settled
        self._is_after_leap = False  # whether the oldest of the states is one of it
        self._tried = self._read = self._alarmed = -math.inf  # [s] of the last attempt, reading and alarm
        self._due = -math.inf  # [s] when the next state is kept

    @property
    def tau(self) -> float:
        """How late [s] the readings may be; 0 where they are not."""
        return 0.0 if self._now is None else max(self._now.tau, 0.0)

    @property
    def covariance(self) -> Array | None:
        """D D' (3, 3) [m^2] of leaps that have not been undone; None if there are none."""
        D, C = self._sum
        return np.outer(D, D) if C.any() else None

    def message(self, what: str) -> str:
        """Why an estimate is DEGRADED whose readings, ``what``, may be late."""
        return f"has {what} that may be {self.tau:.2g} s late, or was moved"

    def follow(
        self, t: float, command: Array, y: Array | None, moments: Callable[[], tuple[Array, Array] | None], *,
        alarming: bool,
    ) -> None:  # fmt: skip
        """Take what came until t [s], as ``step`` does; ``alarming`` while it disagrees with the estimate.

        ``moments`` are the state (p, v, g) (9,) of the estimate after that and its covariance (9, 9), None if there are
        none.
        """
        self.step(t, command, y)
        if alarming:
            self._alarmed = t
            if self._compared is None and t - self._tried >= _AGAIN:
                self._begin(t)
        if t < self._due:
            return
        self._due = t + _BETWEEN - TIME_TOLERANCE
        if (own := self._now or self._moved) is not None:
            self._states.append(own.begun())
        elif (found := moments()) is None:
            return
        else:
            x, P = np.zeros(10), np.zeros((10, 10))
            x[:9], P[:9, :9] = found
            self._states.append(_Filter(t, x, P))
        while self._states[0].t < t - _KEPT:
            self._states.popleft()
            self._is_after_leap = False

    def step(self, t: float, command: Array, y: Array | None) -> None:
        """Take what came until t [s]: ``command`` (3,) [m/s^2] held since then, and numbers y (m,), if any."""
        step = Step(t, command.copy(), y)
        if y is not None:
            if t - self._read > _APART:  # what has happened meanwhile is no leap
                self._compared, self._is_after_leap = None, False
                self._states.clear()
                self._steps.clear()
            self._read = t
        self._steps.append(step)
        while self._steps[0].t < t - _KEPT:
            self._steps.popleft()
        if self._compared is not None or self._now is not None or self._moved is not None:
            self._go_on(step)

    def _go_on(self, step: Step) -> None:
        """Advance the filters that run beside the estimate."""
        t = step.t
        if self._now is not None:
            self._advance(self._now, step)
            if not self._now.fits or self._now.tau == 0.0:
                self._now = None
        if self._moved is not None:
            self._advance(self._moved, step)
            if self._moved.far >= _IN_A_ROW or t - self._alarmed > _QUIET:
                self._moved = None
        if self._compared is not None:
            *reading, blind = self._compared
            self._advance(blind, step._replace(y=None))
            for each in reading:
                self._advance(each, step)
            if self._compared.late.readings + self._compared.late.far >= _READ:
                self._judge(self._compared)
                self._compared = None

    def _judge(self, compared: _Compared) -> None:
        """Take what explains the readings since an alarm best."""
        D, C = self._sum
        d, spread = compared.leap
        leapt, total = compared.has_leapt, C + spread
        undone = leapt and C.any() and float((D + d) @ np.linalg.solve(total, D + d)) < _BACK
        if undone:
            self._sum = np.zeros(3), np.zeros((3, 3))
        elif compared.are_late:
            self._now = compared.late
        elif leapt:
            self._sum = D + d, total
        if undone or (leapt and self._now is not compared.late):  # this leap is not to be found again
            self._moved = compared.moved
            self._states, self._is_after_leap = deque([compared.moved.begun()]), True

    def _begin(self, t: float) -> None:
        """Begin to compare, where the readings disagree with the estimate at t [s]."""
        old = [state for state in self._states if state.t <= t - _OLD]
        if not old and self._is_after_leap:
            old = [self._states[0]]
        if not old:  # it has just begun: where from is what may be wrong
            return
        self._tried = t
        steps = [step for step in self._steps if step.t > old[-1].t + TIME_TOLERANCE]
        nothing, leaps = old[-1].begun(), list[tuple[int, _Filter, _Filter]]()
        for k, step in enumerate(steps):
            if step.y is not None and step.t >= t - _SINCE:
                leaps.append((k, copy(nothing), copy(nothing).leap(moved=True)))
            for each in (nothing, *(moved for *_, moved in leaps)):
                self._advance(each, step)
        if leaps:
            k, before, moved = min(leaps, key=lambda each: each[-1].cost)
            late = before.leap(moved=False)
            for step in steps[k:]:
                self._advance(late, step)
                self._advance(before, step._replace(y=None))
            self._compared = _Compared(nothing, moved, late, before)

    def _advance(self, state: _Filter, step: Step) -> None:
        """Predict until a step, and condition on its numbers."""
        h = step.t - state.t
        if h > TIME_TOLERANCE:
            key = round(h, 10)
            if key not in self._discrete:
                if len(self._discrete) >= _INTERVALS:  # stamps jitter
                    self._discrete.clear()
                F, B, Q = self._model.discretised(h)
                over, noise = np.eye(10), np.zeros((10, 10))
                over[:9, :9], noise[:9, :9], noise[9, 9] = np.kron(F, _I3), np.kron(Q, _I3), _WANDERS**2 * h
                self._discrete[key] = over, B, noise
            F, B, Q = self._discrete[key]
            state.x = F @ state.x
            state.x[:9] += np.outer(B, step.command).ravel()  # x is new: no other filter shares it
            state.P = F @ state.P @ F.T + Q
            state.t = step.t
        if step.y is not None and len(rows := np.flatnonzero(np.isfinite(step.y))):
            self._condition(state, step.y[rows], rows, step.command)

    def _condition(self, state: _Filter, y: Array, rows: Integers, command: Array) -> None:
        x, P = state.x, state.P
        tau, a = float(x[9]), command + x[6:9]
        h, D = self._rows.linear(x[:3] - tau * x[3:6] + 0.5 * tau * tau * a, rows.tolist())
        H = np.hstack([D, -tau * D, 0.5 * tau * tau * D, (D @ (tau * a - x[3:6]))[:, None]])
        nu, PH = self._rows.innovations(y, h, rows), P @ H.T
        S = H @ PH + self._rows.covariance(rows)
        gain = np.linalg.solve(S, PH.T).T
        square = float(nu @ np.linalg.solve(S, nu))
        most = float(chdtri(len(rows), _FAR))
        state.cost, state.counted = state.cost + min(square, most), state.counted + len(rows)
        if square > most:
            state.far += 1
            return
        state.far = 0
        state.fit, state.numbers, state.readings = state.fit + square, state.numbers + len(rows), state.readings + 1
        state.x = x + gain @ nu
        state.P = P - gain @ PH.T
        state.P = 0.5 * (state.P + state.P.T)
