"""Rest of a device, at any time: half a second in which its readings vary no more than those of one that lies still.

Each component varies by no more than three declared standard deviations about its mean over the window, and the mean
of the gyro is no larger than its bias can be: four standard deviations of that and of the mean's own noise. A device
that turns evenly, slower than its bias can be, is taken for one at rest.

A motion that begins shows only after some readings, which would be taken for the gyro's bias: that is read from the
oldest reading of the window, at whose time the device is known to have lain still.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.quadrotor.mission import InertialQuality

WINDOW = 0.5
"""time [s] of a window"""
_VARIES, _OFF = 3.0, 4.0  # standard deviations
_LEAST_GYRO, _LEAST_FORCE = 1e-3, 1e-2  # [rad/s, m/s^2] least standard deviations that are assumed


class QuietWindow:
    """The last readings of an inertial measurement unit."""

    def __init__(self, quality: InertialQuality, period: float) -> None:
        gyro, force = max(quality.gyro, _LEAST_GYRO), max(quality.accelerometer, _LEAST_FORCE)
        count = max(math.ceil(WINDOW / period), 8)
        self._kept = np.zeros((count, 6))
        self._sums = np.zeros((2, 6))
        self._count = 0
        self._varies = np.square(_VARIES * np.repeat([gyro, force], 3))
        self._off = _OFF * (quality.gyro_bias + gyro / math.sqrt(count))

    def take(self, reading: Array) -> bool:
        """Take a reading (6,); True if the device has been at rest for the window."""
        at_rest = taken(self._kept, self._sums, self._count, reading, self._varies, self._off)
        self._count += 1
        return bool(at_rest)

    @property
    def oldest(self) -> Array:
        """The oldest reading (6,) of a full window."""
        reading: Array = self._kept[self._count % len(self._kept)]
        return reading

    def clear(self) -> None:
        """Forget the readings, as after a gap."""
        self._count = 0
        self._sums[:] = 0.0


@njit(cache=True, nogil=True)
def taken(kept: Array, sums: Array, count: int, reading: Array, varies: Array, off: float) -> bool:
    """Replace the oldest of the readings ``kept`` (n, 6) by a new one (6,), of which ``count`` came before.

    ``sums`` (2, 6) are those of the readings and of their squares, recomputed each time the window is full.
    True if it is full, the variances are at most ``varies`` (6,) and the means of the gyro at most ``off`` [rad/s].
    """
    n = len(kept)
    k = count % n
    if count >= n:
        for i in range(6):
            sums[0, i] -= kept[k, i]
            sums[1, i] -= kept[k, i] * kept[k, i]
    kept[k] = reading
    if k == n - 1:  # so that rounding does not add up
        sums[:] = 0.0
        for row in kept:
            for i in range(6):
                sums[0, i] += row[i]
                sums[1, i] += row[i] * row[i]
    else:
        for i in range(6):
            sums[0, i] += reading[i]
            sums[1, i] += reading[i] * reading[i]
    if count + 1 < n:
        return False
    for i in range(6):
        mean = sums[0, i] / n
        if sums[1, i] / n - mean * mean > varies[i] or (i < 3 and abs(mean) > off):
            return False
    return True
