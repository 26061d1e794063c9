"""A reference that a quadrotor can follow, near a plan whose accelerations jump.

The plan's arcs have constant accelerations; an attitude cannot jump with them. The reference (p_r, v_r, a_r, j_r) is
the state of a chain of four integrators that is led onto the plan,

    p_r'''' = -omega^4 (p_r - p) - 4 omega^3 (v_r - v) - 6 omega^2 (a_r - a) - 4 omega j_r,

(p, v, a) the plan's. All four poles are at -omega, and on a long arc the reference is the plan. With a ``preview`` d it
is led not onto the plan's present arc but onto the one that holds at t + d, extended back to t: a turn that is known is
begun before.

A jump of the acceleration by Delta at t = 0 leaves p_r - p = Delta psi(t) from -d on. With d = 0, psi = -e^(-omega t)
(t^2 / 2) (1 + omega t), at most 0.907 / omega^2. For every plan with |a| <= A, however often it turns,

    |p_r - p| <= A V(psi),   |v_r - v| <= A V(psi'),   |a_r| <= A V(1_{t > 0} + psi''),

V the total variation (1.813 / omega^2 of psi where d = 0). ``deviation`` computes them. A plan that takes over
unforeseen turns as with d = 0, so a bound is the greater of the two.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mathnavi.controllers.quadrotor.kernels import advanced, target_at
from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.kernels import arc_at

_LONG = 40.0  # 1 / omega, after which a jump is forgotten
_POINTS = 8001


@dataclass(frozen=True)
class Deviation:
    """Bound on the deviation of the reference from a plan with |a| <= 1 m/s^2."""

    position: float  # [s^2] of |p_r - p|
    velocity: float  # [s] of |v_r - v|
    acceleration: float  # |a_r|


@lru_cache(maxsize=8)
def deviation(bandwidth: float, preview: float) -> Deviation:
    """The total variations of what one jump leaves, at a bandwidth omega [rad/s] and a preview d [s]."""
    t = np.linspace(-preview, _LONG / bandwidth, _POINTS)
    # One jump of 1 m/s^2 at t = 0, as a plan; the reference from -preview on.
    breaks, x = np.array([-2.0 * preview - 1.0, 0.0, t[-1] + 1.0]), np.zeros((3, 6))
    x[2, [0, 3]] = 0.5 * breaks[2] ** 2, breaks[2]
    u = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    start = np.zeros((4, 3))
    z = np.array([advanced(start, breaks, x, u, -preview, float(at), preview, bandwidth)[:, 0] for at in t])
    after = np.maximum(t, 0.0)
    errors = z[:, 0] - 0.5 * after**2, z[:, 1] - after, z[:, 2]
    return Deviation(*(float(np.abs(np.diff(part)).sum()) for part in errors))


class ReferenceFilter:
    """Filter of the plan being flown to the reference."""

    def __init__(self, bandwidth: float, preview: float, apart: float) -> None:
        """``apart`` [m, m/s] is the greatest deviation of the reference from the plan; beyond it, it restarts there."""
        self._bandwidth, self._preview, self._apart = bandwidth, preview, apart
        self._t = np.nan  # [s]
        self._z = np.zeros((4, 3))

    def at(self, plan: Plan, t: float) -> Array:
        """Reference (4, 3) p_r, v_r, a_r, j_r at t [s], which does not go back."""
        wanted = target_at(plan.t, plan.x, plan.u, arc_at(plan.t, t), t)
        if not np.isnan(self._t):
            self._z = self.ahead(plan, t)
        if np.isnan(self._t) or not np.abs(self._z[:2] - wanted[:2]).max() <= self._apart:
            self._z = wanted.copy()
            self._z[2] = 0.0  # a vehicle that is level
        self._t = t
        return self._z

    def ahead(self, plan: Plan, t: float) -> Array:
        """Reference (4, 3) at t [s] if the plan stays."""
        z: Array = advanced(self._z, plan.t, plan.x, plan.u, self._t, t, self._preview, self._bandwidth)
        return z
