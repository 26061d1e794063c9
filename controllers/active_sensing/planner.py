"""The exploration planner: from the belief of the pose to inputs under which the estimator learns, every period.

A plan takes over one period after it is requested, at the pose to which the plan being flown will have led from the
*estimate*. It holds its inputs for a horizon and then rests: if no further plan comes, the robot stands still within
the wall.
"""

from __future__ import annotations

import dataclasses
import time

import numpy as np

from mathnavi.controllers.active_sensing.belief import Belief, BeliefFromEstimates
from mathnavi.controllers.active_sensing.policies import ExplorationPolicy
from mathnavi.interfaces.signals import Plan, PlanRequest, Status


class ExplorationPlanner:
    """Planner whose policy chooses inputs every ``period`` [s]."""

    def __init__(self, policy: ExplorationPolicy, period: float, beliefs: BeliefFromEstimates) -> None:
        self.period = period
        self.beliefs = beliefs
        self._policy = policy
        self._noted = ""

    def plan(self, request: PlanRequest) -> Plan:
        return self.explore(request, self.beliefs.update(request))

    def explore(self, request: PlanRequest, belief: Belief) -> Plan:
        """Return the plan, given the belief at the time of the request."""
        began = time.thread_time()
        if not np.isfinite(belief.pose).all():
            return Plan.failure(Status.NOT_FINITE, f"the estimate is {belief.pose.tolist()}")
        if request.current is not None:
            belief = belief.predicted(request.current, request.t, request.t_start)
        inputs = self._policy.choose(request.t_start, belief)
        plan = inputs.plan(request.t_start, belief.pose, 1e3 * (time.thread_time() - began))
        if inputs.note and inputs.note != self._noted:
            plan = dataclasses.replace(plan, notes=(inputs.note,), message=inputs.message)
        self._noted = inputs.note
        return plan
