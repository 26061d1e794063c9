"""Age of the newest reading that an estimator has used, and the status that follows from it."""

from __future__ import annotations

import math

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Status
from mathnavi.models.tolerances import TIME_TOLERANCE


class TimeoutMonitor:
    """Monitor of the time since the last reading was used."""

    def __init__(self, timeout: float) -> None:
        """``timeout`` is the time [s] without a reading after which the estimate is lost."""
        self._timeout = timeout
        self.t = -math.inf  # [s] of the last reading that was used

    def note(self, t: float, usable: bool = True) -> None:
        """Note the time t [s] of a reading if it was usable."""
        if usable:
            self.t = t

    def status(self, t: float) -> Status:
        """Status at t [s]: ``INITIALISING`` before the first reading, ``LOST`` once the last is too old."""
        if self.t == -math.inf:
            return Status.INITIALISING
        return Status.OK if t - self.t <= self._timeout + TIME_TOLERANCE else Status.LOST


def time_ahead(t: float, now: float, what: str) -> float:
    """Time [s] from ``now`` [s], that of a filter's state, to t [s], at which ``what`` comes.

    Raises ArgumentError if t is past.
    """
    h = t - now
    if h < -TIME_TOLERANCE:
        raise ArgumentError(f"{what} at {t:.6f} s reached a Kalman filter that is at {now:.6f} s already")
    return h
