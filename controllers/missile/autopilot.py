"""Autopilots: each flies the plan's mean input over a tick, and predicts where it will take the missile.

A planner that plans from an estimate needs the state at which its plan will take over, one period later. That depends
on how the autopilot acts on a deviation until then, so the autopilot predicts it: an autopilot is a tracker that
predicts. ``OpenLoop`` has no feedback: it flies the plan's inputs, regardless of the deviation.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from mathnavi.controllers.missile.optimiser import flown
from mathnavi.controllers.missile.shooting import mean_between
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array, Estimate, Plan
from mathnavi.models.missile.mission import MissileMission


class Autopilot(Protocol):
    """A ``mathnavi.interfaces.protocols.Tracker`` of a missile."""

    period: float  # [s]

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        """The input (nu,) [N, N m] to hold until t + period."""
        ...

    def predict(self, estimate: Estimate, plan: Plan, t: float) -> Array:
        """The state (nx,) at t [s] of a missile that is at the estimate now and flies the plan."""
        ...


def feed_forward(plan: Plan, t: float, period: float) -> Array:
    """Mean input (nu,) of a plan over [t, t + period] [s]: an arc may end within a tick."""
    mean: Array = mean_between(plan.t, plan.u, np.array([t, t + period]))[0]
    return mean


def disturbance(estimate: Estimate, size: int) -> Array:
    """Disturbance (nu,) of the input [N, N m] as the estimator observes it; zero if it does not."""
    return estimate.extra.get("disturbance", np.zeros(size))


def checked_state(estimate: Estimate, mission: MissileMission) -> Array:
    """The estimate's state (nx,); ArgumentError for any other shape, which compiled code would read beyond."""
    if estimate.x.shape != (mission.coordinates.state_size,):
        raise ArgumentError(
            f"the estimate's state has shape {estimate.x.shape}; allowed: ({mission.coordinates.state_size},)"
        )
    return estimate.x


class OpenLoop:
    """Autopilot without feedback: the plan's mean input over each tick."""

    def __init__(self, mission: MissileMission) -> None:
        self.period = mission.control_period
        self._mission = mission

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        return feed_forward(plan, t, self.period)

    def predict(self, estimate: Estimate, plan: Plan, t: float) -> Array:
        """State (nx,) at t [s] of the declared body, flown from the estimate with the plan's inputs."""
        x, now = checked_state(estimate, self._mission), estimate.t
        inner = plan.t[(plan.t > now) & (plan.t < t)]
        breaks = np.concatenate([[now], inner, [t]])
        u = np.array([self._mission.coordinates.input_at(plan, float(begin)) for begin in breaks[:-1]])
        end: Array = flown(x, breaks, u, self._mission.coordinates, self._mission.body)[-1]
        return end
