"""The planner: from what is believed of the pose to inputs that excite, a plan every period.

A plan takes over one period after it is asked for, at the pose to which the plan being flown will have led from where
the *estimate* says the robot is now. It holds its inputs for a horizon and then rests: a planner that falls silent
leaves a robot that stands still within the wall.
"""

from __future__ import annotations

import dataclasses
import time

import numpy as np

from mathnavi.controllers.active_sensing.belief import Belief
from mathnavi.controllers.active_sensing.belief_from_estimates import BeliefFromEstimates
from mathnavi.controllers.active_sensing.input_sequence import ExplorationPolicy
from mathnavi.controllers.active_sensing.motion import planned, predicted
from mathnavi.sim.interfaces.signals import Plan, PlanRequest, Status


class ExcitingPlanner:
    """Asks an excitation for inputs every ``period`` [s]."""

    def __init__(self, excitation: ExplorationPolicy, period: float, beliefs: BeliefFromEstimates) -> None:
        self.period = period
        self.beliefs = beliefs
        self._excitation = excitation
        self._noted = ""

    def plan(self, request: PlanRequest) -> Plan:
        return self.excite(request, self.beliefs.at(request))

    def excite(self, request: PlanRequest, belief: Belief) -> Plan:
        """The plan, given what is believed at the time of the request."""
        began = time.thread_time()
        if not np.isfinite(belief.pose).all():
            return Plan.failure(Status.NOT_FINITE, f"the estimate is {belief.pose.tolist()}")
        if request.current is not None:
            belief = predicted(belief, request.current, request.t, request.t_start)
        drive = self._excitation.drive(request.t_start, belief)
        plan = planned(drive, request.t_start, belief.pose, 1e3 * (time.thread_time() - began))
        if drive.note and drive.note != self._noted:
            plan = dataclasses.replace(plan, notes=(drive.note,), message=drive.message)
        self._noted = drive.note
        return plan
