"""Noise of an IMU as its readings show it: vibrations, or a sensor that is worse than declared.

Within five readings a vehicle moves smoothly. Of each component let r be the reading less the cubic through the four
before it, w their weights (``integrity.smoothness``); r / sqrt(c), c = 1 + sum w_i^2, has the variance of a reading.
Every fifth is independent of the others, and tested by the windowed tests of energy (``integrity.windows``) against the
declared variance. Of a motion at omega, read every h, (omega h)^4 / 8.4 of its amplitude is in r / sqrt(c): an IMU that
is read less than thirty times in a period of a fast turn counts as noisy. While the tests fail, a reading counts as
having the mean square of r / sqrt(c), of the last 200, and of the last ten where they begin to fail.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from mathnavi.estimators.integrity.smoothness import POINTS, cubic_weights
from mathnavi.estimators.integrity.windows import Thresholds, Windows
from mathnavi.interfaces.signals import Array

_WINDOWS = 0.5, 2.0  # [s]
_CLIP = 4.0  # deviations beyond which one counts no more: a bump is no noise
_MEMORY, _FEWEST, _RECENT = 200.0, 50, 10  # readings of the mean, of one at the beginning, and where tests fail
_LARGEST = 25.0  # times the mean, beyond which a square counts no more


class ImuNoise:
    """Variances of the readings of an IMU."""

    def __init__(self, declared: Array) -> None:
        """``declared`` (6,) are the variances [rad^2/s^2, m^2/s^4]."""
        self._declared = declared
        self._past: deque[tuple[float, Array]] = deque(maxlen=POINTS)  # the newest last
        self._windows: Windows | None = None
        self._mean, self._count = declared.copy(), 0
        self._recent: deque[Array] = deque(maxlen=_RECENT)  # squares of r / sqrt(c)
        self.contradicted = False
        """whether the readings are noisier than declared"""

    @property
    def _variances(self) -> Array:
        return np.maximum(self._declared, self._mean) if self.contradicted else self._declared

    def take(self, t: float, y: Array) -> tuple[Array, Array | None]:
        """Take a reading y (6,) of t [s]; return the variances (6,) that it is to be used with.

        Where the tests begin to fail, those (6,) [rad^2, m^2/s^2] of what readings have added up to since the noise
        began, beyond what was declared, are returned too.
        """
        past = self._past
        if past and not t > past[-1][0]:
            past.clear()
        harm = None
        if len(past) == POINTS:
            w = cubic_weights([t, *(each for each, _ in reversed(past))])
            r = (y - w @ np.array([each for _, each in reversed(past)])) / math.sqrt(1.0 + float(w @ w))
            harm = self._test(t - past[-1][0], r)
        past.append((t, y))
        return self._variances, harm

    def _test(self, period: float, r: Array) -> Array | None:
        self._count += 1
        self._recent.append(np.square(r))
        squares = np.minimum(np.square(r), _LARGEST * self._mean)
        self._mean += (squares - self._mean) / min(_FEWEST + self._count, _MEMORY)
        if self._count % (POINTS + 1):
            return None
        if self._windows is None:
            self._windows = Windows(Thresholds.of(len(r), (POINTS + 1) * period, _WINDOWS), len(r))
        e = np.clip(r / np.sqrt(self._declared), -_CLIP, _CLIP)
        self._windows.add(e, np.full(len(r), np.nan))
        before, self.contradicted = self.contradicted, self._windows.worst(np.ones(len(r), np.bool_)).ratio > 1.0
        if before or not self.contradicted:
            return None
        self._mean = np.maximum(self._mean, np.mean(self._recent, axis=0))
        return (self._variances - self._declared) * period * _WINDOWS[0]
