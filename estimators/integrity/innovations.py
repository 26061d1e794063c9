"""Monitor of a filter with one sensor: none can be left out, so that the status is all that changes.

The filter passes the innovation nu (m,) of each reading, its covariance S and the noise R, also of readings that it
refuses. The windowed tests are those of ``windows``, over 0.5, 2, 5 and 20 s:

    OK -> DEGRADED      at an alarm; for 20 s with readings, since its cause is unknown, and innovations are quiet again
                        once the estimate has settled at a wrong place
    -> LOST             after four readings in a row that are each off by more than chance allows, one in 1e9
    -> DEGRADED         likewise, after a sensor with noise has read the same six times
    LOST -> DEGRADED    after 5 s with readings and without an alarm

What the longest window has of an alarm of the shorter ones, 5 s after that, is no other alarm.

Innovations also say how much larger they are than declared, and sooner than an alarm: the covariance of the estimate is
larger by the factor of ``excess``, from the sums of w'w and the traces of S and R, and after an alarm by the greatest
such factor since.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.integrity.excess import chances, factor_of
from mathnavi.estimators.integrity.repeats import STUCK, Repeats
from mathnavi.estimators.integrity.windows import ENERGY, MEAN, QUIET, Flags, Thresholds, Windows
from mathnavi.interfaces.signals import Array, Status
from mathnavi.models.tolerances import TIME_TOLERANCE

_WINDOWS = (0.5, 2.0, 5.0, 20.0)  # [s]
LATCHED = 20.0
"""[s] without an alarm until an estimate is OK again whose alarm nothing explains"""
_FOUND = 5.0  # [s] likewise, until it is no longer lost
_GAP = 2.1  # intervals between two readings, of which one is missing, with some jitter
_CHANCE, _IN_A_ROW = 1e-9, 4
_WORDS = {MEAN: "their mean", ENERGY: "their spread"}


class InnovationMonitor:
    """Tests of the innovations of one sensor of m components."""

    def __init__(self, what: str, components: int, interval: float) -> None:
        """``what`` names the readings, which come every ``interval`` [s]."""
        self._what, self._m = what, components
        self.thresholds = Thresholds.of(components, interval, _WINDOWS, further=1)
        """thresholds of its tests"""
        self._windows = Windows(self.thresholds, components)
        self._every = np.ones(components, dtype=bool)
        self._outlier, self._surprise = (float(chdtri(components, each)) for each in (_CHANCE, 1e-3))
        self._chances = chances(int(self.thresholds.lengths[-1]) * components)
        self.in_a_row = 0
        """readings in a row that are off by more than chance allows"""
        self._alarmed = self._lost = -math.inf  # [s] last time, later by the gaps since
        self._recent = -math.inf  # [s] last alarm of the shorter windows
        self._interval, self._t = interval, -math.inf  # [s] between readings; [s] of the newest
        self._repeats = Repeats()
        self.inflation = 1.0
        """factor >= 1 of the covariance of the estimate"""
        self.ratio = 0.0
        """the worst statistic over its threshold"""
        self.message = ""
        self.alarming = self.surprising = False
        """whether the newest reading alarmed, and whether it alone is off by more than one in a thousand is"""

    @property
    def disagrees(self) -> bool:
        """True once ``_IN_A_ROW`` readings in a row are off by more than chance allows: the estimate is lost."""
        return self.in_a_row >= _IN_A_ROW

    def note(self, t: float, nu: Array, S: Array, R: Array, used: Flags | None = None) -> None:
        """Test a reading of t [s] by its innovation nu (m,), of covariance S (m, m) with the reading's own R (m, m).

        Only the components that are ``used`` (m,) are tested, if given.
        """
        if used is not None:
            nu, S, R = nu[used], S[np.ix_(used, used)], R[np.ix_(used, used)]
        if t - self._t > _GAP * self._interval and self._t > -math.inf:  # nothing was tested meanwhile
            gap = t - self._t - self._interval
            self._alarmed, self._lost = self._alarmed + gap, self._lost + gap
        self._t, self.alarming, self.surprising = t, True, False
        try:
            white = np.linalg.solve(np.linalg.cholesky(S), nu)
        except np.linalg.LinAlgError:  # S is no covariance
            white = np.full(len(nu), np.nan)
        if not np.isfinite(white).all():
            self._lost = self._alarmed = t
            self.message = "is not finite, or its covariance is none"
            return
        square = float(white @ white)
        far, self.surprising = square > self._outlier, square > self._surprise
        if self.in_a_row >= _IN_A_ROW and not far:  # what was read while it was lost says nothing of where it is now
            self._windows.clear()
        e = nu / np.sqrt(S.diagonal())
        if used is not None:
            e, white = _spread(e, used), _spread(white, used)
        self._windows.add(e, white)
        self.in_a_row = self.in_a_row + 1 if far else 0
        worst = self._windows.worst(self._every)
        if worst.ratio > 1.0:
            if self._windows.worst(self._every, shorter=True).ratio > 1.0:
                self._recent = t
            elif _FOUND < t - self._recent < LATCHED + _FOUND:  # it is the last alarm that the longest window has
                self._windows.clear()
                worst = QUIET
        self.ratio = worst.ratio
        if self.in_a_row >= _IN_A_ROW:
            self._lost = self._alarmed = t
            self.message = f"disagrees with {self.in_a_row} {self._what} in a row"
        elif worst.ratio > 1.0:
            self._alarmed = t
            self.message = f"disagrees with its {self._what}: {_WORDS.get(worst.test, 'all together')}"
        else:
            self.alarming = False
        windows, joint, own = self._windows, (3 * self._m, 3 * self._m + 1), float(np.trace(R))
        by_motion = max(float(np.trace(S)) - own, 0.0)
        found = factor_of(
            windows.sums, windows.k, joint, self.thresholds.lengths, windows.kappa, *self._chances, by_motion, own
        )
        self.inflation = max(found, self.inflation) if t - self._alarmed < LATCHED else found

    def note_value(self, t: float, y: Array) -> bool:
        """Note a reading y (m,) of t [s], of a sensor with noise; True for one that has read the same again and again.

        The first such is an alarm; they are no readings, and not to be used.
        """
        repeats = self._repeats.take(y)
        if repeats == STUCK:
            self._alarmed = t
            self.message = f"has read the same {self._what} {repeats + 1} times"
        return repeats >= STUCK

    def note_state(self, t: float, square: float, what: str) -> None:
        """Test a part of the state at t [s] that is stationary, of mean zero: x' V^-1 x of m components with
        V = cov(x^).
        """
        ratio = square / float(self.thresholds.energy[self._m])
        if ratio > 1.0:
            self._alarmed = t
            self.message = f"finds {what} that is larger than declared"
        self.ratio = max(self.ratio, ratio)

    def begin_again(self) -> None:
        """Forget the innovations of an estimate that has begun again; what it was found to be stays."""
        self._windows.clear()
        self.in_a_row, self.inflation = 0, 1.0

    def explain(self) -> None:
        """Take what was found so far as explained: by components that are used no more, of an estimate without them."""
        self.begin_again()
        self._lost, self.alarming = -math.inf, False

    def status(self, t: float) -> Status:
        """Status at t [s] as far as the readings agree with the estimate."""
        t = min(t, self._t + self._interval)
        if t - self._lost < _FOUND - TIME_TOLERANCE:
            return Status.LOST
        if t - self._alarmed < LATCHED - TIME_TOLERANCE:
            return Status.DEGRADED
        self.message = ""
        return Status.OK


def _spread(values: Array, used: Flags) -> Array:
    """Values at their places among the components (m,), NaN elsewhere."""
    spread = np.full(len(used), math.nan)
    spread[used] = values
    return spread
