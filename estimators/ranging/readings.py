"""Selection of the readings that a range estimator uses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array, Measurement

TOO_LONG = 2.0  # times the longest distance within the wall: no ray reads that, even with noise
TOO_FAST = 10.0  # times the robot's limits


def usable_ranges(measurements: Sequence[Measurement], sensors: int, longest: float) -> Array:
    """Ranges (l,) [m], NaN where a ray was lost: no reading, or one that is not finite, not positive or too long.

    ``longest`` [m] is the longest distance within the wall. Raises ArgumentError for a reading of another length.
    """
    rho = np.full(sensors, np.nan)
    for reading in measurements:
        if reading.name == "ranges":
            if reading.value.shape != (sensors,):
                raise ArgumentError(f"a reading of ranges has shape {reading.value.shape}; allowed: ({sensors},)")
            usable = (reading.value > 0.0) & (reading.value < TOO_LONG * longest)  # neither holds of NaN
            rho = np.where(usable, reading.value, np.nan)
    return rho


def measured_input(measurements: Sequence[Measurement], command: Array, limits: Array) -> Array:
    """Input u (2,) [m/s, rad/s] over the period that ends now: odometry if it is usable, or ``command`` (2,).

    Odometry is not usable if it is not finite or far beyond the ``limits`` (2,) of the robot.
    """
    for reading in measurements:
        if reading.name == "odometry" and (np.abs(reading.value) <= TOO_FAST * limits).all():
            return reading.value
    return command
