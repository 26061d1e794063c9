"""The network delivers what was sent, in order of arrival, and its wrappers do to it what they say and no more."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.interfaces.signals import Message
from mathnavi.sim.engine.network import (
    DelayedLinks,
    IdealNetwork,
    Linked,
    LossyLinks,
    Network,
    Partition,
    partitioned,
    within_range,
)

NAMES = ("a", "b", "c")


def outbox(network: Network, count: int) -> None:
    """a sends b a number every tenth of a second."""
    for k in range(count):
        network.send([("b", Message(0.1 * k, "a", "number", k))], 0.1 * k)


def heard(network: Network, t: float, receiver: str = "b") -> list[int]:
    return [message.payload for message in network.receive(receiver, t)]


def test_what_is_sent_arrives_once_in_order_and_only_where_it_was_sent() -> None:
    network = IdealNetwork(NAMES)
    outbox(network, 5)
    assert heard(network, 0.2) == [0, 1, 2]
    assert heard(network, 0.2) == []
    assert heard(network, 10.0, "c") == []
    assert heard(network, 10.0) == [3, 4]


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.5), st.floats(0.0, 0.5))
def test_delayed_messages_all_arrive_within_their_time_and_may_overtake(seed: int, least: float, more: float) -> None:
    network = DelayedLinks(IdealNetwork(NAMES), least, least + more, np.random.default_rng(seed))
    outbox(network, 20)
    found: list[int] = []
    for k in range(60):
        now = heard(network, 0.05 * k)
        assert all(0.05 * k >= 0.1 * number + least - 1e-6 for number in now)
        found += now
    assert sorted(found) == list(range(20))
    assert all(0.1 * number + least + more <= 2.95 for number in found)


def test_a_fraction_is_lost_and_a_fraction_of_the_rest_doubled() -> None:
    network = LossyLinks(IdealNetwork(NAMES), 0.2, 0.1, np.random.default_rng(0))
    outbox(network, 4000)
    counts = Counter(heard(network, 1e6))
    assert 0.17 < 1.0 - len(counts) / 4000 < 0.23
    assert 0.08 < sum(count == 2 for count in counts.values()) / len(counts) < 0.12
    assert max(counts.values()) == 2


def test_the_same_seed_loses_the_same() -> None:
    lists = []
    for _ in range(2):
        network = LossyLinks(
            DelayedLinks(IdealNetwork(NAMES), 0.0, 0.4, np.random.default_rng(1)), 0.3, 0.3, np.random.default_rng(2)
        )
        outbox(network, 100)
        lists.append(heard(network, 1e6))
    assert lists[0] == lists[1]


@pytest.mark.parametrize("kind", ["ideal", "lossy", "linked"])
def test_a_message_to_several_arrives_as_one_to_each_would(kind: str) -> None:
    found = []
    for several in (True, False):
        network: Network = DelayedLinks(IdealNetwork(NAMES), 0.0, 0.3, np.random.default_rng(1))
        if kind == "lossy":
            network = LossyLinks(network, 0.3, 0.3, np.random.default_rng(2))
        elif kind == "linked":
            network = Linked(network, lambda sender, receiver, t: receiver != "c" or t > 0.5)
        for k in range(20):
            message = Message(0.1 * k, "a", "number", k)
            network.send([(("b", "c"), message)] if several else [("b", message), ("c", message)], 0.1 * k)
        found.append([heard(network, t, receiver) for t in (0.7, 1e6) for receiver in NAMES])
    assert found[0] == found[1]


def test_what_is_repeated_to_several_as_it_is_arrives_once_where_nothing_is_lost() -> None:
    network, several, message = IdealNetwork(NAMES), ("b", "c"), Message(0.0, "a", "number", 1)
    for t in (0.0, 0.1, 0.2):
        network.send([(several, message)], t)
    assert [heard(network, 1.0, name) for name in NAMES] == [[], [1], [1]]
    network.send([(several, Message(0.0, "a", "number", 2))], 1.0)
    network.send([(several, message)], 1.0)
    assert heard(network, 1.0) == [2, 1]
    lossy = LossyLinks(IdealNetwork(NAMES), 0.9, 0.0, np.random.default_rng(0))
    for k in range(100):
        lossy.send([(several, message)], 0.1 * k)
    assert heard(lossy, 1e6)
    assert heard(lossy, 1e6, "c")


def test_a_partition_holds_back_what_is_sent_between_the_parts_while_it_lasts() -> None:
    network = partitioned(IdealNetwork(NAMES), [Partition(0.2, 0.4, frozenset("a"))])
    outbox(network, 6)
    assert heard(network, 1.0) == [0, 1, 4, 5]
    network.send([("b", Message(0.3, "c", "number", 9))], 0.3)
    assert heard(network, 1.0) == [9]


def test_without_a_link_nothing_passes() -> None:
    network = Linked(IdealNetwork(NAMES), lambda sender, receiver, t: {sender, receiver} == {"a", "c"})
    outbox(network, 3)
    assert heard(network, 1.0) == []


def test_what_no_network_can_be_is_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match=r"names = .* allowed: each once, and not a again"):
        IdealNetwork(("a", "b", "a"))
    with pytest.raises(ValueError, match="receiver = 'z'; allowed: a, b, c"):
        IdealNetwork(NAMES).send([("z", Message(0.0, "a", "", None))], 0.0)
    with pytest.raises(ValueError, match=r"most delay = 0\.1"):
        DelayedLinks(IdealNetwork(NAMES), 0.2, 0.1, rng)
    with pytest.raises(ValueError, match=r"loss = 1\.5"):
        LossyLinks(IdealNetwork(NAMES), 1.5, 0.0, rng)
    with pytest.raises(ValueError, match=r"end = 1\.0"):
        Partition(2.0, 1.0, frozenset())


def test_who_is_out_of_range_is_not_heard() -> None:
    apart = {frozenset("ab"): 900.0, frozenset("ac"): 1100.0, frozenset("bc"): 1000.0}
    network = within_range(IdealNetwork("abc"), lambda one, other: apart[frozenset((one, other))], 1000.0)
    for sender, receiver in (("a", "b"), ("a", "c"), ("b", "c")):
        network.send([(receiver, Message(0.0, sender, "position", None))], 0.0)
    assert [message.sender for message in network.receive("b", 0.0)] == ["a"]
    assert [message.sender for message in network.receive("c", 0.0)] == ["b"]
    with pytest.raises(ValueError, match=r"reach = 0\.0; allowed: a finite value > 0"):
        within_range(network, lambda one, other: 0.0, 0.0)
