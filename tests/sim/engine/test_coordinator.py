"""Vehicles that communicate: messages arrive over the network, and a plan takes over only where it is admitted."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from mathnavi.controllers.flight.certified import Certified
from mathnavi.interfaces.protocols import Coordinator
from mathnavi.interfaces.signals import Event, Message, Outbox, Plan, PlanRequest
from mathnavi.models.aerial.plan_distance import PlannedTrajectory
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.loop import Loop, simulate
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
    assert Event(0.0, "east", "Talks: spoke", "east") in events


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
    t, taken = coordinator.taken[0]
    assert t == 0.0
    np.testing.assert_array_equal(taken.x, stored.x)
    assert len(coordinator.proposed) == 3


def test_a_period_that_is_no_whole_number_of_ticks_is_refused() -> None:
    coordinator = Talks("east", "west", period=0.07)
    agent = Agent(ReadsState(), Answers(there_and_stop), Follows(), coordinator=coordinator)
    with pytest.raises(ValueError, match=r"east: the coordinator's period = 0\.07"):
        simulate(Pair(), {"east": agent}, 1.0)


def said(self: Talks, t: float, *, to: object = "west", sender: str = "east", payload: object = 0.0) -> Outbox:
    return Outbox(((to, Message(t, sender, "count", payload)),))  # type: ignore[arg-type]


def told(self: Talks, t: float, payload: object, topic: str = "arrival time") -> Outbox:
    return Outbox((), (Message(t, self.name, topic, payload),))


class Map:
    """An object that is no data."""


# What the page on guarantees says: of an answer of a method, which events it leads to. From 1.2 s on.
UNUSABLE, UNPROPOSED, UNADMITTED, UNTOLD = (
    ("coordinator-raised",), ("coordinator-raised", "not-admitted"), ("coordinator-raised", "not-admitted"),
    ("coordinator-raised", "separation-unguaranteed"),
)  # fmt: skip
ANSWERS: dict[tuple[str, str], tuple[Any, tuple[str, ...]]] = {
    ("exchange", "as it should"): (said, ()),
    ("exchange", "raises"): (lambda self, t: 1 / 0, UNUSABLE),
    ("exchange", "exits"): (lambda self, t: sys.exit(3), UNUSABLE),
    ("exchange", "nothing"): (lambda self, t: None, UNUSABLE),
    ("exchange", "a list"): (lambda self, t: [], UNUSABLE),
    ("exchange", "messages that are none"): (lambda self, t: Outbox((("west", 3),)), UNUSABLE),  # type: ignore[arg-type]
    ("exchange", "no pairs"): (lambda self, t: Outbox((3,)), UNUSABLE),  # type: ignore[arg-type]
    ("exchange", "in another's name"): (lambda self, t: said(self, t, sender="west"), UNUSABLE),
    ("exchange", "to nobody"): (lambda self, t: said(self, t, to="north"), UNUSABLE),
    ("exchange", "to a list"): (lambda self, t: said(self, t, to=["west"]), UNUSABLE),
    ("exchange", "at no time"): (lambda self, t: said(self, math.nan), UNUSABLE),
    ("exchange", "an object"): (lambda self, t: said(self, t, payload=Map()), UNUSABLE),
    ("exchange", "an array of objects"): (lambda self, t: said(self, t, payload=np.array([Map()])), UNUSABLE),
    ("exchange", "a list of numbers"): (lambda self, t: said(self, t, payload=[1.0]), ()),
    ("exchange", "a trajectory that is torn"): (lambda self, t: said(self, t, payload=torn()), UNUSABLE),
    ("exchange", "events that are none"): (lambda self, t: Outbox(events=(1,)), UNUSABLE),  # type: ignore[arg-type]
    ("exchange", "a forged event"): (
        lambda self, t: Outbox(events=(("guarantee-held", ""),)), ("Talks: guarantee-held",)
    ),
    ("exchange", "a time to its planner"): (lambda self, t: told(self, t, 40.0), ("message",)),
    ("exchange", "no time to its planner"): (lambda self, t: told(self, t, math.nan), UNUSABLE),
    ("exchange", "an infinite time"): (lambda self, t: told(self, t, np.float64(math.inf)), UNUSABLE),
    ("exchange", "a map to its planner"): (lambda self, t: told(self, t, FLAT, "terrain"), UNUSABLE),
    ("exchange", "in another's name to its planner"): (lambda self, t: Outbox((), (
        Message(t, "survey", "target", (0.0, 0.0, 0.0)),
    )), UNUSABLE),
    ("propose", "raises"): (lambda self, t: 1 / 0, UNPROPOSED),
    ("propose", "answers"): (lambda self, t: True, UNPROPOSED),
    ("admits", "raises"): (lambda self, t: 1 / 0, UNADMITTED),
    ("admits", "nothing"): (lambda self, t: None, UNADMITTED),
    ("admits", "text"): (lambda self, t: "no", UNADMITTED),
    ("admits", "a number"): (lambda self, t: 1, UNADMITTED),
    ("admits", "False"): (lambda self, t: False, ("not-admitted",)),
    ("admits", "True of NumPy"): (lambda self, t: np.True_, ()),
    ("adopted", "raises"): (lambda self, t: 1 / 0, UNTOLD),
    ("adopted", "answers"): (lambda self, t: 3, UNTOLD),
}  # fmt: skip
FLAT = HeightField(np.zeros((4, 4)), 10.0)


def torn() -> PlannedTrajectory:
    trajectory = PlannedTrajectory(np.array([0.0, 1.0]), np.zeros((2, 6)), np.zeros((1, 3)))
    object.__setattr__(trajectory, "x", np.zeros((1, 6)))
    return trajectory


def fly_east(east: Talks, maker: type[Answers] = Answers, duration: float = 2.2) -> Loop:
    agents = {
        each.name: Agent(ReadsState(), maker(there_and_stop), Follows(), coordinator=each)
        for each in (east, Talks("west", "east"))
    }
    loop = Loop(Pair(), agents, duration)
    while not loop.over:
        loop.control_step()
        loop.advance()
    return loop


@pytest.mark.refused("plug-in", "coordinator: an answer that cannot be used")
@pytest.mark.parametrize(("method", "answer"), ANSWERS)
def test_an_answer_of_a_coordinator_leads_to_what_the_page_says(method: str, answer: str) -> None:
    misdeed, events = ANSWERS[method, answer]

    east = Talks("east", "west", briefed=True)
    good = getattr(east, method)
    setattr(east, method, lambda t, *given: misdeed(east, t) if 1.2 <= t <= 1.71 else good(t, *given))
    loop = fly_east(east)
    found = [event for event in loop.recording.events if event.agent == "east" and event.t >= 1.2]
    assert [*dict.fromkeys(event.kind for event in found)] == [*events]
    assert [event.kind for event in found].count("coordinator-raised") <= 1  # where it begins
    assert not [event for event in loop.recording.events if event.agent == "west" and event.t >= 1.2]
    assert len(loop.recording.agents["east"].plans) == 4 - ("not-admitted" in events)


@pytest.mark.parametrize("answer", [False, "raises"])
def test_a_plan_made_anew_takes_over_whatever_the_coordinator_answers_and_is_announced_at_once(answer: Any) -> None:
    class Strange(Talks):
        def admits(self, t: float, plan: Plan) -> bool:
            return bool(1 / 0) if answer == "raises" else False

    class Watches(Answers):
        __module__ = Certified.__module__  # a guest could not say that its plan is rebased

        def monitor(self, request: PlanRequest) -> Plan | None:
            return replace(there_and_stop(request), notes=("rebased",)) if request.t == pytest.approx(0.7) else None

    loop = fly_east(Strange("east", "west"), Watches, 0.8)
    plans = loop.recording.agents["east"].plans
    assert plans[-1][0] == pytest.approx(0.7)
    told = [event.t for event in loop.recording.events if event.kind == "separation-unguaranteed"]
    assert told == pytest.approx([0.7, 0.7])  # of either vehicle


def test_what_a_coordinator_does_with_what_it_was_given_changes_nothing() -> None:
    class Strange(Talks):
        def exchange(self, t: float, received: Sequence[Message]) -> Outbox:
            for message in received:
                object.__setattr__(message, "payload", 1e9)
            return super().exchange(t, received)

        def adopted(self, t: float, plan: Plan) -> None:
            object.__setattr__(plan, "u", plan.u + 1e3)
            with pytest.raises(ValueError, match="cannot set WRITEABLE"):
                plan.x.setflags(write=True)
            super().adopted(t, plan)

        def propose(self, t: float, plan: Plan) -> None:
            object.__setattr__(plan, "notes", ("rebased",))
            super().propose(t, plan)

    loops = fly_east(Strange("east", "west")), fly_east(Talks("east", "west"))
    strange, good = ([plan for _, plan in loop.recording.agents["east"].plans] for loop in loops)
    assert len(strange) == len(good)
    for one, other in zip(strange, good, strict=True):
        np.testing.assert_array_equal(one.u, other.u)
        assert one.notes == other.notes
    assert not [event for event in loops[0].recording.events if event.kind == "separation-unguaranteed"]
