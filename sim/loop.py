"""The closed loop, for one vehicle or many.

    sensors -> estimator -> planner (slow) -> tracker (fast) -> actuators

Each part runs at its own rate, a whole number of physics ticks. The loop looks, and logs, at the greatest common
divisor of these; the ticks between two looks are one step of the plant with the inputs held. A plan asked for at t
takes over at its own start time, one planning period later, if it is at hand by then; until then, and whenever there is
none, the vehicle flies the last plan that was adopted, which leads to rest. The loop knows protocols only: it never
asks what a plan is for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from sim.log import AgentRecorder, Recording
from sim.protocols import Estimator, Planner, Plant, Tracker
from sim.signals import Array, Estimate, Measurement, Message, Plan, PlanRequest, Status, where_raised

_SIMULTANEOUS = 1e-9  # [s] two times closer than this are the same tick


@dataclass(frozen=True)
class Agent:
    """What flies one vehicle: it sees measurements and messages, never the truth."""

    estimator: Estimator
    planner: Planner
    tracker: Tracker
    input_size: int = 3
    messages: Sequence[Message] = ()  # delivered at their own times


def whole_ticks(period: float, dt: float, what: str) -> int:
    """``period`` [s] as a number of ticks of ``dt`` [s]; ValueError if it is not a whole positive number of them."""
    ticks = round(period / dt) if math.isfinite(period) else 0
    if ticks < 1 or abs(ticks * dt - period) > _SIMULTANEOUS * max(1.0, ticks):
        raise ValueError(f"{what} = {period!r} s is not a whole number of physics ticks of {dt!r} s")
    return ticks


def _rates(name: str, agent: Agent, dt: float) -> tuple[int, int, int]:
    """Ticks between calls of the estimator, the planner and the tracker.

    ValueError if the planner or the tracker would be given an estimate of an earlier tick.
    """
    estimator = whole_ticks(agent.estimator.period, dt, f"{name}: the estimator's period")
    planner = whole_ticks(agent.planner.period, dt, f"{name}: the planner's period")
    tracker = whole_ticks(agent.tracker.period, dt, f"{name}: the tracker's period")
    for part, ticks, period in (
        ("planner", planner, agent.planner.period),
        ("tracker", tracker, agent.tracker.period),
    ):
        if ticks % estimator:
            raise ValueError(
                f"{name}: the estimator's period = {agent.estimator.period!r} s leaves the {part} with old estimates; "
                f"allowed: a whole fraction of the {part}'s period, {period!r} s"
            )
    return estimator, planner, tracker


@dataclass
class _Cockpit:
    """One agent with what it remembers between ticks."""

    name: str
    agent: Agent
    estimator_ticks: int
    planner_ticks: int
    tracker_ticks: int
    record: AgentRecorder
    command: Array
    inbox: list[Measurement] = field(default_factory=list)
    undelivered: list[Message] = field(default_factory=list)
    delivered: list[Message] = field(default_factory=list)
    pending: list[Plan] = field(default_factory=list)
    estimate: Estimate | None = None
    plan: Plan | None = None
    usable: bool = True  # the tracker's last command
    estimating: bool = True  # the estimator's last answer was usable

    def look(self, row: int, k: int, t: float, readings: Sequence[Measurement]) -> None:
        """Do what falls due at tick k; ``row`` is that of the log."""
        self.record.measurements(row, readings)
        self._act(k, t, readings)
        self.record.command(row, self.command)

    def _act(self, k: int, t: float, readings: Sequence[Measurement]) -> None:
        self.inbox.extend(readings)
        if k % self.estimator_ticks == 0:
            self._estimate(t)
        if self.estimate is None:
            return
        if k % self.planner_ticks == 0:
            self._adopt(t)
            self._ask(t, self.estimate)
            self._adopt(t)
        if self.plan is not None and k % self.tracker_ticks == 0:
            self._track(t, self.estimate, self.plan)

    def _estimate(self, t: float) -> None:
        """The estimator's answer, or what is left of the last one where it cannot be used."""
        try:
            estimate = self.agent.estimator.update(t, self.inbox, self.command)
            complaint = _unusable(estimate, self.estimate)
        except (Exception, SystemExit) as error:
            complaint = f"{type(error).__name__}: {error}{where_raised(error)}"
        self.inbox = []
        if not complaint:
            self.estimate = estimate
        elif self.estimate is not None:
            self.estimate = replace(self.estimate, status=Status.LOST)
        if complaint and self.estimating:
            self.record.event(t, "estimate-unusable", complaint)
        self.estimating = not complaint
        if self.estimate is not None:
            self.record.estimate(self.estimate)

    def _ask(self, t: float, estimate: Estimate) -> None:
        while self.undelivered and self.undelivered[0].t <= t + _SIMULTANEOUS:
            message = self.undelivered.pop(0)
            self.delivered.append(message)
            self.record.event(t, "message", f"{message.topic} from {message.sender}")
        t_start = t + self.agent.planner.period if self.plan is not None else t
        request = PlanRequest(t, t_start, estimate, self.plan, tuple(self.delivered))
        try:
            plan = self.agent.planner.plan(request)
            if not isinstance(plan, Plan):
                raise TypeError(f"plan() returned {type(plan).__name__}; allowed: Plan")
        except (Exception, SystemExit) as error:  # a recorded failure, not the end of the flight
            plan = Plan.raised(error)
        self.delivered = []
        self.record.asked(plan)
        if plan.ok:
            self.pending.append(plan)
        else:
            self._refused(t, plan, plan.status, plan.message)

    def _adopt(self, t: float) -> None:
        waiting: list[Plan] = []
        for plan in self.pending:
            if plan.t_start > t + _SIMULTANEOUS:
                waiting.append(plan)
            elif not plan.ready <= plan.t_start + _SIMULTANEOUS:  # NaN is late too
                self._refused(t, plan, Status.LATE, f"ready at {plan.ready:.3f} s for a start at {plan.t_start:.3f} s")
            else:
                self.plan = plan
                self.record.adopted(t, plan)
                for note in plan.notes:
                    self.record.event(t, note, plan.message)
        self.pending = waiting

    def _refused(self, t: float, plan: Plan, status: Status, message: str) -> None:
        self.record.event(t, status.name.lower().replace("_", "-"), message or status.value)
        for note in plan.notes:
            self.record.event(t, note, message)

    def _track(self, t: float, estimate: Estimate, plan: Plan) -> None:
        try:
            command = np.asarray(self.agent.tracker.command(t, estimate, plan), dtype=float)
            # The square of a command is finite if the command is, short of a length of 1e154.
            usable = command.shape == self.command.shape and math.isfinite(command.dot(command))
            complaint = "" if usable else f"{command!r}"
        except (Exception, SystemExit) as error:
            usable, complaint = False, f"{type(error).__name__}: {error}"
        if usable:
            self.command = command
        elif self.usable:
            self.record.event(t, "command-unusable", f"{complaint}; the last usable command is held")
        self.usable = usable


def _unusable(estimate: Any, before: Estimate | None) -> str:
    """What is wrong with an estimator's answer, "" for nothing."""
    if not isinstance(estimate, Estimate):
        return f"update() returned {type(estimate).__name__}; allowed: Estimate"
    x = np.asarray(estimate.x)
    if x.ndim != 1 or (before is not None and x.shape != before.x.shape):
        allowed = "(nx,)" if before is None else f"{before.x.shape}, as before"
        return f"the estimate's state has shape {x.shape}; allowed: {allowed}"
    finite = np.isfinite(x).all() and math.isfinite(estimate.t)
    return "" if finite else f"the estimate is {x.tolist()} at {estimate.t!r} s; allowed: finite numbers"


def simulate(
    plant: Plant,
    agents: Mapping[str, Agent],
    duration: float,
    finished: Callable[[float, Mapping[str, Array]], bool] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """Run the loop from the plant's present time for at most ``duration`` [s], or until ``finished(t, truths)``.

    ``finished`` is the referee: it sees the truth and belongs to the scenario, not to a controller. ``progress`` is
    told the simulated time once a simulated second.

    Raises ValueError if an agent has no vehicle, a rate is not a whole number of ticks, or an estimator is slower
    than the parts that use it.
    """
    if unknown := sorted(set(agents) - set(plant.names)):
        raise ValueError(f"agents {unknown} have no vehicle; the plant has {list(plant.names)}")
    dt, steps = plant.dt, whole_ticks(duration, plant.dt, "duration")
    names = plant.names
    rates = {name: _rates(name, agent, dt) for name, agent in agents.items()}
    stride = math.gcd(*(ticks for of_agent in rates.values() for ticks in of_agent)) or 1  # gcd() is 0: no agents
    rows = -(-steps // stride) + 1
    recording = Recording.begin(plant, {name: agent.input_size for name, agent in agents.items()}, rows)
    cockpits = [
        _Cockpit(
            name,
            agent,
            *rates[name],
            recording.agents[name],
            np.zeros(agent.input_size),
            undelivered=sorted(agent.messages, key=lambda message: message.t),
        )
        for name, agent in agents.items()
    ]
    told = -math.inf  # [s]
    for row, k in enumerate((*range(0, steps, stride), steps)):
        t = plant.t
        truths = {name: plant.state(name) for name in names}
        recording.truth(row, t, truths)
        for cockpit in cockpits:
            cockpit.look(row, k, t, plant.sense(cockpit.name))
        if k == steps or (finished is not None and finished(t, truths)):
            break
        commands = {cockpit.name: cockpit.command for cockpit in cockpits}
        recording.events.extend(plant.step(commands, min(stride, steps - k)))
        if progress is not None and t >= told + 1.0:
            told = t
            progress(t)
    return recording.end()
