"""Vehicles that communicate: messages arrive over the network, and a plan takes over only where it is admitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest

from mathnavi.interfaces.protocols import Coordinator
from mathnavi.interfaces.signals import Event, Message, Outbox, Plan, PlanRequest
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.loop import simulate
from mathnavi.sim.engine.network import DelayedLinks, IdealNetwork
from tests.sim.engine.test_loop import DT, PERIOD, Answers, Follows, Pair, ReadsState, there_and_stop


@dataclass
class Talks:
    """A coordinator that counts aloud to its peer, and admits plans while it has heard from it."""

    name: str
    peer: str
    period: float = DT
    heard: list[tuple[float, Message]] = field(default_factory=list)
    proposed: list[tuple[float, Plan]] = field(default_factory=list)
    taken: list[tuple[float, Plan]] = field(default_factory=list)
    patience: float = np.inf  # [s] since it was last outbox to
    mute: float = np.inf  # [s] from when on it raises
    briefed: bool = False

    def exchange(self, t: float, received: Sequence[Message]) -> Outbox:
        self.heard += [(t, message) for message in received]
        if t > self.mute:
            raise RuntimeError("no voice")
        planner_messages = () if self.briefed else (Message(t, self.name, "arrival time", 42.0),)
        self.briefed = True
        events = (("spoke", self.name),) if t == 0.0 else ()
        return Outbox(((self.peer, Message(t, self.name, "count", t)),), planner_messages, events)

    def propose(self, t: float, plan: Plan) -> None:
        self.proposed.append((t, plan))

    def admits(self, t: float, plan: Plan) -> bool:
        return bool(self.heard) and t - self.heard[-1][0] <= self.patience

    def adopted(self, t: float, plan: Plan) -> None:
        self.taken.append((t, plan))


def flown(
    east: Talks, west: Talks, delay: float = 0.0, duration: float = 3.0
) -> tuple[list[Event], dict[str, Answers]]:
    planners = {name: Answers(there_and_stop) for name in ("east", "west")}
    agents = {
        name: Agent(ReadsState(), planners[name], Follows(), coordinator=coordinator)
        for name, coordinator in (("east", east), ("west", west))
    }
    network = DelayedLinks(IdealNetwork(("east", "west")), delay, delay, np.random.default_rng(0))
    return simulate(Pair(), agents, 3.0, network=network).events, planners


def test_what_is_said_arrives_after_its_delay_and_once() -> None:
    east, west = Talks("east", "west"), Talks("west", "east")
    assert isinstance(east, Coordinator)
    flown(east, west, delay=0.25)
    for coordinator in (east, west):
        sent = [message.t for _, message in coordinator.heard]
        assert sent == pytest.approx(DT * np.arange(len(sent)))
        assert all(t - message.t == pytest.approx(0.3, abs=1e-6) for t, message in coordinator.heard)  # the next tick


def test_every_plan_but_the_first_is_proposed_and_taken_over_if_it_is_admitted() -> None:
    east, west = Talks("east", "west"), Talks("west", "east")
    events, planners = flown(east, west)
    assert [t for t, _ in east.proposed] == pytest.approx(PERIOD * np.arange(1, 7))
    assert [plan for _, plan in east.taken][1:] == [plan for _, plan in east.proposed][:-1]
    assert [event.kind for event in events if event.kind == "not-admitted"] == []
    received = [message for request in planners["east"].asked for message in request.messages]
    assert [(message.topic, message.payload) for message in received] == [("arrival time", 42.0)]
    assert Event(0.0, "east", "spoke", "east") in events


def test_a_plan_that_is_not_admitted_is_on_record_and_the_one_before_stays() -> None:
    """Messages arrive too late to be of use."""
    east, west = Talks("east", "west", patience=0.0), Talks("west", "east")
    events, _ = flown(east, west, delay=10.0)
    refused = [event.t for event in events if (event.agent, event.kind) == ("east", "not-admitted")]
    assert refused == pytest.approx(PERIOD * np.arange(2, 7))
    assert len(east.taken) == 1
    assert len([event for event in events if event.agent == "west" and event.kind == "not-admitted"]) == 5


def test_a_plan_of_the_monitor_is_proposed_and_taken_over_at_once() -> None:
    class Watches(Answers):
        def monitor(self, request: PlanRequest) -> Plan | None:
            return there_and_stop(request) if request.t == pytest.approx(0.7) else None

    east, west = Talks("east", "west"), Talks("west", "east")
    agents = {
        each.name: Agent(ReadsState(), Watches(there_and_stop), Follows(), coordinator=each) for each in (east, west)
    }
    simulate(Pair(), agents, 1.0)
    (taken,) = [plan for t, plan in east.taken if t == pytest.approx(0.7)]
    assert [plan for t, plan in east.proposed if t == pytest.approx(0.7)] == [taken]


def test_a_coordinator_that_raises_has_said_nothing_and_is_on_record() -> None:
    mute, west = Talks("east", "west", mute=2.0), Talks("west", "east")
    events, _ = flown(mute, west)
    raised = [event for event in events if event.kind == "coordinator-raised"]
    assert {event.agent for event in raised} == {"east"}
    assert raised[0].message.startswith("RuntimeError: no voice")
    assert max(message.t for _, message in west.heard) == pytest.approx(2.0)


def test_a_stored_plan_is_flown_from_the_start_and_the_next_one_is_asked_ahead() -> None:
    x = np.zeros((2, 6))
    x[:, :3] = [50.0, 0.0, 100.0]
    stored = Plan(np.array([0.0, 20.0]), x, np.zeros((1, 3)), np.zeros(1, np.int64))
    planner, coordinator = Answers(there_and_stop), Talks("east", "west")
    agent = Agent(ReadsState(), planner, Follows(), coordinator=coordinator, stored=stored)
    other = Agent(ReadsState(), Answers(there_and_stop), Follows(), coordinator=Talks("west", "east"))
    simulate(Pair(), {"east": agent, "west": other}, 1.0)
    current = planner.asked[0].current
    assert current is not None
    np.testing.assert_array_equal(current.x, stored.x)
    assert planner.asked[0].t_start == pytest.approx(PERIOD)
    assert coordinator.taken[0] == (0.0, stored)
    assert len(coordinator.proposed) == 3


def test_a_period_that_is_no_whole_number_of_ticks_is_refused() -> None:
    coordinator = Talks("east", "west", period=0.07)
    agent = Agent(ReadsState(), Answers(there_and_stop), Follows(), coordinator=coordinator)
    with pytest.raises(ValueError, match=r"east: the coordinator's period = 0\.07"):
        simulate(Pair(), {"east": agent}, 1.0)
