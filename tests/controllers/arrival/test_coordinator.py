"""The coordinator: plans go to separation, times to consensus, and the planner hears of one common time."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mathnavi.controllers.arrival.coordinator import AGREEMENT, PATIENCE, AssuredArrival, FleetCoordinator
from mathnavi.controllers.arrival.maximum import Maximum
from mathnavi.controllers.arrival.separation import Separation
from mathnavi.controllers.arrival.separation_rule import TOPIC, Zone
from mathnavi.controllers.flight.planner import ARRIVAL
from mathnavi.interfaces.protocols import Coordinator
from mathnavi.interfaces.signals import Message, Outbox, Plan
from mathnavi.models.aerial.dynamics import flow
from mathnavi.models.fleet.graph import Graph
from mathnavi.sim.engine.network import IdealNetwork

NAMES = ("a", "b", "c")
H = 5.0 / 3.0
ROUND = 1.0 / 12.0


def along(y: float, t: float = 0.0, push: float = 10.0, notes: tuple[str, ...] = ()) -> Plan:
    """From x = 0 to the east and to rest, at y."""
    x = [np.array([0.0, y, 500.0, 0.0, 0.0, 0.0])]
    u = np.array([[push, 0.0, 0.0], [-push, 0.0, 0.0]])
    for a in u:
        x.append(flow(x[-1], a, 5.0))
    return Plan(t + np.array([0.0, 5.0, 10.0]), np.array(x), u, np.zeros(2, np.int64), notes=notes)


class Fleet:
    """Three coordinators on a line a - b - c, 1 km apart; each can arrive at its own time."""

    def __init__(
        self,
        times: dict[str, float],
        deadline: float = 1000.0,
        assured: AssuredArrival | None = None,
        wrapped: Callable[[str, Any], Any] = lambda name, part: part,
    ) -> None:
        graph, rng = Graph.line(NAMES), np.random.default_rng(0)
        self.network, self.announced = IdealNetwork(NAMES), {name: [] for name in NAMES}  # type: ignore[var-annotated]
        self.events: list[tuple[str, str]] = []
        self.stored = {name: along(1000.0 * k) for k, name in enumerate(NAMES)}
        self.coordinators = {}
        for name, one in zip(NAMES, rng.spawn(3), strict=True):
            peers = [other for other in NAMES if other != name]
            separation = Separation(name, peers, Zone(200.0), self.stored[name], one)
            consensus = Maximum.build(Maximum.Config(period=ROUND), graph.neighbourhood(name, H, deadline))
            self.coordinators[name] = FleetCoordinator(
                separation,
                wrapped(name, consensus),
                graph.neighbours(name),
                lambda plan, t, own=name: times[own],
                H,
                ROUND,  # type: ignore[misc]
                assured,
            )
            self.coordinators[name].adopted(0.0, self.stored[name])

    def exchange(self, begin: float, end: float, deaf: str = "") -> None:
        """What ``deaf`` receives is delivered, and lost there: it is not ready yet, or it has failed."""
        for t in np.arange(begin, end, ROUND):
            for name, coordinator in self.coordinators.items():
                received = self.network.receive(name, float(t))
                outbox = coordinator.exchange(float(t), () if name == deaf else received)
                assert isinstance(outbox, Outbox)
                self.network.send(outbox.messages, float(t))
                self.announced[name] += [m.payload for m in outbox.planner_messages if m.topic == ARRIVAL]
                self.events += outbox.events


def test_all_agree_on_the_largest_of_the_least_times_on_the_grid() -> None:
    times = {"a": 100.0, "b": 90.0, "c": 123.45}
    fleet = Fleet(times)
    assert all(isinstance(coordinator, Coordinator) for coordinator in fleet.coordinators.values())
    fleet.exchange(0.0, 1.0)
    common = ROUND * math.ceil(123.45 / ROUND)
    assert [each[-1] for each in fleet.announced.values()] == [common] * 3
    times["a"] = 130.0  # it has fallen behind, and says so at its next planning instant
    fleet.exchange(1.0, 4.0)
    assert [each[-1] for each in fleet.announced.values()] == [ROUND * math.ceil(130.0 / ROUND)] * 3
    assert all(len(each) == len(set(each)) for each in fleet.announced.values())  # announced once


ASSURED = AssuredArrival(100.0, lambda plan, t: 50.0 if "commits" in plan.notes else 101.0, 1.0)
"""Plans are within reach of the slot at 100 s, but for those that commit to 50 s."""


def test_who_queues_defers_and_all_agree_on_the_time_that_stored_plans_keep() -> None:
    fleet = Fleet(dict.fromkeys(NAMES, 50.0), assured=ASSURED)
    a, begin = fleet.coordinators["a"], 0.0
    for k in range(PATIENCE):
        assert all(times[-1] < 60.0 for times in fleet.announced.values() if times)
        plan = along(900.0, t=begin + H)  # in the way of b
        a.propose(begin, plan)
        fleet.exchange(begin, begin + H)
        assert not a.admits(begin + H, plan), k
        begin += H
    fleet.exchange(begin, begin + H)
    assert [times[-1] for times in fleet.announced.values()] == [100.0] * 3
    assert [kind for kind, _ in fleet.events].count("arrival-deferred") == 3


def test_a_deferral_reaches_who_could_not_take_it_when_it_was_delivered() -> None:
    fleet = Fleet(dict.fromkeys(NAMES, 50.0), assured=ASSURED)
    a, c = fleet.coordinators["a"], fleet.coordinators["c"]
    fleet.exchange(0.0, 1.0)
    a.propose(1.0, along(900.0, t=1.0 + H, notes=("commits",)))  # in the way of b
    fleet.exchange(1.0, 2.0, deaf="c")
    assert [kind for kind, _ in fleet.events].count("arrival-deferred") == 2
    fleet.exchange(2.0, 2.0 + H)
    assert [kind for kind, _ in fleet.events].count("arrival-deferred") == 3
    commitment = along(2500.0, t=2.0 + 2.0 * H, notes=("commits",))
    c.propose(2.0 + H, commitment)
    fleet.exchange(2.0 + H, 2.0 + 2.0 * H)
    assert not c.admits(2.0 + 2.0 * H, commitment)


def test_a_refused_commitment_stops_all_others_before_they_adopt_theirs() -> None:
    fleet = Fleet(dict.fromkeys(NAMES, 50.0), assured=ASSURED)
    a, c = fleet.coordinators["a"], fleet.coordinators["c"]
    fleet.exchange(0.0, 1.0)
    refused, clear = (along(y, t=1.0 + H, notes=("commits",)) for y in (900.0, 2500.0))
    a.propose(1.0, refused)
    c.propose(1.0, clear)
    fleet.exchange(1.0, 1.0 + H)
    assert not c.admits(1.0 + H, clear)  # though nothing is in its way
    assert fleet.announced["c"][-1] == 100.0


def test_a_plan_that_does_not_keep_what_is_agreed_is_announced() -> None:
    fleet = Fleet(dict.fromkeys(NAMES, 80.0), assured=ASSURED)
    fleet.coordinators["a"].adopted(0.0, along(0.0, t=1.0, notes=("commits",)))
    fleet.exchange(0.0, 6.0)
    assert [kind for kind, _ in fleet.events if kind.startswith("arrival")] == ["arrival-unkept"]


def test_a_plan_that_keeps_clear_is_admitted_and_flown() -> None:
    fleet = Fleet(dict.fromkeys(NAMES, 50.0))
    a, plan = fleet.coordinators["a"], along(-100.0, t=2.0)
    a.propose(0.0, plan)
    assert not a.admits(0.0, plan)  # no vehicle has received it
    a.propose(0.0, plan)
    fleet.exchange(0.0, 1.0)
    assert a.admits(2.0, plan)
    a.adopted(2.0, plan)
    assert not a.admits(2.1, plan)  # it is no proposal any more


def test_a_plan_in_anothers_way_is_not_admitted_and_on_record() -> None:
    fleet = Fleet(dict.fromkeys(NAMES, 50.0))
    a, plan = fleet.coordinators["a"], along(900.0, t=2.0)
    a.propose(0.0, plan)
    fleet.exchange(0.0, 1.0)
    assert not a.admits(2.0, plan)
    assert "separation-refused" in {kind for kind, _ in fleet.events}
    other = along(0.0, t=2.0)
    assert not a.admits(2.0, other)  # never proposed


def test_a_vehicle_that_left_its_plan_flies_what_it_made_anew_and_the_others_heed_that() -> None:
    fleet = Fleet(dict.fromkeys(NAMES, 50.0))
    a, b = fleet.coordinators["a"], fleet.coordinators["b"]
    rebased = along(600.0, t=1.0, notes=("tracking-breach", "rebased"))
    assert a.admits(1.0, rebased)
    a.adopted(1.0, rebased)
    near = along(700.0, t=3.0)
    b.propose(1.0, near)
    fleet.exchange(1.0, 2.0)
    assert not b.admits(3.0, near)


def test_a_plan_that_comes_before_the_agreed_time_is_flown_only_under_a_rule_that_binds_to_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fleet = Fleet(dict.fromkeys(NAMES, 50.0))
    a, plan = fleet.coordinators["a"], along(-100.0, t=2.0)
    monkeypatch.setattr(a, "_outdated", lambda t, plan: True)
    for binding in (False, True):
        monkeypatch.setattr(a._separation, "binding", binding, raising=False)
        a.propose(0.0, plan)
        fleet.exchange(0.0, 1.0)
        assert a.admits(2.0, plan) is binding


def test_what_cannot_be_understood_changes_nothing() -> None:
    fleet = Fleet({"a": 100.0, "b": 90.0, "c": 80.0})
    for topic in (TOPIC, AGREEMENT, "weather"):
        for payload in (None, math.nan, "soon", 1e9):
            fleet.network.send([("a", Message(0.0, "b", topic, payload))], 0.0)
    fleet.exchange(0.0, 1.0)
    assert [each[-1] for each in fleet.announced.values()] == [pytest.approx(100.0)] * 3


def test_a_grid_that_is_none_is_refused() -> None:
    fleet = Fleet(dict.fromkeys(NAMES, 50.0))
    one = fleet.coordinators["a"]
    with pytest.raises(ValueError, match=r"grid = 0\.0; allowed"):
        FleetCoordinator(one._separation, one._consensus, (), lambda plan, t: 0.0, H, 0.0)
