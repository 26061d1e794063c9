"""How far an estimate lies from those of the last seconds, once these were moved on with what was driven since.

A pose that is right stays right when it is moved with the inputs. Estimates that are on their way to the truth, or that
jump, do not agree with one another, and so tell that they are off, and by about how much. What an earlier estimate said
that it might be off by is no disagreement.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mathnavi.controllers.active_sensing.motion import pieces
from mathnavi.models.unicycle.kernels import integrate, wrapped
from mathnavi.sim.interfaces.signals import Array, Plan

_DEVIATIONS = 3.0  # that an estimate may be off by


@dataclass(frozen=True)
class _Earlier:
    """An estimate, and the pose to which it has led by now."""

    t: float  # [s] when it was made
    pose: Array  # (3,)
    allowed: Array  # (2,) [m, rad] that it may be off by


class Disagreement:
    """Of the newest estimate with those of the last ``span`` [s] before it."""

    def __init__(self, span: float) -> None:
        self._span = span
        self._earlier: list[_Earlier] = []
        self._t = 0.0
        self._plan: Plan | None = None  # flown since t

    def of(self, t: float, pose: Array, deviation: Array, plan: Plan | None) -> tuple[float, float]:
        """The largest distance [m] and the largest turn [rad] of a pose (3,) at t [s] from what was said before.

        ``deviation`` (2,) [m, rad] is how far it says that it is off itself; ``plan`` is flown from t on. What was said
        before the first plan is forgotten.
        """
        if self._plan is None:
            self._earlier = []
        else:
            recent = (one for one in self._earlier if one.t >= t - self._span)
            self._earlier = [replace(one, pose=_led(one.pose, self._plan, self._t, t)) for one in recent]
        away = np.zeros(2)
        for one in self._earlier:
            x, y, phi = pose - one.pose
            off = np.array([np.hypot(x, y), abs(wrapped(phi))])
            away = np.maximum(away, np.where(off > one.allowed, off, 0.0))
        self._earlier.append(_Earlier(t, pose, _DEVIATIONS * deviation))
        self._t, self._plan = t, plan
        return float(away[0]), float(away[1])


def _led(pose: Array, plan: Plan, begin: float, end: float) -> Array:
    for u, held in pieces(plan, begin, end):
        pose = integrate(pose, u[0], u[1], held)
    return pose
