"""Planner that optimises the whole flight to the target again and again, and lets the last plan be flown to its end.

Each plan starts from where the missile will be one period ahead, as the autopilot predicts it from the *estimate*. The
plan being flown says where it should be; a wrong mass, a gust or a thruster at its limit keeps it from there.
Planned from the estimate, the flight is optimal from where it really is, and even without an autopilot the planner
closes a loop. The price is that noise of the estimate reaches the reference: filtering is the estimator's task.

The horizon is the time to go, on the same number of nodes. As it vanishes a deviation needs inputs that grow as
1 / T^2, so below a given time to go the last plan is flown to its end. An optimisation that fails is a status,
and the plan being flown stays.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence

import numpy as np

from mathnavi.controllers.missile.autopilot import Autopilot, checked_state
from mathnavi.controllers.missile.optimiser import MissileTrajectory, Optimiser, flown
from mathnavi.controllers.missile.problem import ALLOWANCE, TerminalCondition
from mathnavi.controllers.missile.shooting import Failed
from mathnavi.interfaces.signals import OPTIMISED, Array, Message, Plan, PlanRequest, Status
from mathnavi.models.missile.mission import MissileMission, Target
from mathnavi.models.tolerances import TIME_TOLERANCE


class MissilePlanner:
    """Planner that plans every ``period`` [s] until ``commit`` [s] before the end.

    A message with the topic "target" and a ``Target`` as payload says how the target moves from then on. ``remark`` is
    recorded with the first plan as an event of the kind "backend".
    """

    def __init__(
        self,
        mission: MissileMission,
        optimiser: Optimiser,
        autopilot: Autopilot,
        period: float,
        commit: float,
        *,
        lead: bool,
        remark: str = "",
    ) -> None:
        self.period = period
        self._mission, self._optimiser, self._autopilot = mission, optimiser, autopilot
        self._commit, self._lead, self._remark = commit, lead, remark
        self._target = mission.target

    def plan(self, request: PlanRequest) -> Plan:
        self._listen(request.messages)
        current, t = request.current, request.t_start
        if current is not None and current.t_end - t - self._mission.input_delay < self._commit:
            return self._rest(current, t)
        start = checked_state(request.estimate, self._mission)
        if not np.isfinite(start).all():
            return Plan.failure(Status.NOT_FINITE, f"the estimate is {start.tolist()}")
        if current is not None:
            start = self._autopilot.predict(request.estimate, current, t)
        began = time.thread_time()
        leading = self._leading(t, start, current)
        t += leading.duration
        terminal = TerminalCondition.at(self._target, t, self._mission.final_attitude, lead=self._lead)
        buried = float(terminal.place[2])
        if buried > ALLOWANCE and terminal.velocity[2] >= 0.0:
            found: MissileTrajectory | Failed = Failed(f"it is {buried:.3g} m below the ground", infeasible=True)
        else:
            found = self._optimiser.optimise(t, leading.x[-1], terminal)
        solve_ms = 1e3 * (time.thread_time() - began)
        if isinstance(found, Failed):
            status = Status.INFEASIBLE if found.infeasible else Status.SOLVER_FAILED
            reason = found.message
            if found.infeasible:
                place, velocity = self._target.at(t).round(1).tolist(), list(self._target.velocity)
                reason = f"the target at {place} m with {velocity} m/s is out of reach: {reason}"
            return Plan.failure(status, reason, solve_ms=solve_ms)
        times = np.concatenate([request.t_start + leading.t[:-1], t + found.t])
        x, u = np.vstack([leading.x[:-1], found.x]), np.vstack([leading.u, found.u])
        phase = np.full(len(u), OPTIMISED, np.int64)
        plan = Plan(times, x, u, phase, cost=leading.cost + found.cost, solve_ms=solve_ms)
        if found.remark:
            plan = dataclasses.replace(plan, notes=("planned-as-one",), message=found.remark)
        if self._remark:
            message = "; ".join(filter(None, (self._remark, plan.message)))
            plan = dataclasses.replace(plan, notes=(*plan.notes, "backend"), message=message)
            self._remark = ""
        return plan

    def _leading(self, t: float, start: Array, current: Plan | None) -> MissileTrajectory:
        """The flight from ``start`` (nx,) at t [s] under the inputs that will be on their way then.

        The thrusters are late by ``input_delay``: no command from t on acts before. A missile without a plan has given
        none.
        """
        mission, delay = self._mission, self._mission.input_delay
        inner = np.empty(0)
        if current is not None:
            within = (current.t > t + TIME_TOLERANCE) & (current.t < t + delay - TIME_TOLERANCE)
            inner = current.t[within] - t
        breaks = np.concatenate([[0.0], inner, [delay]]) if delay > 0.0 else np.zeros(1)
        u = np.zeros((len(breaks) - 1, mission.coordinates.input_size))
        if current is not None:
            for k, begin in enumerate(breaks[:-1].tolist()):
                u[k] = mission.coordinates.input_at(current, t + begin)
        x = flown(start, breaks, u, mission.coordinates, mission.body)
        begin, end = (mission.case.running_cost(mission.coordinates, ends, u, mission.body) for ends in (x[:-1], x[1:]))
        return MissileTrajectory(breaks, x, u, float(0.5 * np.diff(breaks) @ (begin + end)))

    def _listen(self, messages: Sequence[Message]) -> None:
        for message in messages:
            if message.topic == "target" and isinstance(message.payload, Target):
                self._target = message.payload

    def _rest(self, plan: Plan, t: float) -> Plan:
        """The rest of a plan at t [s]; past its end its last input is held on."""
        coordinates, body = self._mission.coordinates, self._mission.body
        left = plan.t > t + TIME_TOLERANCE
        start = coordinates.state_at(plan, t, body)
        u = plan.u[left[1:]] if left.any() else plan.u[-1:]
        times: Array = np.concatenate([[t], plan.t[left] if left.any() else [t + self.period]])
        x = plan.x[left] if left.any() else coordinates.flow(start, u[0], self.period, body)[None, :]
        phase = np.full(len(u), OPTIMISED, np.int64)
        return Plan(times, np.vstack([start, x]), u, phase, cost=plan.cost)
