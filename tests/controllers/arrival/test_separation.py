"""Vehicles that fly only what all others have acknowledged stay apart, whatever the network does to their messages.

The network may lose, delay, double and cut off; vehicles propose at random, withdraw at random, by clocks that differ,
and fly beside their plans. How far apart they are is sampled, with none of the code that the protocol decides by.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from mathnavi.controllers.arrival.separation import Proposal, Separation, SeparationReply
from mathnavi.controllers.arrival.separation_rule import TOPIC, Zone, checked_start
from mathnavi.interfaces.signals import Array, Message, Plan
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.plan_distance import PlannedTrajectory
from mathnavi.sim.engine.network import DelayedLinks, IdealNetwork, LossyLinks, Network, Partition, partitioned
from tests.controllers.arrival.flights import hover, sampled_distances, straight, to_rest

TICK, LEAD = 0.1, 2.0  # [s] the latter at most from a proposal to its start
ROOM = 9.0  # [m] side of the box
ZONE = Zone(distance=2.0, bound=0.1, speed_max=0.0, clock_error=0.02)  # plans bring their own greatest speed


def names(count: int) -> tuple[str, ...]:
    return tuple(f"v{k}" for k in range(count))


class Vehicle:
    """Proposes at random, and adopts what is admitted by the time at which it starts."""

    def __init__(self, name: str, separation: Separation, plan: Plan, clock: float, rng: np.random.Generator) -> None:
        self.name, self.separation, self.plan, self.clock, self._rng = name, separation, plan, clock, rng
        self._next: Plan | None = None
        self._id = 0
        self.adopted = 0

    def position(self, t: float) -> Array:
        """(3,) at true time t: within the bound of the plan, by the vehicle's own clock."""
        error = self._rng.normal(size=3)
        p: Array = state_at(self.plan, t + self.clock)[:3] + ZONE.bound * error / np.linalg.norm(error)
        return p

    def act(self, t: float, network: Network, plan_now: bool) -> None:
        own = t + self.clock
        received = network.receive(self.name, t)
        network.send(self.separation.exchange(own, received), t)
        if self._next is not None and self._next.t_start <= own:
            if self.separation.admitted(self._id):
                self.separation.adopt(own)
                self.plan = self._next
                self.adopted += 1
            else:
                self.separation.withdraw()
            self._next = None
        if self._next is not None and self._rng.random() < 0.02:
            self.separation.withdraw()
            self._next = None
        if plan_now and self._next is None:
            start = own + self._rng.uniform(0.1, 1.0) * LEAD  # at no time that all share
            target = self._rng.uniform(0.0, ROOM, 3)
            self._next = to_rest(state_at(self.plan, start), target, self._rng.uniform(0.5, 3.0), start)
            self._id = self.separation.propose(self._next)


def corners(count: int) -> list[Array]:
    return [ROOM * np.array([k & 1, k >> 1 & 1, k >> 2 & 1], dtype=np.float64) for k in range(count)]


def fleet(count: int, rng: np.random.Generator) -> list[Vehicle]:
    stored = {name: hover(p) for name, p in zip(names(count), corners(count), strict=True)}
    checked_start(list(stored.items()), {name: plan.x[-1, :3] for name, plan in stored.items()}, ZONE)
    vehicles = []
    for name, plan in stored.items():
        own = Separation(name, [other for other in stored if other != name], ZONE, plan, rng)
        vehicles.append(Vehicle(name, own, plan, rng.uniform(-1.0, 1.0) * ZONE.clock_error, rng))
    return vehicles


def assert_apart(vehicles: list[Vehicle], t: float, adopted: bool) -> None:
    """Now and, where plans are new, by what is flown from now on for all future time."""
    for a, b in combinations(vehicles, 2):
        assert np.linalg.norm(a.position(t) - b.position(t)) >= ZONE.distance - 1e-9, (t, a.name, b.name)
        if adopted:
            later = sampled_distances(a.plan, b.plan, t + 2.0 * ZONE.clock_error, 150)[1]
            assert later.min() >= ZONE.required - 1e-9, (t, a.name, b.name)


@settings(max_examples=40)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(2, 6),
    st.sampled_from([0.0, 0.2, 0.6]),
    st.sampled_from([0.0, 0.5]),
    st.sampled_from([0.0, 0.15, 0.8]),
    st.booleans(),
)
def test_current_plans_are_apart_for_ever_whatever_the_network_does(
    seed: int, count: int, loss: float, duplication: float, delay: float, cut: bool
) -> None:
    rng = np.random.default_rng(seed)
    network: Network = LossyLinks(DelayedLinks(IdealNetwork(names(count)), 0.0, delay, rng), loss, duplication, rng)
    if cut:
        apart = frozenset(names(count)[: count // 2])
        network = partitioned(network, [Partition(1.0, 3.0, apart), Partition(4.0, 4.5, apart)])
    vehicles = fleet(count, rng)
    adopted = 0
    for k in range(100):
        t = k * TICK
        for n in rng.permutation(count):
            vehicles[n].act(t, network, plan_now=rng.random() < 0.4)
        before, adopted = adopted, sum(vehicle.adopted for vehicle in vehicles)
        assert_apart(vehicles, t, adopted > before)
    kinds = {each.kind for vehicle in vehicles for each in vehicle.separation.events}
    for kind in ("separation-refused", "separation-yielded", "separation-late"):
        event(f"{kind}: {kind in kinds}")
    event(f"adopted: {'none' if adopted == 0 else 'some' if adopted < 10 else '10 or more'}")


def exchange(network: Network, vehicles: dict[str, Separation], t: float) -> None:
    for name, vehicle in vehicles.items():
        network.send(vehicle.exchange(t, network.receive(name, t)), t)


def lanes(count: int, seed: int = 0) -> dict[str, Separation]:
    """Vehicles at rest, 10 m apart."""
    rng = np.random.default_rng(seed)
    return {
        name: Separation(name, [n for n in names(count) if n != name], Zone(2.0), hover(lane(k)), rng)
        for k, name in enumerate(names(count))
    }


def lane(k: int, height: float = 0.0) -> Array:
    return np.array([0.0, 10.0 * k, height])


def ahead(k: int, t: float = 5.0) -> Plan:
    """100 m along the lane."""
    return straight((0.0, 10.0 * k, 0.0), (10.0, 0.0, 0.0), 10.0, t)


def across(a: int, b: int, t: float = 5.0) -> Plan:
    """From lane a to 3 m above lane b: clear of what rests there, in the way of what rises."""
    p, v = lane(a), (lane(b, 3.0) - lane(a)) / 10.0
    return straight((p[0], p[1], p[2]), (v[0], v[1], v[2]), 10.0, t)


def rise(k: int, t: float = 5.0) -> Plan:
    """3 m up in the lane."""
    return across(k, k, t)


@pytest.mark.parametrize("count", [1, 2, 6])
def test_without_faults_and_conflicts_all_are_admitted_within_one_round_trip(count: int) -> None:
    vehicles, network = lanes(count), DelayedLinks(IdealNetwork(names(count)), 0.2, 0.2, np.random.default_rng(0))
    ids = {name: vehicle.propose(ahead(k)) for k, (name, vehicle) in enumerate(vehicles.items())}
    for t in (0.0, 0.2, 0.4):
        assert count == 1 or t == 0.0 or not any(vehicle.admitted(ids[name]) for name, vehicle in vehicles.items())
        exchange(network, vehicles, t)
    assert all(vehicle.admitted(ids[name]) for name, vehicle in vehicles.items())


def test_with_15_peers_and_a_fifth_lost_a_proposal_is_nearly_always_admitted_within_a_period() -> None:
    rng = np.random.default_rng(0)
    admitted = 0
    for trial in range(40):
        vehicles = lanes(16, trial)
        network = LossyLinks(DelayedLinks(IdealNetwork(names(16)), 0.02, 0.1, rng), 0.2, 0.0, rng)
        number = vehicles["v0"].propose(ahead(0))
        for t in np.arange(0.0, 5.0 / 3.0, 0.1):
            exchange(network, vehicles, float(t))
        admitted += vehicles["v0"].admitted(number)
    assert admitted >= 39


@given(st.integers(0, 1000))
def test_of_two_proposals_in_conflict_exactly_one_is_admitted(seed: int) -> None:
    vehicles, network = lanes(2, seed), IdealNetwork(names(2))
    ids = {"v0": vehicles["v0"].propose(across(0, 1)), "v1": vehicles["v1"].propose(rise(1))}
    for t in (0.0, 0.1, 0.2, 0.3):
        exchange(network, vehicles, t)
    assert [vehicles[name].admitted(ids[name]) for name in ids].count(True) == 1


def test_of_many_in_conflict_each_gets_its_turn() -> None:
    """All want the same place, above; who got it leaves it again."""
    vehicles, network, turns = lanes(5), IdealNetwork(names(5)), set()
    for k in range(60):
        t = 10.0 * k
        ids = {name: vehicle.propose(hover_over(n, t)) for n, (name, vehicle) in enumerate(vehicles.items())}
        for step in range(4):
            exchange(network, vehicles, t + 0.1 * step)
        won = [name for name in ids if vehicles[name].admitted(ids[name])]
        assert len(won) == 1
        turns.update(won)
        for vehicle in vehicles.values():
            vehicle.withdraw()
    assert turns == set(vehicles)


def hover_over(n: int, t: float) -> Plan:
    """From lane n to one place above all."""
    p = lane(n)
    return to_rest(np.array([*p, 0.0, 0.0, 0.0]), np.array([0.0, 20.0, 30.0]), 4.0, t + 5.0)


def proposal_of(vehicle: Separation, t: float) -> dict[str, Message]:
    return {to: m for to, m in vehicle.exchange(t, []) if isinstance(m.payload, Proposal)}


def test_an_acknowledgement_of_a_withdrawn_proposal_is_void() -> None:
    vehicles = lanes(2)
    first = vehicles["v0"].propose(ahead(0))
    answers = vehicles["v1"].exchange(0.0, [proposal_of(vehicles["v0"], 0.0)["v1"]])
    vehicles["v0"].withdraw()
    second = vehicles["v0"].propose(across(0, 1))
    vehicles["v0"].exchange(0.1, [message for _, message in answers])
    assert first != second
    assert not vehicles["v0"].admitted(first)
    assert not vehicles["v0"].admitted(second)


def test_copies_get_the_same_answer_and_old_ones_none() -> None:
    vehicles = lanes(2)
    vehicles["v0"].propose(ahead(0))
    old = proposal_of(vehicles["v0"], 0.0)["v1"]
    vehicles["v0"].propose(across(0, 1))
    new = proposal_of(vehicles["v0"], 0.1)["v1"]
    once = vehicles["v1"].exchange(0.2, [new, new])
    assert [message.payload for _, message in once] == [SeparationReply(2, True)]
    vehicles["v1"].propose(rise(1))  # in its way
    again = vehicles["v1"].exchange(0.3, [old, new, old])
    assert [message.payload for _, message in again if isinstance(message.payload, SeparationReply)] == [
        SeparationReply(2, True)
    ]


def test_a_plan_in_the_way_of_what_is_flown_or_admitted_is_refused() -> None:
    vehicles, network = lanes(3), IdealNetwork(names(3))
    into = vehicles["v0"].propose(straight((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 10.0, 5.0))  # onto v1
    for t in (0.0, 0.1, 0.2):
        exchange(network, vehicles, t)
    assert not vehicles["v0"].admitted(into)
    assert vehicles["v0"].pending is None
    assert [each.kind for each in vehicles["v0"].events] == ["separation-refused"]
    up = vehicles["v1"].propose(rise(1))
    for t in (0.3, 0.4, 0.5):
        exchange(network, vehicles, t)
    assert vehicles["v1"].admitted(up)
    for k in range(10):  # whatever rank it draws
        vehicles["v0"].propose(across(0, 1))
        for t in (0.0, 0.1, 0.2):
            exchange(network, vehicles, 0.6 + 0.3 * k + t)
        assert vehicles["v0"].pending is None
    assert vehicles["v1"].admitted(up)


def test_adoption_needs_every_acknowledgement_and_the_time() -> None:
    vehicles, network = lanes(3), IdealNetwork(names(3))
    with pytest.raises(ValueError, match="pending = None of v0; allowed"):
        vehicles["v0"].adopt(5.0)
    vehicles["v0"].propose(ahead(0))
    with pytest.raises(ValueError, match="pending = 1 of v0; allowed"):
        vehicles["v0"].adopt(5.0)
    for t in (0.0, 0.1, 0.2):
        exchange(network, vehicles, t)
    with pytest.raises(ValueError, match=r"t = 4.0 of v0; allowed: >= 5.0"):
        vehicles["v0"].adopt(4.0)
    vehicles["v0"].adopt(5.0)
    assert vehicles["v0"].own[0].t[0] == 5.0
    assert len(vehicles["v0"].own) == 1
    assert not vehicles["v0"].admitted(1)


def test_what_is_not_admitted_by_its_start_is_withdrawn() -> None:
    vehicle = lanes(2)["v0"]
    vehicle.propose(ahead(0))
    assert proposal_of(vehicle, 5.0)
    late = Message(4.0, "v1", TOPIC, SeparationReply(1, True))
    assert vehicle.exchange(5.1, [late]) == []
    assert not vehicle.admitted(1)
    assert [each.kind for each in vehicle.events] == ["separation-late"]


def test_what_cannot_be_is_ignored_and_recorded() -> None:
    vehicle = lanes(2)["v0"]
    vehicle.propose(ahead(0))
    for message in (
        Message(0.0, "stranger", TOPIC, SeparationReply(1, True)),
        Message(9.0, "v1", TOPIC, SeparationReply(1, True)),
        Message(np.nan, "v1", TOPIC, SeparationReply(1, True)),
        Message(0.0, "v1", TOPIC, "yes"),
    ):
        vehicle.exchange(1.0, [message])
        assert not vehicle.admitted(1)
        assert vehicle.events.pop().kind == "separation-ignored"
    vehicle.exchange(1.0, [Message(0.0, "v1", "radar", None)])
    assert vehicle.events == []


def test_a_vehicle_that_left_its_plan_says_so_and_is_checked_where_it_is() -> None:
    vehicles, network = lanes(2), IdealNetwork(names(2))
    vehicles["v1"].propose(ahead(1))
    vehicles["v1"].rebase(hover(lane(0, 3.0)))
    assert not vehicles["v1"].guaranteed
    assert vehicles["v1"].pending is None
    number = vehicles["v0"].propose(straight((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 10.0, 5.0))
    for t in (0.0, 0.1, 0.2):
        exchange(network, vehicles, t)
    assert not vehicles["v0"].admitted(number)
    vehicles["v1"].propose(straight((0.0, 0.0, 3.0), (0.0, 0.0, 1.0), 10.0, 5.0))
    for t in (0.3, 0.4, 0.5):
        exchange(network, vehicles, t)
    vehicles["v1"].adopt(5.0)
    assert vehicles["v1"].guaranteed


def test_a_start_that_is_not_separated_names_who_how_far_and_what_is_allowed() -> None:
    zone = Zone(10.0, bound=1.0, speed_max=50.0, clock_error=0.01)  # 13 m
    a, b = straight((0.0, 0.0, 0.0), (10.0, 0.0, 0.0), 10.0), straight((50.0, 50.0, 0.0), (0.0, -10.0, 0.0), 10.0)
    slots = {"a": np.array([100.0, 0.0, 0.0]), "b": np.array([50.0, -50.0, 0.0])}
    with pytest.raises(ValueError, match=r"stored plans of a and b are 0.00 m apart; allowed: >= 13.00 m"):
        checked_start([("a", a), ("b", b)], slots, zone)
    assert set(checked_start([("a", a), ("b", b)], slots, Zone(10.0), t=6.0)) == {"a", "b"}
    near = straight((0.0, 12.0, 0.0), (10.0, 2.0, 0.0), 10.0)
    with pytest.raises(ValueError, match=r"starts of a and b are 12.00 m apart; allowed: >= 13.00 m"):
        checked_start([("a", a), ("b", near)], slots, zone)
    close = {"a": slots["a"], "b": slots["a"] + 5.0}
    with pytest.raises(ValueError, match=r"target slots of a and b are 8.66 m apart; allowed: >= 13.00 m"):
        checked_start([("a", a), ("b", b)], close, zone)
    with pytest.raises(ValueError, match="and not a again"):
        checked_start([("a", a), ("a", b)], slots, zone)
    with pytest.raises(ValueError, match="one for every vehicle, also for b"):
        checked_start([("a", a), ("b", b)], {"a": slots["a"]}, zone)
    with pytest.raises(ValueError, match="plan of a: t, x or u is not finite"):
        checked_start([("a", straight((np.nan, 0.0, 0.0), (1.0, 0.0, 0.0), 1.0)), ("b", b)], slots, zone)
    with pytest.raises(ValueError, match="and not v0 again"):
        Separation("v0", ["v1", "v0"], zone, a, np.random.default_rng(0))
    with pytest.raises(ValueError, match=r"distance = 0.0; allowed: a finite value > 0"):
        Zone(0.0)


def test_a_plan_faster_than_allowed_brings_its_own_speed_into_the_zone() -> None:
    zone = Zone(10.0, bound=1.0, speed_max=50.0, clock_error=0.01)
    slow, fast = (
        PlannedTrajectory.from_plan(hover(lane(0))),
        PlannedTrajectory.from_plan(straight((0.0, 13.5, 0.0), (100.0, 0.0, 0.0), 1.0)),
    )
    assert zone.required == zone.between(slow, slow) == pytest.approx(13.0)
    assert zone.between(slow, fast) == zone.between(fast, slow) == pytest.approx(14.0)
    still = PlannedTrajectory.from_plan(hover(np.array([0.0, 13.5, 0.0])))
    assert zone.kept_from_each(slow, [fast, still], np.zeros(2)) == [False, True]


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_what_arrives_together_is_answered_as_if_one_came_after_the_other(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    others = names(6)[1:]
    received = []
    for _ in range(count):
        start, target = rng.uniform(0.0, ROOM, (2, 3))
        plan = PlannedTrajectory.from_plan(to_rest(np.array([*start, 0.0, 0.0, 0.0]), target, 1.0, 2.0))
        proposal = Proposal(int(rng.integers(1, 4)), float(rng.random()), plan)
        payload = rng.choice([proposal, SeparationReply(1, bool(rng.random() < 0.7)), "garbage"], p=[0.7, 0.2, 0.1])
        received.append(Message(1.0, str(rng.choice([*others, "stranger"])), TOPIC, payload))
    found = []
    for together in (True, False):
        own = Separation("v0", others, Zone(3.0), hover(np.zeros(3)), np.random.default_rng(seed))
        own.propose(to_rest(np.zeros(6), np.full(3, 0.5 * ROOM), 1.0, 2.0))
        batches = [received] if together else [[message] for message in received]
        answers: dict[str, SeparationReply] = {}
        for batch in batches:
            sent = own.exchange(1.0, batch)
            answers |= {to: each.payload for to, each in sent if isinstance(each.payload, SeparationReply)}
        found.append((answers, own.events, own.pending, set(own.unheard)))
    assert found[0] == found[1]
