"""Answers of components are timed by the wall clock; plans may take that time, or a recorded one, in simulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest
from mathnavi.sim.engine import agent_runner
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.answer_times import Latency
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.loop import simulate
from tests import flight
from tests.sim.engine.test_coordinator import Talks
from tests.sim.engine.test_loop import DT, PERIOD, START, Answers, Follows, Pair, ReadsState, kinds, there_and_stop


@dataclass
class Clock:
    """A clock on the wall that goes on only while a component computes."""

    now: float = 0.0
    spent: list[float] = field(default_factory=list)

    def __call__(self) -> float:
        return self.now

    def compute(self, seconds: float) -> None:
        self.now += seconds
        self.spent.append(seconds)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(agent_runner, "perf_counter", made)
    return made


def in_turn(clock: Clock, seconds: list[float]) -> Callable[[PlanRequest], Plan]:
    """A planner whose answers take ``seconds`` in turn."""
    left = list(seconds)

    def answer(request: PlanRequest) -> Plan:
        clock.compute(left.pop(0) if left else 0.01)
        return there_and_stop(request)

    return answer


def flown(
    answer: Callable[[PlanRequest], Plan], latency: Latency | None = None, duration: float = 3.0, **parts: Any
) -> Recording:
    agent = Agent(parts.get("estimator", ReadsState()), Answers(answer), parts.get("tracker", Follows()))
    return simulate(flight.PointMass(START, DT), {"vehicle": agent}, duration, latency=latency)


def adopted(recording: Recording) -> list[float]:
    return [round(t, 6) for t, _ in recording.agents["vehicle"].plans]


def late(recording: Recording) -> list[float]:
    return [round(event.t, 6) for event in recording.events if event.kind == "late"]


def same_log(one: Recording, other: Recording) -> bool:
    a, b = one.arrays(), other.arrays()
    same = a.keys() == b.keys() and all(np.array_equal(a[name], b[name], equal_nan=True) for name in a)
    return same and one.events == other.events


def test_every_answer_is_timed_also_one_that_raises_and_the_log_is_the_same(clock: Clock) -> None:
    class Estimates(ReadsState):
        def update(self, *arguments: Any) -> Estimate:
            clock.compute(0.002)
            return super().update(*arguments)

    class Tracks(Follows):
        def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
            clock.compute(0.001)
            return super().command(t, estimate, plan)

    def answer(request: PlanRequest) -> Plan:
        clock.compute(0.7)
        if request.t > 1.0:
            raise RuntimeError("no plan")
        return there_and_stop(request)

    def instantly(request: PlanRequest) -> Plan:
        if request.t > 1.0:
            raise RuntimeError("no plan")
        return there_and_stop(request)

    recording = flown(answer, estimator=Estimates(), tracker=Tracks())
    times = recording.agents["vehicle"].answer_times
    assert {name: (each.period, len(each.seconds)) for name, each in times.items() if each.seconds} == {
        "estimator": (DT, 31), "planner": (PERIOD, 7), "tracker": (DT, 31),
    }  # fmt: skip
    for name, seconds in {"estimator": 0.002, "planner": 0.7, "tracker": 0.001}.items():
        assert list(times[name].seconds) == pytest.approx([seconds] * len(times[name].seconds))
    assert late(recording) == []
    assert np.array_equal(recording.arrays()["truth.x"], flown(instantly).arrays()["truth.x"])


def test_a_plan_that_took_longer_than_its_period_is_late_and_the_one_before_stays(clock: Clock) -> None:
    """Seven requests; the third and the fourth take longer than the 0.5 s until their plans begin."""
    recording = flown(in_turn(clock, [0.7, 0.3, 0.6, 1.5, 0.2]), Latency())
    assert late(recording) == [1.5, 2.0]
    assert adopted(recording) == [0.0, 1.0, 2.5, 3.0], "the first plan is there at once: there is none to fly before it"
    assert recording.agents["vehicle"].delays == pytest.approx([0.7, 0.3, 0.6, 1.5, 0.2, 0.01, 0.01])
    assert recording.events[-1].message == "ready at 3.000 s for a start at 2.000 s"


def test_recorded_delays_give_the_same_log_however_long_the_answers_take_now(clock: Clock) -> None:
    first = flown(in_turn(clock, [0.7, 0.3, 0.6, 1.5, 0.2]), Latency())
    again = flown(in_turn(clock, []), Latency({"vehicle": tuple(first.agents["vehicle"].delays)}))
    assert same_log(first, again)
    assert again.agents["vehicle"].delays == first.agents["vehicle"].delays
    assert not same_log(first, flown(in_turn(clock, []), Latency())), "and they matter"


@pytest.mark.parametrize("recorded", [{"vehicle": (0.1, 0.1)}, {"vehicle": ()}, {}])
def test_more_requests_than_were_recorded_are_refused(recorded: dict[str, tuple[float, ...]]) -> None:
    known = len(recorded.get("vehicle", ()))
    told = f"vehicle requests plan {known + 1} at {PERIOD * known:g} s, and the recorded run has the delays of {known}"
    with pytest.raises(RunFolderError, match=told):
        flown(there_and_stop, Latency(recorded))


def test_a_plan_that_starts_now_is_not_delayed(clock: Clock) -> None:
    """As after a breach of the tracking bound: there is no plan to fly until it comes."""

    def answer(request: PlanRequest) -> Plan:
        clock.compute(0.3)
        again = request.t == pytest.approx(1.0)
        here = replace(request, t_start=request.t, current=None) if again else request
        return there_and_stop(here)

    recording = flown(answer, Latency(), duration=1.2)
    assert adopted(recording) == [0.0, 1.0, 1.0], "the one that had been requested for then, and the one in its place"
    assert late(recording) == []


def test_a_fault_that_delays_longer_counts(clock: Clock) -> None:
    def answer(request: PlanRequest) -> Plan:
        clock.compute(0.1)
        plan = there_and_stop(request)
        return plan if request.current is None else replace(plan, ready=request.t + 0.6)

    recording = flown(answer, Latency(), duration=1.0)
    assert late(recording) == [1.0]


def test_a_plan_is_proposed_to_others_when_it_is_available(clock: Clock) -> None:
    east, west = Talks("east", "west"), Talks("west", "east")
    seconds = [0.2, 0.25, 0.7, 0.0]
    planners = {"east": Answers(in_turn(clock, seconds)), "west": Answers(there_and_stop)}
    agents = {each.name: Agent(ReadsState(), planners[each.name], Follows(), coordinator=each) for each in (east, west)}
    recording = simulate(Pair(), agents, 2.0, latency=Latency())
    assert [round(t, 6) for t, _ in east.proposed] == [0.8, 1.5], "0.25 s and nothing after its request; one was late"
    assert ("east", "late") in [(event.agent, event.kind) for event in recording.events]
    assert "not-admitted" not in kinds(recording)
    times = recording.agents["east"].answer_times
    assert len(times["coordinator"].seconds) > 21, "exchanges, and what is asked of it in between"
