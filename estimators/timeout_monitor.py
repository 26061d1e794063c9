"""Age of the newest reading that an estimator has used, and the status that follows from it.

The timeout is the longest gap between readings that is declared, but for a sensor that reads seldom, of which one
reading may be missing. After a longer one the estimate is DEGRADED until it has converged again: readings have come
without such a gap for as long as it needs to settle, they have agreed with it for the timeout, and its standard
deviations are no more than 1.5 times those that it had when it was OK last.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array, Status
from mathnavi.models.tolerances import TIME_TOLERANCE

FARTHEST = 60.0
"""longest time [s] over which a motion is predicted in one step: nothing follows from a state that is older"""

_WIDER = 1.5**2  # of a variance
_MISFIT, _FORGETTING = 2.5, 0.1  # greatest mean of squared innovations that fit, and the weight of a reading in it
_INTERVALS = 2.1  # between readings, one of which was lost, with some jitter
_WORST_FIRST = (Status.INITIALISING, Status.LOST, Status.DEGRADED)


class TimeoutMonitor:
    """Monitor of the time since the last reading was used."""

    def __init__(
        self,
        timeout: float,
        interval: float,
        *,
        settling: float | None = None,
        beyond: Status = Status.LOST,
        of: str = "readings",
    ) -> None:
        """``timeout`` is the time [s] without a reading after which the status is ``beyond``: LOST, or DEGRADED where
        the other sensors of the estimator still bound its error. ``interval`` [s] is the declared time between
        readings.

        ``settling`` is the time [s] that it takes to converge after such a gap, the timeout if not given; readings
        have to agree for the timeout in the end. ``of`` names the readings, in the plural.
        """
        self._timeout, self._beyond = timeout, beyond
        self.longest = max(timeout, _INTERVALS * interval)
        """longest gap [s] after which the estimate is still OK"""
        self._settling = timeout if settling is None else settling
        self._since = math.inf  # [s] from which on readings have agreed since the gap
        self.converged = True
        """False from a gap on that was longer than declared until the estimate is OK again"""
        self._variances: Array | None = None  # (n,) of the last estimate that was OK
        self.t = -math.inf  # [s] of the last reading that was used
        self._of, self._cause = of, ""  # names of the readings, and of what it has to converge after
        self.message = ""
        """why the last ``status`` was neither OK nor INITIALISING"""

    def note(self, t: float, usable: bool = True, agrees: bool = True) -> None:
        """Note the time t [s] of a reading if it was usable, and whether it agreed with the estimate."""
        if not usable:
            return
        if t - self.t > self.longest + TIME_TOLERANCE and self.t > -math.inf:
            self._diverge(t, f"a gap in its {self._of} that ended at {t:.6g} s")
        elif not agrees:
            self.disagree(t)
        self.t = t

    def disagree(self, t: float) -> None:
        """Note that at t [s] the estimate did not agree with the reading of another sensor."""
        if not self.converged:
            self._since = max(self._since, t + min(self._timeout, self._settling) - self._settling)

    def restart(self, t: float) -> None:
        """Note that at t [s] the estimate was wrong, regardless of its status; it has to converge again."""
        self._diverge(t, f"it was wrong at {t:.6g} s")

    def _diverge(self, t: float, cause: str) -> None:
        self.converged, self._since, self._cause = False, t, cause

    def status(self, t: float, covariance: Array | None = None) -> Status:
        """Status at t [s] of an estimate with a ``covariance`` (n, n), or None.

        ``INITIALISING`` before the first reading.
        """
        if self.t == -math.inf:
            return Status.INITIALISING
        if t - self.t > self._timeout + TIME_TOLERANCE:
            self.message = f"has used no {self._of} since {self.t:.6g} s"
            return self._beyond
        if not self.converged:
            if t - self._since < self._settling - TIME_TOLERANCE or self._is_wider(covariance):
                self.message = f"has not converged yet after {self._cause}"
                return Status.DEGRADED
            self.converged = True
        self.message = ""
        self._variances = None if covariance is None else covariance.diagonal().copy()
        return Status.OK

    def _is_wider(self, covariance: Array | None) -> bool:
        if covariance is None or self._variances is None:
            return False
        return not bool((covariance.diagonal() <= _WIDER * self._variances).all())


class InnovationMean:
    """Mean of the normalised squared innovations of the last readings, for each of their components, since a gap.

    It is one for a consistent filter; a filter whose state is wrong, and whose covariance is not, has a greater one.
    """

    def __init__(self, most: float) -> None:
        """``most`` is the greatest square of a component that counts, so that an outlier does not decide."""
        self._most = most
        self._mean = most

    def fits(self, squares: Array, converged: bool) -> bool:
        """Take the squares (k,) of a reading; True if the mean fits, which is not asked while there is no gap."""
        if converged:
            self._mean = self._most
            return True
        if len(squares):
            self._mean += _FORGETTING * (float(np.minimum(squares, self._most).mean()) - self._mean)
        return self._mean <= _MISFIT


def worst(*statuses: Status) -> Status:
    """Worst of the statuses that an estimate has by its sensors."""
    return next((status for status in _WORST_FIRST if status in statuses), statuses[0])


def waiting(status: Status, what: str) -> str:
    """Message of an estimate: ``what`` it waits for while it is INITIALISING; "" later."""
    return f"waits for {what}" if status is Status.INITIALISING else ""


def is_late(t: float, now: float | None) -> bool:
    """True for a reading of t [s] that is older than the state of a filter, which is that of ``now`` [s], or None."""
    return now is not None and t < now - TIME_TOLERANCE


def time_ahead(t: float, now: float) -> float:
    """Time [s] from ``now`` [s], that of a filter's state, to t [s], at which an estimate is due.

    Raises ArgumentError if t is past.
    """
    if is_late(t, now):
        raise ArgumentError(f"an estimate at {t:.6f} s was asked of a filter that is at {now:.6f} s already")
    return t - now
