"""Repeated readings: a sensor with noise does not read the same again and again, so one that does is stuck."""

from __future__ import annotations

import numpy as np

from mathnavi.interfaces.signals import Array

STUCK = 5
"""repetitions of a sensor that is stuck: seldom even where it is rounded to three and a half of its deviations"""


class Repeats:
    """Counter of the repetitions in a row of what a sensor reads."""

    def __init__(self) -> None:
        self._y, self._count = np.empty(0), 0

    def take(self, y: Array) -> int:
        """Take a reading y (m,), and return how many in a row before it were the same."""
        self._count = self._count + 1 if np.array_equal(y, self._y) else 0
        self._y = y.copy()
        return self._count
