"""No autopilot at all: the plan's inputs, whatever becomes of them."""

from __future__ import annotations

import numpy as np

from mathnavi.controllers.missile.autopilot import checked_state, feed_forward
from mathnavi.controllers.missile.trajectory import flown
from mathnavi.models.missile.mission import MissileMission
from mathnavi.sim.interfaces.signals import Array, Estimate, Plan


class OpenLoop:
    """Flies the plan's mean input over each tick."""

    def __init__(self, mission: MissileMission) -> None:
        self.period = mission.control_period
        self._mission = mission

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        return feed_forward(plan, t, self.period)

    def predict(self, estimate: Estimate, plan: Plan, t: float) -> Array:
        """The declared body flies on from the estimate with the plan's inputs."""
        x, now = checked_state(estimate, self._mission), estimate.t
        inner = plan.t[(plan.t > now) & (plan.t < t)]
        breaks = np.concatenate([[now], inner, [t]])
        u = np.array([self._mission.coordinates.input_at(plan, float(begin)) for begin in breaks[:-1]])
        end: Array = flown(x, breaks, u, self._mission.coordinates, self._mission.body)[-1]
        return end
