"""Selection of the readings that a range estimator uses, the count of those that it does not, and its status.

Ranges bound the error of the pose; while they are missing it grows with the odometry's, and the estimate is lost in the
end. Missing odometry is replaced by the command: after a declared gap the estimate is degraded, for no one measures
how the robot moves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mathnavi.estimators.ranging.reading_kernels import is_within, select_ranges
from mathnavi.estimators.timeout_monitor import TimeoutMonitor, is_late, worst
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused
from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.models.unicycle.mission import RangingMission

RANGES, ODOMETRY = "ranges", "odometry"
"""names of the sensors"""

TOO_FAST = 10.0  # times the robot's limits


class RangeReader:
    """Reader of ranges and odometry."""

    def __init__(self, mission: RangingMission, timeout: float, settling: float | None = None) -> None:
        """``timeout`` is the longest time [s] without ranges, and without odometry, that is declared; ``settling`` is
        that of a ``TimeoutMonitor``.
        """
        self._sensors = mission.sensors
        carried = mission.sensors_carried()[0]
        self.longest = carried.longest
        """longest distance [m] within the wall"""
        self._too_long, self._nothing = carried.too_long, np.full(mission.sensors, np.nan)
        self._limits = TOO_FAST * np.array([mission.speed_max, mission.turn_rate_max])
        self._ranges = TimeoutMonitor(timeout, mission.period, settling=settling, of=RANGES)
        self._odometry = TimeoutMonitor(timeout, mission.period, settling=settling, beyond=Status.DEGRADED, of=ODOMETRY)
        self._t_ranges = self._t_odometry = -math.inf  # [s] of the newest readings
        self._known = 0  # readings of the two sensors in the last call
        self.rays = 0
        """number of usable ranges in the last call"""
        self.counts = ReadingCounts()

    def read(self, t: float, measurements: Sequence[Measurement], command: Array) -> tuple[Array, Array]:
        """Ranges (l,) [m], NaN where a ray was lost, and the input u (2,) [m/s, rad/s] over the period that ends now.

        A range that is not finite, not positive or too long is lost. The input is odometry if it is usable, or the
        ``command`` (2,). Raises ArgumentError for a reading of ranges of another length.
        """
        rho, measured = self.ranges(measurements), self.odometry(measurements)
        if len(measurements) > self._known:
            self.counts.add(Unused.UNKNOWN_SENSOR, len(measurements) - self._known)
        self._odometry.note(t, measured is not None)
        return rho, command if measured is None else measured

    def ranges(self, measurements: Sequence[Measurement]) -> Array:
        """Ranges (l,) [m] of the newest reading, NaN where a ray was lost; ArgumentError as of ``read``.

        Sets ``rays``, the number of those that were not lost.
        """
        newest, self._known = None, 0
        for reading in measurements:
            if reading.name == RANGES:
                self._known += 1
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
        rho = np.empty(self._sensors)
        value = self._nothing if newest is None else np.ascontiguousarray(newest.value, np.float64)
        self.rays, out_of_range, infinite = select_ranges(value, self._too_long, rho)
        if out_of_range or infinite:
            self.counts.add(Unused.OUT_OF_RANGE, out_of_range)
            self.counts.add(Unused.NOT_FINITE, infinite)
        return rho

    def _superseded(self, reading: Measurement) -> None:
        """Count the rays of a reading that is older than one that is used."""
        self.counts.add(Unused.LATE, int(np.isfinite(reading.value).sum()))

    def odometry(self, measurements: Sequence[Measurement]) -> Array | None:
        """Newest odometry (2,) [m/s, rad/s]; None without one that is finite and not far beyond the limits of the
        robot. ArgumentError for a reading of another length.
        """
        found = None
        for reading in measurements:
            if reading.name == ODOMETRY:
                self._known += 1
                u = np.ascontiguousarray(reading.value, np.float64)
                if u.shape != (2,):
                    raise ArgumentError(f"a reading of odometry has shape {u.shape}; allowed: (2,)")
                if is_late(reading.t, self._t_odometry):
                    self.counts.add(Unused.LATE)
                elif is_within(u, self._limits):
                    if found is not None:
                        self.counts.add(Unused.LATE)
                    found, self._t_odometry = reading.value, reading.t
                else:
                    finite = bool(np.isfinite(u).all())
                    self.counts.add(Unused.OUT_OF_RANGE if finite else Unused.NOT_FINITE)
        return found

    def note(self, t: float, agrees: bool = True) -> None:
        """Note that the ranges of t [s] were used, if any were read, and whether they agreed with the estimate."""
        if self.rays:
            self._ranges.note(t, agrees=agrees)
            if not agrees:
                self._odometry.disagree(t)

    @property
    def converged(self) -> bool:
        """False from a gap on that was longer than declared until the estimate is OK again."""
        return self._ranges.converged and self._odometry.converged

    def status(self, t: float, covariance: Array | None = None) -> Status:
        """Status at t [s] of an estimate with a ``covariance`` (n, n), or None."""
        status, odometry = self._ranges.status(t, covariance), self.odometry_status(t)
        return status if odometry is Status.OK else worst(status, odometry)

    @property
    def message(self) -> str:
        """Why the last status was neither OK nor INITIALISING."""
        return self._ranges.message or self._odometry.message

    def odometry_status(self, t: float) -> Status:
        """Status at t [s] as far as odometry is concerned; OK of a robot that has none."""
        status = self._odometry.status(t)
        return Status.OK if status is Status.INITIALISING else status
