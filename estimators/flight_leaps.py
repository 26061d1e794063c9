"""Leaps of the readings of a flight: are they late since then, or off, or was the vehicle moved?

A flight does not leap. After an alarm, or after a reading that is off by more than one in a thousand is, four filters
run from before it on (``flight_leap_filters``):

    nothing      d = 0 and tau = 0, or as it was
    moved        d is anything from the leap on
    late         tau is anything from the leap on
    gusty        nothing, with gusts three times as large

The leap is at the reading from which on ``moved`` makes the readings the most likely. After ten readings the four are
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
where the innovations have twice the declared variance, or where ``gusty`` explains them as well, its wider covariance
counted against it.

After an alarm no estimate is OK until they are compared. All times are those of readings that come ten times a second
or more often, and longer for slower ones.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from copy import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.flight_leap_filters import IN_A_ROW, LeapFilter, LeapModel, LeapSizes, Rows, Step
from mathnavi.estimators.flight_model import AxisModel
from mathnavi.interfaces.signals import Array
from mathnavi.models.tolerances import TIME_TOLERANCE

_OFTEN = 0.1  # [s] between readings, at which the times that follow are as they are here, and in proportion beyond
_KEPT, _BETWEEN = 8.0, 0.5  # [s] of steps, and between two states
_OLD, _YOUNG = 4.5, 1.0  # [s] age of the state that is begun from, and after no alarm
_APART = 0.5  # [s] between readings at most: over more a vehicle may go anywhere before they are enough
_SINCE = 4.0  # [s] before the alarm in which the leap is
_AGAIN, _QUIET = 1.0, 5.0  # [s] between two attempts at least; without an alarm until the estimate is trusted again
_READ, _EARLY = 10, 4  # readings after a leap until filters are compared, and, after no alarm, if it shows by then
_LESS = {True: 32.0, False: float(chdtri(3, 1e-7))}  # by which sums are better than nothing's, after an alarm or none
_MORE, _BACK_IN_TIME = chdtri(2, (1e-3, 1e-5)).tolist()  # by which that of late is worse than that of moved
_LOUDER = 9.0  # variance of larger gusts over the declared one
_NOISIER = 2.0  # times the declared variance from which on a leap does not show
_BACK = float(chdtri(3, 1e-3))  # of a sum of leaps that is none


class _Compared(NamedTuple):
    """The filters, after an alarm or after a single reading that is far off."""

    nothing: LeapFilter
    moved: LeapFilter
    late: LeapFilter
    gusty: LeapFilter
    after_alarm: bool
    were_late: bool  # whether it begins with readings that are

    @property
    def filters(self) -> tuple[LeapFilter, ...]:
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

    def _better(self, one: LeapFilter) -> bool:
        return self.nothing.cost - one.cost > self.larger * _LESS[self.after_alarm]

    @property
    def leap(self) -> tuple[Array, Array]:
        """d (3,) [m] and its covariance (3, 3)."""
        d, P = self.moved.d
        return d, self.larger * P


class Leaps:
    """Leaps of the readings of a flight."""

    def __init__(self, model: AxisModel, rows: Rows, interval: float) -> None:
        """``interval`` [s] is declared between two readings."""
        self._filters, self._slower = LeapModel(model, rows), max(1.0, interval / _OFTEN)
        self._steps: deque[Step] = deque()
        self._held: list[tuple[float, Array]] = []  # since the last of them
        self._end = math.nan  # [s] of that
        self._states: deque[LeapFilter] = deque()  # at times apart, of the filter of late readings where it runs
        self._compared: _Compared | None = None
        self._now: LeapFilter | None = None  # of late readings
        self._sum = np.zeros(3), np.zeros((3, 3))  # of leaps, D [m] and its covariance
        self._moved: LeapFilter | None = None  # after a leap, until the estimate has settled
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
        if surprising and self._compared is None:
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
            self._states.append(LeapFilter.at(t, found))
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
        step, self._held, self._end = Step(start, t, self._held, y), [], max(start, t)
        self._steps.append(step)
        while self._steps[0].t < t - self._slower * _KEPT:
            self._steps.popleft()
        if self._compared is not None or self._now is not None or self._moved is not None:
            self._go_on(step)

    def _go_on(self, step: Step) -> None:
        """Advance the filters that run beside the estimate."""
        t = step.t
        if self._now is not None:
            self._filters.advance(self._now, step)
            if not self._now.fits or self._now.tau == 0.0:
                self._now = None
        if self._moved is not None:
            self._filters.advance(self._moved, step)
            if self._moved.far >= IN_A_ROW or t - self._alarmed > self._slower * _QUIET:
                self._moved = None
        if self._compared is not None:
            for each in self._compared.filters:
                self._filters.advance(each, step)
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
        age = self._slower * (_OLD if since > 0.0 else _YOUNG)
        old = [state for state in self._states if state.t <= t - age]
        if not old and self._is_after_leap:
            old = [self._states[0]]
        if not old:  # it has just begun: where from is what may be wrong
            return
        if since > 0.0:
            self._tried = t
        steps = [step for step in self._steps if step.t > old[-1].t + TIME_TOLERANCE]
        nothing, before, sizes = old[-1].begun(), list[tuple[int, LeapFilter]](), LeapSizes()
        gusty = replace(nothing, louder=_LOUDER)
        for k, step in enumerate(steps):
            if step.y is not None and step.t >= min(t - since, self._read):
                before.append((k, copy(nothing)))
                sizes.begin()
            sizes.predict(self._filters.predict(nothing, step))
            if (read := self._filters.condition(nothing, step)) is not None:
                sizes.read(read)
            self._filters.advance(gusty, step)
        if before:
            k, at = before[sizes.likeliest]
            moved, late = at.leap(moved=True), at.leap(moved=False)
            for step in steps[k:]:
                self._filters.advance(moved, step)
                self._filters.advance(late, step)
            self._compared = _Compared(nothing, moved, late, gusty, since > 0.0, old[-1].tau > 0.0)
