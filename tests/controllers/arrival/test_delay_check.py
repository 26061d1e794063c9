"""The delay check keeps vehicles apart while no message takes longer than it waits, and does not where one does."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from mathnavi.controllers.arrival.delay_check import DelayCheck, Published, joined
from mathnavi.controllers.arrival.separation_rule import TOPIC, Zone
from mathnavi.interfaces.signals import Message, Plan
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.kernels import state_on
from mathnavi.models.aerial.plan_distance import PlannedTrajectory
from mathnavi.sim.engine.network import DelayedLinks, IdealNetwork, Network
from tests.controllers.arrival.flights import hover, sampled_distances, straight, to_rest

STEP, ROOM = 0.1, 9.0  # [s] between two exchanges, and [m]
ZONE = Zone(distance=2.0)
CHECK = 0.5  # [s] delta_DC


def rules(count: int, rng: np.random.Generator, delay: float = CHECK, wait: float = 0.5) -> dict[str, DelayCheck]:
    """Vehicles at rest in the corners of a box."""
    names = [f"v{k}" for k in range(count)]
    plans = {
        name: hover(ROOM * np.array([k & 1, k >> 1 & 1, k >> 2 & 1], dtype=np.float64)) for k, name in enumerate(names)
    }
    return {
        name: DelayCheck(name, [n for n in names if n != name], ZONE, plan, rng, delay, wait=wait, step=STEP)
        for name, plan in plans.items()
    }


def flown(count: int, seed: int, delay: float, seconds: float) -> tuple[float, int]:
    """Least distance [m] that the plans being flown will ever have, and how many were adopted."""
    rng = np.random.default_rng(seed)
    vehicles = rules(count, rng)
    network: Network = DelayedLinks(IdealNetwork(list(vehicles)), 0.0, delay, rng)
    plans = {name: hover(vehicle._current.x[0, :3]) for name, vehicle in vehicles.items()}
    proposed: dict[str, tuple[int, Plan]] = {}
    least, adopted = np.inf, 0
    for k in range(round(seconds / STEP)):
        t, before = k * STEP, adopted
        for name in rng.permutation(list(vehicles)):
            vehicle = vehicles[name]
            network.send(vehicle.exchange(t, network.receive(name, t)), t)
            if name in proposed and proposed[name][1].t_start <= t + 1e-9:
                id, plan = proposed.pop(name)
                if vehicle.admitted(id):
                    vehicle.adopt(t)
                    plans[name] = plan
                    adopted += 1
                else:
                    vehicle.withdraw()
            if name not in proposed and rng.random() < 0.3:
                start = t + STEP * rng.integers(8, 20)
                plan = to_rest(state_at(plans[name], start), rng.uniform(0.0, ROOM, 3), rng.uniform(0.5, 3.0), start)
                proposed[name] = vehicle.propose(plan), plan
        if adopted > before:  # only then are there new plans
            for a, b in combinations(plans.values(), 2):
                least = min(least, float(sampled_distances(a, b, t, 60)[1].min()))
    assert all(vehicle.guaranteed for vehicle in vehicles.values())
    return least, adopted


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.integers(2, 5), st.sampled_from([0.0, 0.25, CHECK]))
def test_current_plans_are_apart_for_ever_while_no_message_takes_longer_than_the_check(
    seed: int, count: int, delay: float
) -> None:
    least, adopted = flown(count, seed, delay, 6.0)
    assert least >= ZONE.required - 1e-9
    event(f"adopted: {'none' if adopted == 0 else 'some'}")


def test_messages_that_take_longer_void_the_guarantee() -> None:
    assert min(flown(5, seed, 4.0 * CHECK, 6.0)[0] for seed in range(6)) < ZONE.distance


def exchange(vehicles: dict[str, DelayCheck], network: Network, begin: float, end: float) -> None:
    for t in np.arange(begin, end, STEP):
        for name, vehicle in vehicles.items():
            network.send(vehicle.exchange(float(t), network.receive(name, float(t))), float(t))


def test_a_plan_is_admitted_after_the_check_and_not_before() -> None:
    vehicles = rules(3, np.random.default_rng(0), wait=0.0)
    network, v0 = IdealNetwork(list(vehicles)), vehicles["v0"]
    id = v0.propose(hover(np.array([0.0, 0.0, -5.0]), 3.0))
    exchange(vehicles, network, 0.0, 2.3)  # published at 2.3 s, delta_DC and two exchanges before its start
    assert v0._candidate is not None
    assert v0._candidate.published is None
    exchange(vehicles, network, 2.3, 2.75)
    assert not v0.admitted(id)
    with pytest.raises(ValueError, match=r"pending = 1 of v0; allowed: a proposal that is committed to"):
        v0.adopt(3.0)
    exchange(vehicles, network, 2.8, 2.95)
    assert v0.admitted(id)
    with pytest.raises(ValueError, match=r"t = 2.9 of v0; allowed: >= 3.0"):
        v0.adopt(2.9)
    v0.adopt(3.0)
    assert v0.pending is None
    assert v0.unheard == ()


def test_of_two_in_conflict_one_at_most_is_admitted_and_what_is_committed_blocks_others() -> None:
    for seed in range(10):
        vehicles = rules(2, np.random.default_rng(seed), wait=1.0)
        middle = straight((4.5, 0.0, 0.0), (0.0, 0.0, 1.0), 5.0, 4.0)
        ids = {name: vehicle.propose(middle) for name, vehicle in vehicles.items()}
        exchange(vehicles, IdealNetwork(list(vehicles)), 0.0, 4.05)
        assert sum(vehicle.admitted(ids[name]) for name, vehicle in vehicles.items()) <= 1
        assert any(event.kind == "separation-refused" for each in vehicles.values() for event in each.events)


def test_who_does_not_fly_what_it_committed_to_says_so() -> None:
    vehicles = rules(2, np.random.default_rng(0), wait=0.0)
    v0, network = vehicles["v0"], IdealNetwork(list(vehicles))
    id = v0.propose(hover(np.array([0.0, 0.0, -5.0]), 3.0))
    exchange(vehicles, network, 2.0, 2.95)
    assert v0.admitted(id)
    exchange(vehicles, network, 3.0, 3.35)  # it was to be adopted at 3 s
    assert not v0.guaranteed
    assert [each.kind for each in v0.events] == ["separation-unguaranteed"]
    v0.rebase(hover(np.array([0.0, 0.0, 1.0]), 3.5))
    ((_, message),) = v0.exchange(3.5, [])
    assert message.payload.committed
    assert message.payload.trajectory.x[0, 2] == 1.0


def test_an_old_trajectory_replaces_no_new_one_and_what_cannot_be_is_ignored() -> None:
    v0 = rules(2, np.random.default_rng(0))["v0"]
    trajectory = PlannedTrajectory.from_plan(hover(np.array([0.0, 9.0, 0.0])))
    for id, committed in ((3, False), (2, True), (1, True), (1, False)):
        v0.exchange(1.0, [Message(1.0, "v1", TOPIC, Published(id, trajectory, committed))])
    assert {id: each.committed for id, each in v0._stored["v1"].items()} == {2: True, 3: False}
    for message in (
        Message(0.0, "stranger", TOPIC, Published(1, trajectory, True)),
        Message(9.0, "v1", TOPIC, Published(9, trajectory, True)),
        Message(0.0, "v1", TOPIC, "yes"),
    ):
        v0.exchange(1.0, [message])
        assert v0.events.pop().kind == "separation-ignored"


def test_a_joined_trajectory_follows_one_and_then_the_other() -> None:
    before = to_rest(np.zeros(6), np.array([10.0, 0.0, 0.0]), 2.0, 0.0)
    for start in (1.0, 2.0, 3.0, 4.0, 6.0):
        after = to_rest(state_at(before, start), np.array([0.0, 20.0, 0.0]), 3.0, start)
        both = joined(PlannedTrajectory.from_plan(before), PlannedTrajectory.from_plan(after))
        for t in np.linspace(0.0, 14.0, 57):
            expected = state_at(before if t < start else after, t)[:3]
            np.testing.assert_allclose(state_on(both.t, both.x, both.u, t)[:3], expected, atol=1e-9)
