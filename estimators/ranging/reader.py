"""Selection of the readings that a range estimator uses, the count of those that it does not, and its status.

Ranges bound the error of the pose; while they are missing it grows with the odometry's, and the estimate is lost in the
end. Missing odometry is replaced by the command: after a declared gap the estimate is degraded, for nobody measures
how the robot moves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mathnavi.estimators.timeout_monitor import TimeoutMonitor, is_late, worst
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused
from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.models.unicycle.mission import RangingMission

RANGES, ODOMETRY = "ranges", "odometry"
"""names of the sensors"""

TOO_LONG = 2.0  # times the longest distance within the wall: no ray reads that, even with noise
TOO_FAST = 10.0  # times the robot's limits


class RangeReader:
    """Reader of ranges and odometry."""

    def __init__(self, mission: RangingMission, timeout: float, settling: float | None = None) -> None:
        """``timeout`` is the longest time [s] without ranges, and without odometry, that is declared; ``settling`` is
        that of a ``TimeoutMonitor``.
        """
        self._sensors = mission.sensors
        self.longest = mission.sensors_carried()[0].longest
        """longest distance [m] within the wall"""
        self._limits = TOO_FAST * np.array([mission.speed_max, mission.turn_rate_max])
        self._ranges = TimeoutMonitor(timeout, mission.period, settling=settling)
        self._odometry = TimeoutMonitor(timeout, mission.period, settling=settling, beyond=Status.DEGRADED)
        self._t_ranges = self._t_odometry = -math.inf  # [s] of the newest readings
        self.counts = ReadingCounts()

    def read(self, t: float, measurements: Sequence[Measurement], command: Array) -> tuple[Array, Array]:
        """Ranges (l,) [m], NaN where a ray was lost, and the input u (2,) [m/s, rad/s] over the period that ends now.

        A range that is not finite, not positive or too long is lost. The input is odometry if it is usable, or the
        ``command`` (2,). Raises ArgumentError for a reading of ranges of another length.
        """
        for reading in measurements:
            if reading.name not in (RANGES, ODOMETRY):
                self.counts.add(Unused.UNKNOWN_SENSOR)
        rho, measured = self.ranges(measurements), self.odometry(measurements)
        self._odometry.note(t, measured is not None)
        return rho, command if measured is None else measured

    def ranges(self, measurements: Sequence[Measurement]) -> Array:
        """Ranges (l,) [m] of the newest reading, NaN where a ray was lost; ArgumentError as of ``read``."""
        newest = None
        for reading in measurements:
            if reading.name == RANGES:
                if reading.value.shape != (self._sensors,):
                    raise ArgumentError(
                        f"a reading of ranges has shape {reading.value.shape}; allowed: ({self._sensors},)"
                    )
                if is_late(reading.t, self._t_ranges):
                    self._superseded(reading)
                else:
                    if newest is not None:
                        self._superseded(newest)
                    newest, self._t_ranges = reading, reading.t
        return np.full(self._sensors, np.nan) if newest is None else self._usable(newest.value)

    def _superseded(self, reading: Measurement) -> None:
        """Count the rays of a reading that is older than one that is used."""
        self.counts.add(Unused.LATE, int(np.isfinite(reading.value).sum()))

    def _usable(self, value: Array) -> Array:
        usable = (value > 0.0) & (value < TOO_LONG * self.longest)  # neither holds of NaN
        if not usable.all():
            self.counts.add(Unused.NOT_FINITE, int(np.isinf(value).sum()))
            self.counts.add(Unused.OUT_OF_RANGE, int((np.isfinite(value) & ~usable).sum()))
        return np.where(usable, value, np.nan)

    def odometry(self, measurements: Sequence[Measurement]) -> Array | None:
        """Newest odometry (2,) [m/s, rad/s]; None if there is none that is finite and not far beyond the limits of the
        robot.
        """
        found = None
        for reading in measurements:
            if reading.name == ODOMETRY:
                if is_late(reading.t, self._t_odometry):
                    self.counts.add(Unused.LATE)
                elif (np.abs(reading.value) <= self._limits).all():
                    self.counts.add(Unused.LATE, int(found is not None))
                    found, self._t_odometry = reading.value, reading.t
                else:
                    finite = bool(np.isfinite(reading.value).all())
                    self.counts.add(Unused.OUT_OF_RANGE if finite else Unused.NOT_FINITE)
        return found

    def note(self, t: float, rho: Array, agrees: bool = True) -> None:
        """Note the ranges rho (l,) [m] that were used at t [s], and whether they agreed with the estimate."""
        self._ranges.note(t, not np.isnan(rho).all(), agrees)

    @property
    def converged(self) -> bool:
        """False from a gap on that was longer than declared until the estimate is OK again."""
        return self._ranges.converged and self._odometry.converged

    def status(self, t: float, covariance: Array | None = None) -> Status:
        """Status at t [s] of an estimate with a ``covariance`` (n, n), or None."""
        return worst(self._ranges.status(t, covariance), self.odometry_status(t, covariance))

    def odometry_status(self, t: float, covariance: Array | None = None) -> Status:
        """Status at t [s] as far as odometry is concerned; OK of a robot that has none."""
        status = self._odometry.status(t, covariance)
        return Status.OK if status is Status.INITIALISING else status
