"""The tests of a floating base by its feet: does the velocity of those that stand agree with the estimate?

The innovations of a filter by feet, z_k - R' v of each foot k that stands, are those of an IMU whose errors are as
declared and of feet that slip by no more than that. One foot may slide: of several the median counts, of each component
by itself. Their mean over 0.05 s, in which slips stay the same, has the covariance H P H' + sigma^2 I and is tested as
innovations of any sensor are (``integrity.innovations``). An alarm is of the IMU, as a rule: the covariance becomes as
much larger as the innovations are, the place may be off by what the velocity was, summed up, and the estimate is not OK
for 20 s. Feet that were all refused since the test before it say what the velocity is.
"""

from __future__ import annotations

import numpy as np

from mathnavi.estimators.integrity.innovations import InnovationMonitor
from mathnavi.estimators.invariant.strapdown import PLACE, SPEED, Strapdown
from mathnavi.interfaces.signals import Array, Status
from mathnavi.models.tolerances import TIME_TOLERANCE

SLIPS_FOR = 0.05
"""time [s] over which a foot's slip velocity stays the same"""


class FootWitness:
    """Tests of the velocities of the feet that stand, and what follows from an alarm."""

    def __init__(self, slip: float) -> None:
        """``slip`` [m/s] is the standard deviation of the velocity of a foot that stands."""
        self._monitor = InnovationMonitor("readings of feet", 3, SLIPS_FOR)
        self._R = slip**2 * np.eye(3)
        self._sum, self._expected, self._count = np.zeros(3), np.zeros((3, 3)), 0  # since the test before
        self._begun = 0.0  # [s] of it
        self._used = False  # whether a foot was since then
        self._astray = 0.0  # [m] by which the place may be off by now

    def doubt(self, t: float) -> tuple[Status, str]:
        """Status at t [s] as far as the feet agree with the estimate, and why."""
        status = self._monitor.status(t)
        return status, self._monitor.message if status is not Status.OK else ""

    def take(self, t: float, off: Array, expected: Array, strapdown: Strapdown) -> bool:
        """Take the innovations (k, 3) [m/s] of feet that stand, along the body's axes, before any was used.

        ``expected`` (3, 3) is H P H' of a foot. Returns True at an alarm, which widens the covariance of ``strapdown``.
        """
        if self._count == 0:
            self._begun = t
        self._sum += np.median(off, axis=0)
        self._expected += expected
        self._count += 1
        if t - self._begun < SLIPS_FOR - TIME_TOLERANCE:
            return False
        nu, S = self._sum / self._count, self._expected / self._count + self._R
        self._monitor.note(t, nu, S, self._R)
        if self._monitor.alarming:
            self._follow(nu, t - self._begun, strapdown)
        self._sum, self._expected, self._count, self._used = np.zeros(3), np.zeros((3, 3)), 0, False
        return self._monitor.alarming

    def used(self) -> None:
        """Note that the filter was conditioned on a foot."""
        self._used = True

    def _follow(self, nu: Array, since: float, strapdown: Strapdown) -> None:
        """Make the covariance one that explains an alarm, by nu (3,) [m/s] on average since ``since`` [s]."""
        strapdown.widen(self._monitor.inflation, place=False)
        P = strapdown.P
        further = self._astray + float(np.linalg.norm(nu)) * since
        P[PLACE, PLACE] += (further**2 - self._astray**2) * np.eye(3)
        self._astray = further
        if self._used:
            self._monitor.begin_again()
            return
        strapdown.X[:3, 3] += strapdown.X[:3, :3] @ nu
        P[SPEED, :] = P[:, SPEED] = 0.0
        P[SPEED, SPEED] = self._R + np.outer(nu, nu)
