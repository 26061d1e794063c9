"""Time of arrival: (A.12) of the thesis, and with other speeds in its denominator.

    eta = T_p + L(p_N) / v,

L being the remaining length by the terminal cost (the thesis prints "Psi") and v

    max        v_max, which makes it the *least* time that is left: no vehicle can go faster (A.12);
    mean       the mean of the speeds at the nodes of the plan, the first alternative printed;
    largest    the largest of them, the second.

The nodes are those at which an optimised arc begins, p_1 ... p_(N-1); as printed p_N counts, too.

Communicated as a time of arrival, t + eta, it does not fall by h from one planning instant to the next, and vehicles
that plan at different instants can compare theirs. A plan that meets its target within its optimised part arrives when
it says; of a plan whose optimised part is over, the length is measured from where the vehicle is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from mathnavi.controllers.flight.certificate import pass_time
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.signals import OPTIMISED, Array, Plan
from mathnavi.models.aerial.dynamics import state_at

SpeedName = Literal["max", "mean", "largest"]

_SLOWEST = 1e-3  # [m/s] below which a plan gives no time


@configuration
class ArrivalEstimate:
    """Estimate of the time at which plans arrive at one target."""

    length_to_go: Callable[[Array], Array]  # (n, 3) [m] -> (n,) [m]
    target: Array  # (3,) [m]
    speed_max: Positive  # [m/s] v_max
    speed: SpeedName = "max"

    def __call__(self, plan: Plan, t: float) -> float:
        """Time [s] at which a vehicle on ``plan`` arrives, as known at t [s]; infinite for a plan that stands still."""
        met = self.arrives(plan, t)
        optimised = plan.phase == OPTIMISED
        end = float(plan.t[1:][optimised][-1]) if optimised.any() else plan.t_start
        if met <= end:
            return met
        last = max(t, end)
        left = float(self.length_to_go(state_at(plan, last)[np.newaxis, :3])[0])
        speeds = np.linalg.norm(plan.x[:-1][optimised][:, 3:], axis=1)
        v = self.speed_max
        if self.speed != "max":
            v = float(speeds.mean() if self.speed == "mean" else speeds.max()) if len(speeds) else 0.0
        return last + left / v if v > _SLOWEST else np.inf

    def arrives(self, plan: Plan, t: float) -> float:
        """Time [s] after t [s] at which a plan, flown to its end, is at the target; infinite if it never is."""
        return pass_time(plan, self.target, t)
