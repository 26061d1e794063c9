"""The lag of a vehicle behind its plan that comes from holding each command, and the most that a tracker allows.

Commands are held for a period h. Over the window from t to t + h the tracker commands the plan's mean acceleration

    abar = (v(t + h) - v(t)) / h,

so that velocity is kept at both ends while position is lost, if the plan's acceleration changes in between, by

    d = p(t + h) - p(t) - h v(t) - h^2 abar / 2.

What was lost before is made up for by the feedback, which is held as well. The lag e = (position, velocity) of the
vehicle from the plan is, without noise and gusts,

    e(t + h) = Phi e(t) - (d, 0),    Phi = [[1 - (omega h)^2 / 2, h - omega h^2], [-omega^2 h, 1 - 2 omega h]].

Within a window the vehicle is off by no more than the integral of |v - v_held|, which is at most the trapezoids under
it between the breakpoints, for a norm is convex. A plan is trackable if the lag stays below what the tracking bound
sets aside for it, over its whole future and from the lag that is there when it takes over.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.kernels import state_on
from mathnavi.models.tolerances import TIME_TOLERANCE

NO_LAG = np.zeros(6)
NO_LAG.setflags(write=False)
_LONGEST = 1e7  # [s] of a plan
_GONE = 1e-9  # [m] of a lag that no longer matters


@dataclass(frozen=True)
class HeldInput:
    """Lag of a critically damped tracker whose commands are held."""

    period: float  # [s] h
    bandwidth: float  # [rad/s] omega of the feedback
    allowed: float  # [m] greatest lag in position that the tracking bound has room for

    def after(self, plan: Plan, lag: Array, begin: float, end: float) -> Array:
        """Lag (6,) [m, m/s] at ``end`` [s] along a plan, from the lag (6,) at ``begin`` [s].

        Both times are control instants, a whole number of periods apart.
        """
        later: Array = self._along(plan, begin, end, lag)[0]
        return later

    def greatest(self, plan: Plan, lag: Array = NO_LAG) -> float:
        """Greatest lag [m] over a plan's whole future, from the lag (6,) [m, m/s] at its start.

        It bounds the feedback too: a lag of e commands no more than omega^2 |e|, and more than that counts as the lag
        that would command it. Infinite for a plan too long to count its periods.
        """
        if not plan.t_end - plan.t_start <= _LONGEST:
            return math.inf
        _, position, feedback = self._along(plan, plan.t_start, math.inf, lag)
        return max(position, feedback / self.bandwidth**2)

    def _along(self, plan: Plan, begin: float, end: float, lag: Array) -> tuple[Array, float, float]:
        writable = lag.copy()  # for a read-only array the kernel would be compiled once more
        return _lag_along(plan.t, plan.x, plan.u, begin, end, self.period, self.bandwidth, writable)


@njit(cache=True, nogil=True)
def _lag_along(
    breaks: Array, x: Array, u: Array, begin: float, end: float, h: float, omega: float, lag: Array
) -> tuple[Array, float, float]:
    """Lag (6,) at ``end`` [s], the greatest lag [m] on the way, and the greatest feedback [m/s^2] that it commands.

    With ``end`` infinite until the plan has ended and the lag is gone.
    """
    pp, pv = 1.0 - 0.5 * (omega * h) ** 2, h - omega * h * h
    vp, vv = -omega * omega * h, 1.0 - 2.0 * omega * h
    e, held, lost = lag.copy(), np.empty(3), np.empty(3)
    greatest, feedback = 0.0, 0.0
    windows = -1 if end == np.inf else round((end - begin) / h)
    k = 0
    arc = 0
    last = len(breaks) - 1
    while windows < 0 or k < windows:
        t0, t1 = begin + k * h, begin + (k + 1) * h
        while arc < last and breaks[arc + 1] <= t0 + TIME_TOLERANCE:
            arc += 1
        size = math.sqrt(e[0] ** 2 + e[1] ** 2 + e[2] ** 2)
        drift = math.sqrt(e[3] ** 2 + e[4] ** 2 + e[5] ** 2)
        if size <= _GONE and drift <= _GONE * omega:
            e[:] = 0.0
            if arc >= last:
                if windows < 0:
                    break
                return e, greatest, feedback
            # Nothing happens until the window in which the next breakpoint lies.
            ahead = int(np.floor((breaks[arc + 1] - begin - TIME_TOLERANCE) / h))
            if ahead > k:
                k = ahead if windows < 0 else min(ahead, windows)
                continue
        asked = 0.0
        for i in range(3):
            asked += (omega * omega * e[i] + 2.0 * omega * e[3 + i]) ** 2
        feedback = max(feedback, math.sqrt(asked))
        within = 0.0
        lost[:] = 0.0
        if arc < last and breaks[arc + 1] < t1 - TIME_TOLERANCE:
            before, after = state_on(breaks, x, u, t0), state_on(breaks, x, u, t1)
            for i in range(3):
                held[i] = (after[3 + i] - before[3 + i]) / h
                lost[i] = after[i] - before[i] - h * before[3 + i] - 0.5 * h * h * held[i]
            # |v - v_held| at the breakpoints within the window, in trapezoids.
            t_left, gap_left = t0, 0.0
            j = arc + 1
            while j <= last and breaks[j] < t1 - TIME_TOLERANCE:
                gap = 0.0
                for i in range(3):
                    gap += (x[j, 3 + i] - before[3 + i] - held[i] * (breaks[j] - t0)) ** 2
                gap = math.sqrt(gap)
                within += 0.5 * (gap + gap_left) * (breaks[j] - t_left)
                t_left, gap_left = breaks[j], gap
                j += 1
            within += 0.5 * gap_left * (t1 - t_left)
        moved = 0.0
        for i in range(3):
            p, v = e[i], e[3 + i]
            e[i] = pp * p + pv * v
            e[3 + i] = vp * p + vv * v
            moved += e[i] ** 2
            e[i] -= lost[i]
        greatest = max(greatest, max(size, math.sqrt(moved)) + within)
        k += 1
    return e, max(greatest, math.sqrt(e[0] ** 2 + e[1] ** 2 + e[2] ** 2)), feedback
