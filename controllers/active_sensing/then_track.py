"""Excite first, then track: once the estimate is sure, a path in the frame of the world is kept.

The estimate is sure when the largest standard deviation of its position and that of its heading have fallen under their
limits; when either is twice its limit, or there is no estimate any more, the robot excites again. Plans of the path
follow one another without a break, and the tracker holds the robot to them; only when the estimate is far off the plan
does the robot join the path anew.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from mathnavi.controllers.active_sensing.belief import Belief
from mathnavi.controllers.active_sensing.input_sequence import InputSequence
from mathnavi.controllers.active_sensing.motion import planned, pose_on, predicted
from mathnavi.controllers.active_sensing.planner import ExcitingPlanner
from mathnavi.controllers.active_sensing.reference import Reference
from mathnavi.sim.interfaces.signals import Array, Phase, Plan, PlanRequest

_AGAIN = 2.0  # times a limit, at which the robot excites again
_FAR = 0.3  # [m] off the plan, from which the path is joined anew
_SAME_TIME = 1e-9  # [s]


@dataclasses.dataclass(frozen=True)
class _Joined:
    """The way to the path and when it gets there: at ``t[-1]`` its arc ``arc`` begins."""

    t: Array  # (K + 1,) [s]
    u: Array  # (K, 2)
    arc: int


class ThenTrack:
    """An exciting planner, and a reference for ``horizon`` [s] at a time when the estimate is sure.

    ``position`` [m] and ``heading`` [rad] are the limits. Events: "tracking" when the path is to be joined, "exciting"
    when the estimate is not sure any more, "no-way" when no straight way leads onto the path.
    """

    def __init__(
        self, planner: ExcitingPlanner, reference: Reference, position: float, heading: float, horizon: float
    ) -> None:
        self.period = planner.period
        self._planner, self._reference, self._horizon = planner, reference, horizon
        self._limits = np.array([position, heading])
        self._joined: _Joined | None = None
        self._noted = ""

    def plan(self, request: PlanRequest) -> Plan:
        belief = self._planner.beliefs.at(request)
        if not self._is_sure(belief):
            degraded = self._joined is not None
            return self._excite(request, belief, "exciting" if degraded else "", "the estimate is not sure any more")
        if request.current is None:
            return self._excite(request, belief)
        if self._joined is None or _is_far(belief, request.current, request.t):
            return self._join(request, belief, request.current)
        return self._kept(self._joined, request.t_start, pose_on(request.current, request.t_start))

    def _is_sure(self, belief: Belief) -> bool:
        limits = self._limits if self._joined is None else _AGAIN * self._limits
        found = np.array([belief.position_deviation, belief.heading_deviation])
        return belief.is_found and bool(np.isfinite(belief.pose).all() and (found <= limits).all())

    def _excite(self, request: PlanRequest, belief: Belief, note: str = "", message: str = "") -> Plan:
        self._joined = None
        plan = self._planner.excite(request, belief)
        told = note and note != self._noted
        self._noted = note
        return dataclasses.replace(plan, notes=(*plan.notes, note), message=message) if told else plan

    def _join(self, request: PlanRequest, belief: Belief, current: Plan) -> Plan:
        """The way to the path from where the estimate says that the robot will be."""
        pose = predicted(belief, current, request.t, request.t_start).pose
        way = self._reference.way(pose)
        if way is None:
            return self._excite(request, belief, "no-way", "no straight line to the path keeps the margin")
        duration, u, arc = way
        self._joined = _Joined(request.t_start + np.concatenate([[0.0], np.cumsum(duration)]), u, arc)
        self._noted = ""
        plan = self._kept(self._joined, request.t_start, pose)
        return dataclasses.replace(plan, notes=("tracking",), message="the estimate is sure")

    def _kept(self, joined: _Joined, t: float, pose: Array) -> Plan:
        """What is left of the way at t [s], from a pose (3,), and the path for the horizon after it."""
        period, begin = self._reference.period, float(joined.t[-1])
        passed = max(0, math.floor((t - begin) / period + _SAME_TIME))
        count = math.ceil(self._horizon / period)
        times = begin + period * (passed + np.arange(count + 1))
        u = self._reference.inputs(joined.arc + passed, count)
        if not passed:
            times, u = np.concatenate([joined.t[:-1], times]), np.vstack([joined.u, u])
        first = int(np.searchsorted(times, t + _SAME_TIME, side="right")) - 1
        times = np.concatenate([[t], times[first + 1 :]])
        return planned(InputSequence(np.diff(times), u[first:], Phase.CRUISE), t, pose, math.nan)


def _is_far(belief: Belief, plan: Plan, t: float) -> bool:
    x, y, _ = belief.pose - pose_on(plan, t)
    return math.hypot(x, y) > _FAR
