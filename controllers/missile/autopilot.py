"""What the autopilots share: each flies the plan's mean input over a tick, and knows where it will take the missile.

A planner that plans from an estimate has to know the state at which its plan will take over, one period later. That
depends on what the autopilot makes of a deviation until then, so the autopilot says it: an autopilot is a tracker that
predicts.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from mathnavi.controllers.missile.shooting import mean_between
from mathnavi.models.missile.mission import MissileMission
from mathnavi.sim.interfaces.signals import Array, Estimate, Plan


class Autopilot(Protocol):
    """A ``mathnavi.sim.interfaces.protocols.Tracker`` of a missile."""

    period: float  # [s]

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        """The input (nu,) [N, N m] to hold until t + period."""
        ...

    def predict(self, estimate: Estimate, plan: Plan, t: float) -> Array:
        """The state (nx,) at t [s] of the missile that is where the estimate says and flies the plan."""
        ...


def feed_forward(plan: Plan, t: float, period: float) -> Array:
    """(nu,) the plan's mean input over [t, t + period]: an arc may end within a tick."""
    mean: Array = mean_between(plan.t, plan.u, np.array([t, t + period]))[0]
    return mean


def disturbance(estimate: Estimate, size: int) -> Array:
    """(nu,) what acts beside the input, if the estimator sees it."""
    return estimate.extra.get("disturbance", np.zeros(size))


def checked_state(estimate: Estimate, mission: MissileMission) -> Array:
    """The estimate's state (nx,); ValueError for any other shape, which compiled code would read beyond."""
    if estimate.x.shape != (mission.coordinates.state_size,):
        raise ValueError(
            f"the estimate's state has shape {estimate.x.shape}; allowed: ({mission.coordinates.state_size},)"
        )
    return estimate.x
