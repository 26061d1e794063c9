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


class StuckImu:
    """Parts of an IMU, gyro and accelerometer, that repeat their readings."""

    def __init__(self, deviations: tuple[float, float]) -> None:
        """``deviations`` [rad/s, m/s^2] are those of the readings; a part without noise may repeat one."""
        parts = zip((slice(0, 3), slice(3, 6)), deviations, strict=True)
        self._noisy = [(part, Repeats()) for part, deviation in parts if deviation > 0.0]

    def has(self, reading: Array) -> bool:
        """True for a reading (6,) of an IMU of which a part has read the same many times."""
        return max((same.take(reading[part]) for part, same in self._noisy), default=0) >= STUCK
