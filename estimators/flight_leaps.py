"""Leaps of the readings of a flight: are they late since then, or off, or was the vehicle moved?

A flight does not leap. After an alarm, or after a reading that is off by more than one in a thousand is, four filters
run from before it on, with the model of ``flight_model`` for (p, v, g) and the input u:

    nothing      y = h(p) + noise
    moved        y = h(p + d) + noise, with d that is anything from the leap on, and constant
    late         y = h(p - tau v + tau^2 (u + g) / 2) + noise, with tau' = w_tau, which is anything from the leap on
    gusty        nothing, with gusts three times as large

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
follows the readings has the covariance P + D D'. A leap is not told where more than four readings in a row are missing,
or where the innovations have twice the declared variance.

After an alarm no estimate is OK until they are compared. All times are those of readings that come ten times a second
or more often, and longer for slower ones.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable
from copy import copy
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.flight_model import AxisModel
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.tolerances import TIME_TOLERANCE

_I3 = np.eye(3)
_OFTEN = 0.1  # [s] between readings, at which the times that follow are as they are here, and in proportion beyond
_KEPT, _OLD, _BETWEEN = 8.0, 4.5, 0.5  # [s] of steps, age of the state that is begun from, and between two of them
_APART = 0.5  # [s] between readings at most: over more a vehicle may go anywhere before they are enough
_SINCE = 4.0  # [s] before the alarm in which the leap is
_AGAIN, _QUIET = 1.0, 5.0  # [s] between two attempts at least; without an alarm until the estimate is trusted again
_LATEST, _WANDERS = 1.0, 0.01  # [s] deviation of tau at a leap; [s/sqrt(s)] of its random walk
_READ, _EARLY = 10, 4  # readings after a leap until filters are compared, and, after no alarm, if it shows by then
_CHANCE, _FAR, _IN_A_ROW = 1e-4, 1e-9, 4  # of all readings since a leap; of one; that far ones come in a row
_SURE = 3.0  # deviations of tau that make it one
_INTERVALS = 64  # that are kept
_MOVED = 300.0  # [m] deviation of d at a leap
_TAU, _D, _SIZE = 9, slice(10, 13), 13  # in the state (p, v, g, tau, d)
_LESS = {True: 20.0, False: float(chdtri(3, 1e-7))}  # by which sums are better than nothing's, after an alarm or none
_MORE, _BACK_IN_TIME = chdtri(2, (1e-3, 1e-5)).tolist()  # by which that of late is worse than that of moved
_LOUDER = 9.0  # variance of larger gusts over the declared one
_NOISIER = 2.0  # times the declared variance from which on a leap does not show
_BACK = float(chdtri(3, 1e-3))  # of a sum of leaps that is none

_EYE = np.eye(_SIZE)
_HERE = np.eye(_SIZE)  # (p, v, g, tau, d) of readings at p + d
_HERE[:3, _D], _HERE[_D, _D] = _I3, 0.0


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


@dataclass
class _Step:
    """From one reading to the next, or to a time at which a state is kept."""

    start: float  # [s]
    t: float  # [s]
    held: list[tuple[float, Array]]  # inputs (3,) [m/s^2], each with the time until which it was held
    y: Array | None  # (m,), NaN for numbers that did not come
    moved: Array | None = None  # (9,) what the inputs add to (p, v, g), once a filter has asked for it


@dataclass
class _Filter:
    """A filter of (p, v, g, tau, d), and how well its readings fit since its leap."""

    t: float
    x: Array  # (13,)
    P: Array  # (13, 13)
    fit: float = 0.0  # sum of normalised squares
    numbers: int = 0
    readings: int = 0
    far: int = 0  # readings in a row that cannot be
    louder: float = 1.0  # variance of the gusts over the declared one
    cost: float = 0.0  # sum of all normalised squares since it was begun, those that cannot be as if they just could
    counted: int = 0  # numbers of it
    wider: float = 0.0  # sum of ln det S

    def begun(self) -> _Filter:
        """This filter without readings yet, at the place where they are: p + d."""
        x, P = _HERE @ self.x, _HERE @ self.P @ _HERE.T
        return _Filter(self.t, x, P)

    def leap(self, *, moved: bool) -> _Filter:
        """This filter, which has begun without d, with a d or a tau that is anything."""
        P = self.P.copy()
        if moved:
            P[_D, _D] = _MOVED**2 * _I3
        else:
            P[_TAU, :] = P[:, _TAU] = 0.0
            P[_TAU, _TAU] = _LATEST**2
        return _Filter(self.t, self.x, P, cost=self.cost, counted=self.counted)

    @property
    def tau(self) -> float:
        """tau [s], or 0 where it is within its deviations."""
        tau, deviation = float(self.x[_TAU]), math.sqrt(max(float(self.P[_TAU, _TAU]), 0.0))
        return tau if abs(tau) > _SURE * deviation else 0.0

    @property
    def fits(self) -> bool:
        """False once its readings cannot be those of this model."""
        possible = not self.numbers or self.fit < float(chdtri(self.numbers, _CHANCE))
        return possible and self.far < _IN_A_ROW and math.isfinite(self.fit)


class _Compared(NamedTuple):
    """The filters, after an alarm or after a single reading that is far off."""

    nothing: _Filter
    moved: _Filter
    late: _Filter
    gusty: _Filter
    after_alarm: bool
    were_late: bool  # whether it begins with readings that are

    @property
    def filters(self) -> tuple[_Filter, ...]:
        """All four."""
        return self.nothing, self.moved, self.late, self.gusty

    @property
    def is_decided(self) -> bool:
        """True if there are enough readings to judge by."""
        read = self.late.readings + self.late.far
        return read >= _READ or (not self.after_alarm and read >= _EARLY and self.has_leapt)

    @property
    def larger(self) -> float:
        """Variance of the innovations over the declared one, by which differences of sums become larger."""
        return max(1.0, self.moved.cost / max(1, self.moved.counted))

    @property
    def are_late(self) -> bool:
        """True if readings that are late, or no longer are, explain what is read."""
        shows = self._better(self.moved) and self.nothing.cost - self.late.cost > self.larger * _LESS[True]
        more = self.late.cost - self.moved.cost
        return shows and more < self.larger * (_BACK_IN_TIME if self.were_late else _MORE) and self.late.far == 0

    @property
    def has_leapt(self) -> bool:
        """True if a leap explains it."""
        gusty = self.gusty.cost + self.gusty.wider - self.nothing.wider
        sharp = gusty - self.moved.cost > self.larger * _MORE
        return self._better(self.moved) and sharp and self.moved.far == 0 and self.larger < _NOISIER

    def _better(self, one: _Filter) -> bool:
        return self.nothing.cost - one.cost > self.larger * _LESS[self.after_alarm]

    @property
    def leap(self) -> tuple[Array, Array]:
        """d (3,) [m] and its covariance (3, 3)."""
        return self.moved.x[_D], self.larger * self.moved.P[_D, _D]


class _Read(NamedTuple):
    """What a filter has made of a reading of m numbers."""

    nu: Array  # (m,)
    S: Array  # (m, m)
    H: Array  # (m, 13)
    gain: Array  # (13, m), 0 where it was not used


class _Sizes:
    """The leaps d that make the innovations of a filter without one the likeliest, for k moments of the leap.

    A leap d moves the innovation of every reading since then by m d, m = H_d - H r, and the state by r d: r = 0 at the
    leap, r <- r + K m at a reading, r <- F r in between. The sum of normalised squares is less by b' A^-1 b with
    d = A^-1 b, A = sum m' S^-1 m and b = sum m' S^-1 nu (the generalised likelihood ratio after Willsky and Jones).
    """

    def __init__(self) -> None:
        self._r = np.zeros((0, _SIZE, 3))  # (k, 13, 3)
        self._A, self._b = np.zeros((0, 3, 3)), np.zeros((0, 3))

    def begin(self) -> None:
        """The next reading may be the first after the leap."""
        self._r = np.concatenate([self._r, np.zeros((1, _SIZE, 3))])
        self._A, self._b = np.concatenate([self._A, _I3[None] / _MOVED**2]), np.concatenate([self._b, np.zeros((1, 3))])

    def predict(self, F: Array) -> None:
        """Follow the filter, which has predicted by F (13, 13)."""
        self._r = F @ self._r

    def read(self, read: _Read) -> None:
        """Follow the filter, which has read."""
        m = read.H[:, _D] - read.H @ self._r
        weighted = np.linalg.solve(read.S, m)
        self._A += np.swapaxes(m, 1, 2) @ weighted
        self._b += read.nu @ weighted
        self._r = self._r + read.gain @ m

    @property
    def likeliest(self) -> int:
        """The moment of the leap that explains the readings best."""
        d = np.linalg.solve(self._A, self._b[:, :, None])[:, :, 0]
        return int(np.argmax((self._b * d).sum(axis=1)))


class Leaps:
    """Leaps of the readings of a flight."""

    def __init__(self, model: AxisModel, rows: Rows, interval: float) -> None:
        """``interval`` [s] is declared between two readings."""
        self._model, self._rows, self._slower = model, rows, max(1.0, interval / _OFTEN)
        self._discrete: dict[float, tuple[Array, Array, Array]] = {}
        self._steps: deque[_Step] = deque()
        self._held: list[tuple[float, Array]] = []  # since the last of them
        self._end = math.nan  # [s] of that
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

    def doubt(self, what: str) -> str:
        """Why an estimate is DEGRADED whose readings, ``what``, may be late, or have leapt; "" if they are neither."""
        if self.tau > 0.0:
            return f"has {what} that may be {self.tau:.2g} s late, or was moved"
        pending = self._compared is not None and self._compared.after_alarm
        return f"has {what} that may have leapt" if pending else ""

    def follow(
        self, t: float, command: Array, y: Array | None, moments: Callable[[], tuple[Array, Array] | None], *,
        alarming: bool, surprising: bool = False,
    ) -> None:  # fmt: skip
        """Take what came until t [s], as ``step`` does; ``alarming`` while it disagrees with the estimate, and
        ``surprising`` if the last reading by itself is far off.

        ``moments`` are the state (p, v, g) (9,) of the estimate after that and its covariance (9, 9), None if there are
        none.
        """
        self.step(t, command, y)
        if alarming:
            self._alarmed = t
            pending = self._compared is not None and self._compared.after_alarm
            if not pending and t - self._tried >= self._slower * _AGAIN:
                self._begin(t, self._slower * _SINCE)
        elif surprising and self._compared is None:
            self._begin(t, 0.0)
        if t < self._due:
            return
        self._due = t + self._slower * _BETWEEN - TIME_TOLERANCE
        self._close(t, None)
        if (own := self._now or self._moved) is not None:
            self._states.append(own.begun())
        elif (found := moments()) is None:
            return
        else:
            x, P = np.zeros(_SIZE), np.zeros((_SIZE, _SIZE))
            x[:9], P[:9, :9] = found
            self._states.append(_Filter(t, x, P))
        while self._states[0].t < t - self._slower * _KEPT:
            self._states.popleft()
            self._is_after_leap = False

    def step(self, t: float, command: Array, y: Array | None) -> None:
        """Take what came until t [s]: ``command`` (3,) [m/s^2] held since then, and numbers y (m,), if any."""
        self._held.append((t, command.copy()))
        if y is None:
            return
        if t - self._read > self._slower * _APART:  # what has happened meanwhile is no leap
            self._compared, self._is_after_leap = None, False
            self._states.clear()
            self._steps.clear()
        self._read = t
        self._close(t, y)

    def _close(self, t: float, y: Array | None) -> None:
        """End a step at t [s], with numbers y (m,), if any."""
        start = t if math.isnan(self._end) else self._end
        step, self._held, self._end = _Step(start, t, self._held, y), [], max(start, t)
        self._steps.append(step)
        while self._steps[0].t < t - self._slower * _KEPT:
            self._steps.popleft()
        if self._compared is not None or self._now is not None or self._moved is not None:
            self._go_on(step)

    def _go_on(self, step: _Step) -> None:
        """Advance the filters that run beside the estimate."""
        t = step.t
        if self._now is not None:
            self._advance(self._now, step)
            if not self._now.fits or self._now.tau == 0.0:
                self._now = None
        if self._moved is not None:
            self._advance(self._moved, step)
            if self._moved.far >= _IN_A_ROW or t - self._alarmed > self._slower * _QUIET:
                self._moved = None
        if self._compared is not None:
            for each in self._compared.filters:
                self._advance(each, step)
            if self._compared.is_decided:
                self._judge(self._compared)
                self._compared = None

    def _judge(self, compared: _Compared) -> None:
        """Take what explains the readings since an alarm best."""
        D, C = self._sum
        d, spread = compared.leap
        leapt, total = compared.has_leapt, C + spread
        # readings of a time to come there are none: it is only late ones that may be ahead, if no longer late
        are_late = compared.are_late and (compared.were_late or compared.late.tau > 0.0)
        undone = leapt and C.any() and float((D + d) @ np.linalg.solve(total, D + d)) < _BACK
        if undone:
            self._sum = np.zeros(3), np.zeros((3, 3))
        elif are_late:
            self._now = compared.late if compared.late.tau > 0.0 else None
        elif leapt:
            self._sum = D + d, total
        if undone or (leapt and not are_late):
            self._moved, self._alarmed = compared.moved, max(self._alarmed, compared.moved.t)
        if undone or are_late or leapt:  # this leap is not to be found again
            after = compared.late if are_late and not undone else compared.moved
            self._states, self._is_after_leap = deque([after.begun()]), True

    def _begin(self, t: float, since: float) -> None:
        """Begin to compare, where the readings disagree with the estimate at t [s], or for ``since`` [s]; after an
        alarm that is more than 0.
        """
        old = [state for state in self._states if state.t <= t - self._slower * _OLD]
        if not old and self._is_after_leap:
            old = [self._states[0]]
        if not old:  # it has just begun: where from is what may be wrong
            return
        if since > 0.0:
            self._tried = t
        steps = [step for step in self._steps if step.t > old[-1].t + TIME_TOLERANCE]
        nothing, before, sizes = old[-1].begun(), list[tuple[int, _Filter]](), _Sizes()
        gusty = replace(nothing, louder=_LOUDER)
        for k, step in enumerate(steps):
            if step.y is not None and step.t >= min(t - since, self._read):
                before.append((k, copy(nothing)))
                sizes.begin()
            sizes.predict(self._predict(nothing, step))
            if (read := self._condition(nothing, step)) is not None:
                sizes.read(read)
            self._advance(gusty, step)
        if before:
            k, at = before[sizes.likeliest]
            moved, late = at.leap(moved=True), at.leap(moved=False)
            for step in steps[k:]:
                self._advance(moved, step)
                self._advance(late, step)
            self._compared = _Compared(nothing, moved, late, gusty, since > 0.0, old[-1].tau > 0.0)

    def _advance(self, state: _Filter, step: _Step) -> None:
        """Predict until the end of a step, and condition on its numbers."""
        self._predict(state, step)
        self._condition(state, step)

    def _predict(self, state: _Filter, step: _Step) -> Array:
        """Predict until the end of a step; returns F (13, 13)."""
        h = step.t - state.t
        if h <= TIME_TOLERANCE:
            return _EYE
        F, _, Q = self._over(h)
        state.x = F @ state.x
        state.x[:9] += self._moved_by(step)  # x is new: no other filter shares it
        state.P = F @ state.P @ F.T + state.louder * Q
        state.t = step.t
        return F

    def _over(self, h: float) -> tuple[Array, Array, Array]:
        """F (13, 13), B (9, 3) and Q (13, 13) over h [s]."""
        key = round(h, 10)
        if key not in self._discrete:
            if len(self._discrete) >= _INTERVALS:  # stamps jitter
                self._discrete.clear()
            F, B, Q = self._model.discretised(h)
            over, noise = np.eye(_SIZE), np.zeros((_SIZE, _SIZE))
            over[:9, :9], noise[:9, :9], noise[_TAU, _TAU] = np.kron(F, _I3), np.kron(Q, _I3), _WANDERS**2 * h
            self._discrete[key] = over, np.kron(B, _I3), noise
        return self._discrete[key]

    def _moved_by(self, step: _Step) -> Array:
        """What the inputs of a step add to (p, v, g) (9,)."""
        if step.moved is None:
            since, moved = step.start, np.zeros(9)
            for t, command in step.held:
                if t - since > TIME_TOLERANCE:
                    F, B, _ = self._over(t - since)
                    since, moved = t, F[:9, :9] @ moved + B @ command
            step.moved = moved
        return step.moved

    def _condition(self, state: _Filter, step: _Step) -> _Read | None:
        """Condition on the numbers of a step, if it has any."""
        if step.y is None or not len(rows := np.flatnonzero(np.isfinite(step.y))):
            return None
        x, P = state.x, state.P
        tau, a = float(x[_TAU]), step.held[-1][1] + x[6:9]
        h, D = self._rows.linear(x[:3] + x[_D] - tau * x[3:6] + 0.5 * tau * tau * a, rows.tolist())
        H = np.hstack([D, -tau * D, 0.5 * tau * tau * D, (D @ (tau * a - x[3:6]))[:, None], D])
        nu, PH = self._rows.innovations(step.y[rows], h, rows), P @ H.T
        S = H @ PH + self._rows.covariance(rows)
        gain = np.linalg.solve(S, PH.T).T
        square = float(nu @ np.linalg.solve(S, nu))
        most = float(chdtri(len(rows), _FAR))
        state.wider += float(np.linalg.slogdet(S)[1])
        state.cost, state.counted = state.cost + min(square, most), state.counted + len(rows)
        if square > most:
            state.far += 1
            return _Read(nu, S, H, np.zeros_like(gain))
        state.far = 0
        state.fit, state.numbers, state.readings = state.fit + square, state.numbers + len(rows), state.readings + 1
        state.x = x + gain @ nu
        state.P = P - gain @ PH.T
        state.P = 0.5 * (state.P + state.P.T)
        return _Read(nu, S, H, gain)
