"""Policies of a learner in place of a controller, for the study ``hunt``: actions that do not look at the ground.

A run behind the filter whose tracker proposes the actions of a policy is an episode of an environment behind the
filter, bit for bit.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval

from mathnavi.controllers.flight.plugin import FlightConfig
from mathnavi.controllers.flight.tracker import tracking_bound
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.aerial.plan_status import FlightPhase

Policy = Literal["random", "bang-bang", "dive", "constant", "race"]


@configuration
class PolicyConfig:
    """Fields of the controller."""

    policy: Policy = "random"
    """actions that are proposed, none of which looks at the ground"""
    strength: Annotated[float, Interval(ge=0.0, le=1.0)] = 1.0
    """length of an action as a share of a_max, 0 to 1"""
    hold: Count = 10
    """number of control steps for which an action is held"""
    draw: int = 0
    """seed by which actions are drawn"""


class PolicyFlight:
    """Policy of a learner in place of a controller, to be flown behind the safety filter as in an environment."""

    Config = PolicyConfig

    @staticmethod
    def build(config: PolicyConfig, mission: FlightMission) -> tuple[Planner, Tracker]:
        """Return a planner without its own plan, and the policy as a tracker."""
        return StandsStill(mission), PolicyTracker(config, mission)


class StandsStill:
    """Planner whose plan is to stand where the vehicle is."""

    def __init__(self, mission: FlightMission) -> None:
        self.period = 60.0 * mission.control_period

    def plan(self, request: PlanRequest) -> Plan:
        """Return the plan."""
        x = np.concatenate([request.estimate.x[:3], np.zeros(3)])
        t = np.array([request.t_start, request.t_start + self.period])
        return Plan(t, np.array([x, x]), np.zeros((1, 3)), np.array([FlightPhase.MANOEUVRE]))


class PolicyTracker:
    """Tracker whose commands are the actions of a policy."""

    def __init__(self, config: PolicyConfig, mission: FlightMission) -> None:
        self.period = mission.control_period
        self.bound = tracking_bound(FlightConfig.bandwidth, mission)
        self._config, self._rng = config, np.random.default_rng(config.draw)
        self._length, self._action, self._held = config.strength * mission.acceleration_max, np.zeros(3), 0

    def command(self, t: float, estimate: Estimate, plan: Plan | None) -> Array:
        """Return the action (3,) [m/s^2] of this control step."""
        if self._held % self._config.hold == 0:
            self._action = self._next(estimate.x[3:])
        self._held += 1
        return self._action.copy()

    def _next(self, v: Array) -> Array:
        drawn = self._rng.normal(size=3)
        directions: dict[Policy, Array] = {
            "random": drawn,
            "bang-bang": np.sign(drawn),
            "dive": 0.3 * drawn - np.array([0.0, 0.0, 1.0]),
            "constant": drawn if self._held == 0 else self._action,
            "race": v + 1e-3 * drawn,
        }
        direction = directions[self._config.policy]
        length = float(np.linalg.norm(direction))
        return self._length * direction / length if length > 0.0 else direction
