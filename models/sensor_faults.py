"""Sensors that lose readings, as wrappers around any sensor."""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.protocols import Sensor, StateView
from mathnavi.interfaces.signals import Array
from mathnavi.models.tolerances import TIME_TOLERANCE

_NEVER = 5.7e-7  # probability of a gap that is neglected: that of five standard deviations


def longest_gap(interval: float, dropout_rate: float, timeout: float) -> float:
    """Longest time [s] without a reading to account for, while an estimate is not yet lost.

    Readings come every ``interval`` [s], a fraction ``dropout_rate`` of them is lost, independently, and after
    ``timeout`` [s] without one the estimate is lost. A longer gap is as unlikely as five standard deviations.
    """
    if dropout_rate >= 1.0:
        return timeout
    lost = 0 if dropout_rate == 0.0 else math.ceil(math.log(_NEVER) / math.log(dropout_rate))
    return min((1 + lost) * interval, timeout)


def rms_gap(interval: float, dropout_rate: float, timeout: float) -> float:
    """Root mean square [s] of the time since the last reading, just before the next one is due.

    With n lost readings in a row of probability (1 - q) q^n, E (1 + n)^2 = (1 + q) / (1 - q)^2.
    """
    q = dropout_rate
    return timeout if q >= 1.0 else min(interval * math.sqrt(1.0 + q) / (1.0 - q), timeout)


class Dropout:
    """A sensor that loses a fraction ``rate`` of its readings.

    The losses are drawn from ``rng``, not from the sensor's own generator, so the readings that do arrive are those of
    the faultless sensor.
    """

    def __init__(self, sensor: Sensor, rate: float, rng: np.random.Generator) -> None:
        if not 0.0 <= rate <= 1.0:
            raise FieldError(f"{sensor.name}: dropout rate = {rate!r} is not a rate; allowed: 0 to 1")
        self.name, self.size, self.rate = sensor.name, sensor.size, sensor.rate
        self._sensor, self._loss, self._rng = sensor, rate, rng

    def read(self, motion: StateView, rng: np.random.Generator) -> Array | None:
        """Read the sensor, (size,); None where the reading is lost."""
        reading = self._sensor.read(motion, rng)
        return None if self._rng.random() < self._loss else reading


class Outage:
    """A sensor without readings between the times ``spans`` [s], the first of each included.

    The other readings are those of the faultless sensor. It counts readings to know the time, so it needs a rate, and
    it belongs to one vehicle and one run.
    """

    def __init__(self, sensor: Sensor, spans: tuple[tuple[float, float], ...]) -> None:
        if sensor.rate is None:
            raise FieldError(f"{sensor.name}: rate = None; allowed for a sensor with outages: a rate")
        self.name, self.size, self.rate = sensor.name, sensor.size, sensor.rate
        self._sensor, self._spans, self._period, self._count = sensor, spans, 1.0 / sensor.rate, 0

    def read(self, motion: StateView, rng: np.random.Generator) -> Array | None:
        """Read the sensor, (size,); None during an outage."""
        reading = self._sensor.read(motion, rng)
        t = self._count * self._period
        self._count += 1
        return None if any(begin <= t + TIME_TOLERANCE < end for begin, end in self._spans) else reading


class Saturated:
    """A sensor that reads ``most`` in place of every greater value, as rangefinders beyond their reach do."""

    def __init__(self, sensor: Sensor, most: float) -> None:
        self.name, self.size, self.rate = sensor.name, sensor.size, sensor.rate
        self._sensor, self._most = sensor, most

    def read(self, motion: StateView, rng: np.random.Generator) -> Array | None:
        """Read the sensor, (size,)."""
        reading = self._sensor.read(motion, rng)
        return None if reading is None else np.minimum(reading, self._most)
