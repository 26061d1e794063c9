"""Repeated readings: a sensor with noise does not read the same again and again, so one that does is stuck."""

from __future__ import annotations

import numpy as np

from mathnavi.interfaces.signals import Array

_MOST = 5  # repetitions: seldom even where a reading is rounded to three and a half of its deviations


class Repeats:
    """Counter of the repetitions in a row of what a sensor reads."""

    def __init__(self) -> None:
        self._y, self._count = np.empty(0), 0

    def is_stuck(self, y: Array) -> bool:
        """Take a reading y (m,); True if it and the ones before it are the same too many times."""
        self._count = self._count + 1 if np.array_equal(y, self._y) else 0
        self._y = y.copy()
        return self._count >= _MOST
