"""Planner and tracker of exploration: inputs under which the estimator learns, every period.

A plan takes over one period after it is requested, at the pose to which the plan being flown will have led from the
*estimate*. It holds its inputs for a horizon and then rests: if no further plan comes, the robot stands still within
the wall.

The tracker applies the plan's inputs. Arcs that explore are driven without feedback: the next plan starts from the
estimate anyway, a fifth of a second later. Arcs of the phase ``CRUISE`` follow a reference, a unicycle (p_r, phi_r)
with the inputs (u_1r, u_2r). With the error in the robot's frame, e = R_{-phi}(p_r - p), and d = phi_r - phi,

    u_1 = u_1r cos d + k_1 e_1,      u_2 = u_2r + k_2 u_1r (sin d / d) e_2 + k_3 d,

under which V = k_2 |e|^2 / 2 + d^2 / 2 has V' = -k_1 k_2 e_1^2 - k_3 d^2, both inputs clipped to the robot's limits.
"""

from __future__ import annotations

import dataclasses
import math
import time

import numpy as np

from mathnavi.controllers.active_sensing.belief import Belief, BeliefFromEstimates, checked_pose, mean_input, pose_on
from mathnavi.controllers.active_sensing.policies import ExplorationPolicy
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest, Status
from mathnavi.models.unicycle.kernels import sinc, wrapped
from mathnavi.models.unicycle.mission import DrivePhase, RangingMission


class PathTracker:
    """Tracker of a plan; with the ``bandwidth`` omega [rad/s], k_1 = k_3 = 2 omega and k_2 = (omega / speed)^2.

    Near a path that is driven at that speed [m/s] the deviation across it is critically damped.
    """

    def __init__(self, mission: RangingMission, bandwidth: float, speed: float) -> None:
        self.period = mission.period
        self._limit = np.array([mission.speed_max, mission.turn_rate_max])
        self._straightening = 2.0 * bandwidth  # k_1, k_3 [1/s]
        self._steering = (bandwidth / speed) ** 2  # k_2 [1/m^2]

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        """Input u (2,) [m/s, rad/s] until t + period."""
        x = checked_pose(estimate)
        u = mean_input(plan, t, t + self.period)
        if _is_path(plan, t):
            u = self._corrected(x, pose_on(plan, t), u)
        return np.clip(u, -self._limit, self._limit)

    def _corrected(self, x: Array, reference: Array, u: Array) -> Array:
        """Input (2,) at a pose x (3,), corrected towards the path's pose ``reference`` (3,) with its input u (2,)."""
        c, s = math.cos(x[2]), math.sin(x[2])
        dx, dy = reference[0] - x[0], reference[1] - x[1]
        e_1, e_2, d = c * dx + s * dy, c * dy - s * dx, wrapped(reference[2] - x[2])
        return np.array(
            [
                u[0] * math.cos(d) + self._straightening * e_1,
                u[1] + self._steering * u[0] * sinc(d) * e_2 + self._straightening * d,
            ]
        )


def _is_path(plan: Plan, t: float) -> bool:
    """True if the plan's arc at t [s], after its end the last one, belongs to a path to follow."""
    k = int(np.clip(np.searchsorted(plan.t, t, side="right") - 1, 0, len(plan.phase) - 1))
    return int(plan.phase[k]) == DrivePhase.CRUISE


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
