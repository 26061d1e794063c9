"""Tests of numbers that are read, each of a channel: what the witnesses of beacons have in common.

A channel, such as a beacon, may be read as several numbers; it is left out with all of them, and the worst of its
numbers is that of the channel. A witness passes the normalised innovation e of each number, read or left out, and the
whitened one w of each that is used (``windows``).
"""

from __future__ import annotations

import copy
import math
from typing import Self

import numpy as np

from mathnavi.estimators.integrity.joint_mean import JointMean
from mathnavi.estimators.integrity.windows import CLIP, MEAN, QUIET, Flags, Thresholds, Windows, Worst
from mathnavi.interfaces.signals import Array, Integers

_SLOW = 2  # the longest windows, over which the mean of all is tested: a leap is found by the others first
_LEAP = 2.0  # readings, over which a leap is tested before the filter has followed it
_FALSE_LEAP = 0.01 / 60.0  # [1/s] of false alarms of that
_REPEATS, _MOVED = 3, 6.0  # repeated readings, and deviations that the prediction has moved meanwhile: stuck


class NumberTests:
    """Windows, joint means and repeats of numbers."""

    rebuilt: frozenset[int] = frozenset()
    suspicious = doubtful = False  # the estimator puts nothing down to anything else

    def __init__(
        self, channels: Integers, deviations: Array, period: float, interval: float, windows: tuple[float, ...],
        outliers: float,
    ) -> None:  # fmt: skip
        """Test numbers of ``channels`` (m,), with the noise of ``deviations`` (m,), over ``windows`` [s] of updates
        every ``period`` [s] with readings every ``interval`` [s], of which a share are ``outliers``.
        """
        size = len(channels)
        self.strict, self._channel, self._deviations = False, channels, deviations
        thresholds = Thresholds.of(size, period, windows, _SLOW)
        self.windows = Windows(thresholds, size, 1.0 - outliers + outliers * CLIP**2)
        self._mean = JointMean(thresholds.lengths[-_SLOW:], size, thresholds.alpha)
        two = np.array([max(2, round(_LEAP * interval / period))])
        clip = CLIP if outliers > 0.0 else math.inf
        self._leap = JointMean(two, size, _FALSE_LEAP * interval, fewest=2, clip=clip)
        self._own = JointMean(two, size, thresholds.alpha, fewest=2, clip=clip)  # of each number, left out or not
        self._nothing = np.full(size, np.nan)
        self._last, self._first, self._moved = (self._nothing.copy() for _ in range(3))
        self._repeats, self._most = np.zeros(size, dtype=np.int64), 0
        self._worst = QUIET
        self._level = np.full(2, np.nan)

    def add(self, e: Array, white: Array) -> None:
        """Add the innovations (m,) of an update, NaN for numbers that were not read, or not used."""
        self.windows.add(e, white)
        for each in (self._mean, self._leap):
            each.add(white)
        self._own.add(e)

    def note_repeats(self, y: Array, expected: Array, read: Flags) -> None:
        """Count how often each number y (m,) that is ``read`` (m,) was read before."""
        same = read & (y == self._last)
        self._repeats = np.where(same, self._repeats + 1, np.where(read, 0, self._repeats))
        self._most = int(self._repeats.max())
        self._first = np.where(read & ~same, expected, self._first)
        self._moved = np.where(read, expected, self._moved)
        self._last = np.where(read, y, self._last)

    def worst_of(self, relied: Flags) -> Worst:
        """The worst test over the numbers ``relied`` (m,) on, by its channel."""
        worst = self.windows.worst(relied)
        if worst.channel >= 0:
            worst = worst._replace(channel=int(self._channel[worst.channel]))
        together = self._mean.worst(self.windows.kappa)
        self._worst = Worst(together, MEAN, -1) if together > worst.ratio else worst
        return self._worst

    @property
    def leap(self) -> float:
        """Statistic of a leap over its threshold: of the last two readings, before a filter has followed them."""
        return self._leap.worst(self.windows.kappa)

    @property
    def protection(self) -> Array:
        """Protection level of the last estimate."""
        return self._level

    def widened(self, covariance: Array) -> Array:
        return covariance  # an estimate by beacons is DEGRADED meanwhile

    def stuck(self) -> list[int]:
        """Channels with a number that stays while what it should be moves."""
        if self._most < _REPEATS:
            return []
        moved = np.abs(self._moved - self._first) > _MOVED * self._deviations
        stays = (self._repeats >= _REPEATS) & moved
        return sorted({int(each) for each in self._channel[stays]})

    def _numbers(self, channel: int) -> list[int]:
        """Numbers of a channel."""
        return np.flatnonzero(self._channel == channel).tolist()

    def against(self, channel: int) -> float:
        """The largest ratio of a channel's own tests."""
        kappa, numbers = self.windows.kappa, self._numbers(channel)
        leaps = (self._own.worst(kappa, k) for k in numbers)  # where all together alarm at once
        return max(*leaps, *(self.windows.of_channel(k) for k in numbers))

    def is_quiet(self, channel: int, updates: int) -> bool:
        """True if the last updates of a channel pass its own tests at the soft level."""
        return all(self.windows.is_quiet(k, updates) for k in self._numbers(channel))

    def forget(self, channel: int) -> None:
        """Forget what was read of a channel."""
        for k in self._numbers(channel):
            self.windows.forget(k)
            for each in (self._mean, self._leap, self._own):
                each.forget(k)

    def clear(self) -> None:
        """Forget what was taken."""
        self.windows.clear()
        for each in (self._mean, self._leap, self._own):
            each.clear()
        self._worst = QUIET

    def copy(self) -> Self:
        """A copy with its own state."""
        made = copy.copy(self)
        made.windows, made._mean = self.windows.copy(), self._mean.copy()
        made._leap, made._own = self._leap.copy(), self._own.copy()
        return made
