"""Runner of one agent of the loop, with its state between ticks: estimate, plan, and messages from others.

A vehicle that flies among others has a coordinator, which exchanges messages with theirs over the network. A plan of
such a vehicle is proposed as soon as it is available, and takes over only if the coordinator admits it at its start;
otherwise the previous plan, which leads to rest, stays. Where plans take simulated time (``answer_times.Latency``), it
is proposed at the first exchange at which it is available.

Each answer of a component is timed by the clock on the wall, for ``AgentRecorder.answer_times``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import partial
from time import perf_counter
from typing import Any, TypeVar

import numpy as np

from mathnavi.interfaces.boundary import (
    Unusable,
    answered,
    guest,
    handed,
    locked_plan,
    own_copy,
    raised,
    usable_command,
    usable_estimate,
    usable_events,
    usable_plan,
)
from mathnavi.interfaces.protocols import Coordinator, Estimator, Planner, Tracker
from mathnavi.interfaces.signal_names import figure_names
from mathnavi.interfaces.signals import (
    Array,
    Estimate,
    Measurement,
    Message,
    Plan,
    PlanRequest,
    Status,
)
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.answer_times import (
    COORDINATOR,
    ESTIMATOR,
    MONITOR,
    PLANNER,
    TRACKER,
    AnswerTimes,
    Latency,
)
from mathnavi.sim.engine.communication import Communication
from mathnavi.sim.engine.log import AgentRecorder
from mathnavi.sim.engine.network import Network
from mathnavi.sim.engine.unused_sensors import UnusedReadings

T = TypeVar("T")


@dataclass(frozen=True)
class Agent:
    """Agent of one vehicle, its estimator, planner and tracker: they see measurements and messages, never the truth."""

    estimator: Estimator
    planner: Planner
    tracker: Tracker
    input_size: int = 3
    messages: Sequence[Message] = ()  # delivered at their own times
    coordinator: Coordinator | None = None  # of a vehicle among others
    stored: Plan | None = None  # flown from the start; without one the first plan, as soon as it is available
    sensors: Sequence[str] = ()  # names of those that the estimator requires
    command: Array | None = None  # (nu,) until the tracker's first; zero if not given
    start: Estimate | None = None  # the declared one at the beginning
    flow: Callable[[Estimate, Array, float], Estimate] | None = None  # moved on under an input (nu,) held for [s]
    unflyable: Callable[[Estimate], str] | None = None  # why no tracker can fly with an estimate; "" if one can
    spare: Tracker | None = None  # flies the plan where the tracker's command cannot be used
    estimate_age: float = math.inf  # [s] that the time of an estimate may be past
    command_max: float = math.inf  # greatest length of a command


@dataclass
class AgentRunner:
    """Runner of one agent, with its state between ticks."""

    name: str
    agent: Agent
    estimator_ticks: int
    planner_ticks: int
    tracker_ticks: int
    coordinator_ticks: int  # 0 without a coordinator
    network: Network
    record: AgentRecorder
    command: Array
    latency: Latency | None = None  # simulated time that plans take; None: none
    fleet: Sequence[str] = ()  # names of all vehicles
    inbox: list[Measurement] = field(default_factory=list)
    undelivered: list[Message] = field(default_factory=list)
    delivered: list[Message] = field(default_factory=list)
    pending: list[Plan] = field(default_factory=list)
    unproposed: Plan | None = None  # the newest of these, until it is available
    estimate: Estimate | None = None
    plan: Plan | None = None
    usable: bool = True  # the tracker's last command
    estimating: bool = True  # whether the estimator's last answer was usable
    unused_readings: UnusedReadings = field(init=False)
    monitor: Callable[[PlanRequest], Plan | None] | None = field(init=False)  # the planner's, if it has one
    commanded: Callable[[str], None] | None = field(init=False)  # likewise: why a command cannot be used, "" if it can
    without_plan: bool = field(init=False)  # True for a tracker that is called without a plan too
    guests: dict[str, str] = field(init=False)  # names of the parts that are not mathnavi's own, "" for those that are
    reports: dict[str, Callable[[], Any]] = field(init=False)  # of the parts that report events
    noted: dict[str, Callable[[float], None]] = field(init=False)  # notes the time [s] of a component's answer
    communication: Communication | None = field(init=False)  # None without a coordinator
    ask_tracker: Callable[..., Any] = field(init=False)  # its answer, timed

    def __post_init__(self) -> None:
        agent = self.agent
        parts = {"estimator": agent.estimator, "planner": agent.planner, "tracker": agent.tracker}
        self.unused_readings = UnusedReadings(agent.sensors)
        self.record.figures = figure_names(agent.estimator)
        self.monitor = getattr(agent.planner, "monitor", None)
        self.commanded = getattr(agent.planner, "commanded", None)
        self.without_plan = getattr(agent.tracker, "without_plan", False) is True
        self.guests = {role: guest(part) for role, part in parts.items()}
        self.reports = {role: part.events for role, part in parts.items() if hasattr(part, "events")}
        self.noted = {
            component: self._timed(component, period)
            for component, period in (
                (ESTIMATOR, agent.estimator.period),
                (PLANNER, agent.planner.period),
                (MONITOR, agent.estimator.period),
                (TRACKER, agent.tracker.period),
                (COORDINATOR, math.inf if agent.coordinator is None else agent.coordinator.period),
            )
        }
        self.ask_tracker = partial(self._answer, TRACKER)
        self.communication = None
        if agent.coordinator is not None:
            noted = self.noted[COORDINATOR]
            self.communication = Communication(
                self.name, agent.coordinator, self.fleet, self.network, self.record, noted
            )

    def _timed(self, component: str, period: float) -> Callable[[float], None]:
        """Begin the record of a component's times; return the function that appends one."""
        times = self.record.answer_times[component] = AnswerTimes(period)
        return times.seconds.append

    def _answer(self, component: str, call: Callable[..., T], *given: Any) -> T | Unusable:
        """Return what a component answers to what it is ``given``, and note how long it took."""
        began = perf_counter()
        try:
            return call(*given)
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            return raised(error)
        finally:
            self.noted[component](perf_counter() - began)

    def control_step(self, row: int, k: int, t: float, readings: Sequence[Measurement]) -> None:
        """Estimate, plan and track if they are due at tick k, t [s]; ``row`` is that of the log."""
        if self.plan is None and self.agent.stored is not None:
            self._take_over(t, self.agent.stored)
        self.observe(row, k, t, readings)
        if self.estimate is not None:
            self._act(k, t, self.estimate)
        self.record.command(row, self.command)

    def observe(self, row: int, k: int, t: float, readings: Sequence[Measurement]) -> None:
        """Receive the readings of the sensors, and estimate if that is due."""
        if readings:
            self.record.measurements(row, readings)
            self.inbox.extend(self.unused_readings.watched(readings))
        if k % self.estimator_ticks == 0:
            self._estimate(t)

    def hold(self, row: int, command: Array) -> None:
        """Hold a command (nu,) from outside until the next one."""
        self.command = command
        self.record.command(row, command)

    def _act(self, k: int, t: float, estimate: Estimate) -> None:
        if self.communication is not None and k % self.coordinator_ticks == 0:
            self._exchange(t, self.communication)
        if k % self.planner_ticks == 0:
            self._adopt(t)
            self._ask(t, estimate)
            self._adopt(t)
        else:
            self._monitor(k, t, estimate)
        self._record_events(t, "planner")
        if k % self.tracker_ticks == 0 and (self.plan is not None or self.without_plan):
            self._track(t, estimate, self.plan)

    def _estimate(self, t: float) -> None:
        """Update the estimate; in place of an answer that cannot be used, predict it and mark it as lost."""
        agent, before = self.agent, self.estimate
        own = not self.guests["estimator"]
        command = self.command if own else self.command.copy()
        answer = self._answer(ESTIMATOR, agent.estimator.update, t, self.inbox, command)
        size, age = None if agent.start is None else len(agent.start.x), agent.estimate_age
        estimate = (
            answer
            if isinstance(answer, Unusable)
            else usable_estimate(answer, t, before, size, age, agent.unflyable, own=own)
        )
        self.inbox = []
        if not self.unused_readings.settled:
            for sensor in self.unused_readings.found():
                text = f"the estimator requires the sensor {sensor!r} and uses no reading of it; is the name misspelt?"
                self.record.event(t, "sensor-unused", text)
        complaint = estimate.reason if isinstance(estimate, Unusable) else ""
        self.estimate = self._predicted(t) if isinstance(estimate, Unusable) else estimate
        if complaint and self.estimating:
            self.record.event(t, "estimate-unusable", complaint)
        self._record_events(t, "estimator")
        self.estimating = not complaint
        if self.estimate is not None:
            self.record.estimate(self.estimate)

    def _predicted(self, t: float) -> Estimate | None:
        """The estimate at t [s] without the estimator: the last one, or the declared start, moved on as declared."""
        start, last = self.agent.start, self.estimate
        if last is None and start is not None:
            last = replace(start, t=t)
        if last is None:
            return None
        flow = self.agent.flow
        if flow is not None and t > last.t:
            with np.errstate(over="ignore", invalid="ignore"):
                moved = replace(flow(last, self.command, t - last.t), t=t)
            usable = usable_estimate(moved, t, last, len(last.x), unflyable=self.agent.unflyable)
            last = last if isinstance(usable, Unusable) else usable  # what is beyond all numbers stays
        return replace(last, status=Status.LOST, message="")

    def _exchange(self, t: float, communication: Communication) -> None:
        """Propose a plan that has become available, and exchange messages with the others."""
        if self.unproposed is not None and self.unproposed.ready <= t + TIME_TOLERANCE:
            self._propose(t, self.unproposed)
        self.undelivered = sorted([*self.undelivered, *communication.exchange(t)], key=lambda each: each.t)

    def _deliver(self, t: float) -> list[Message]:
        """Deliver the messages that are due to the planner's next request; each is recorded."""
        due = []
        while self.undelivered and self.undelivered[0].t <= t + TIME_TOLERANCE:
            message = self.undelivered.pop(0)
            due.append(message)
            value = f": {message.payload:.10g}" if isinstance(message.payload, float) else ""
            self.record.event(t, "message", f"{message.topic} from {message.sender}{value}")
        self.delivered += due
        return due

    def _monitor(self, k: int, t: float, estimate: Estimate) -> None:
        """Call the planner's monitor, for what cannot wait until the next planning instant."""
        news = bool(self.undelivered) and self.undelivered[0].t <= t + TIME_TOLERANCE
        if self.monitor is None or not (news or k % self.estimator_ticks == 0):
            return
        request = PlanRequest(t, t, estimate, self.plan, tuple(self._deliver(t)) if news else ())
        plan = self._planned(MONITOR, self.monitor, request)
        if plan is None:
            return
        self.record.asked(plan)
        if plan.ok:
            self.pending = [plan]  # the next plan starts on the plan that is given up
            self._propose(t, plan)
            self._adopt(t)
        else:
            self._refused(t, plan, plan.status, plan.message)

    def _ask(self, t: float, estimate: Estimate) -> None:
        self.unproposed = None  # its start has come
        self._deliver(t)
        t_start = t + self.agent.planner.period if self.plan is not None else t
        request = PlanRequest(t, t_start, estimate, self.plan, tuple(self.delivered))
        plan = self._planned(PLANNER, self.agent.planner.plan, request)
        assert plan is not None
        if self.latency is not None:
            plan = self._delayed(t, plan, self.record.answer_times[PLANNER].seconds[-1], self.latency)
        self.delivered = []
        self.record.asked(plan)
        if plan.ok:
            self.pending.append(plan)
            if self.latency is not None and plan.ready > t + TIME_TOLERANCE:
                self.unproposed = plan
            elif self.plan is not None:
                self._propose(t, plan)
        else:
            self._refused(t, plan, plan.status, plan.message)

    def _planned(self, component: str, call: Callable[[PlanRequest], Plan | None], request: PlanRequest) -> Plan | None:
        """The answer to a request, a failed plan in place of one that cannot be used; None from a monitor alone."""
        name = self.guests["planner"]
        if name:
            request = handed(request)
        answer = self._answer(component, call, request)
        if answer is None and component == MONITOR:
            return None
        if isinstance(answer, Plan) and not name:
            return answer
        plan = answer if isinstance(answer, Unusable) else usable_plan(answer, name)
        return plan.plan if isinstance(plan, Unusable) else plan

    def _delayed(self, t: float, plan: Plan, seconds: float, latency: Latency) -> Plan:
        """Return the answer to a request at t [s] that took ``seconds``, as it is available in simulated time.

        A plan that starts now is not delayed, for there is none to fly until it comes: the first plan of a vehicle, and
        one from its estimate after it has left the plan being flown.
        """
        delay = latency.delay(self.name, len(self.record.delays), t, seconds)
        self.record.delays.append(delay)
        if not plan.ok or plan.t_start <= t + TIME_TOLERANCE:
            return plan
        return replace(plan, ready=max(plan.ready, t + delay))

    def _propose(self, t: float, plan: Plan) -> None:
        """Have the coordinator propose a plan, in place of any other that it has not proposed yet."""
        self.unproposed = None
        if self.communication is not None:
            self.communication.propose(t, plan)

    def _adopt(self, t: float) -> None:
        waiting: list[Plan] = []
        for plan in self.pending:
            if plan.t_start > t + TIME_TOLERANCE:
                waiting.append(plan)
            elif not plan.ready <= plan.t_start + TIME_TOLERANCE:  # NaN is late too
                self._refused(t, plan, Status.LATE, f"ready at {plan.ready:.3f} s for a start at {plan.t_start:.3f} s")
            elif not self._admitted(t, plan):
                self._refused(t, plan, Status.NOT_ADMITTED, "")
            else:
                self._take_over(t, plan)
        self.pending = waiting

    def _admitted(self, t: float, plan: Plan) -> bool:
        """Return True if the others admit the plan; the first plan was not announced and needs no answer."""
        return self.communication is None or self.plan is None or self.communication.admits(t, plan)

    def _take_over(self, t: float, plan: Plan) -> None:
        self.plan = plan
        self.record.adopted(t, plan)
        if self.communication is not None:
            self.communication.adopted(t, plan)
        for note in plan.notes:
            self.record.event(t, note, plan.message)

    def _refused(self, t: float, plan: Plan, status: Enum, message: str) -> None:
        self.record.event(t, status.name.lower().replace("_", "-"), message or status.value)
        for note in plan.notes:
            self.record.event(t, note, message)

    def _record_events(self, t: float, role: str) -> None:
        """Record the events that a part of the agent reports; one that reports nonsense is not asked again."""
        if role not in self.reports:
            return
        events = usable_events(self.reports[role], self.guests[role])
        if isinstance(events, Unusable):
            del self.reports[role]
            self.record.event(t, "events-unusable", f"of the {role}: {events.reason}")
            return
        for kind, message in events:
            self.record.event(t, kind, message)

    def _track(self, t: float, estimate: Estimate, plan: Plan | None) -> None:
        command = self._command(self.ask_tracker, self.agent.tracker, t, estimate, plan)
        spare: Tracker | None = self.agent.spare
        instead: Array | Unusable = Unusable("")
        if spare is not None and (self.guests["tracker"] or isinstance(command, Unusable)):
            # Asked beside a guest at every step: a tracker with a memory has to know the steps before it is needed.
            instead = self._command(answered, spare, t, estimate, plan)
        self._record_events(t, "tracker")
        usable, before = not isinstance(command, Unusable), self.usable
        self.usable = usable
        if usable is not before and self.commanded is not None:
            self.commanded(command.reason if isinstance(command, Unusable) else "")
            self._record_events(t, "planner")
        if not isinstance(command, Unusable):
            self.command = command
            return
        if before:
            held = isinstance(instead, Unusable)
            what = "the last usable command is held" if held else "the plan is tracked without the tracker"
            self.record.event(t, "command-unusable", f"{command.reason}; {what}")
        if not isinstance(instead, Unusable):
            self.command = instead

    def _command(
        self, ask: Callable[..., Any], tracker: Tracker, t: float, estimate: Estimate, plan: Plan | None
    ) -> Array | Unusable:
        own = not self.guests["tracker"]
        if not own:
            estimate, plan = own_copy(estimate), None if plan is None else locked_plan(plan)
        answer = ask(tracker.command, t, estimate, plan)
        if isinstance(answer, Unusable):
            return answer
        return usable_command(answer, self.command.shape, self.agent.command_max, own=own)
