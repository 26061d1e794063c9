"""The contract of every entry of ``mathnavi.consensus``, whoever wrote it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from importlib.metadata import entry_points
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.interfaces.protocols import Consensus, ConsensusPlugin
from mathnavi.interfaces.signals import Array, Message
from mathnavi.models.fleet.graph import Graph
from mathnavi.sim.engine.network import DelayedLinks, IdealNetwork, LossyLinks, Network
from mathnavi.sim.plugin.registry import PluginSpec, checked_consensus, load, names
from mathnavi.studies.fleet.message_exchange import exchanged
from tests.fleet import NAMES, Shuffled, graphs, started, starts_for

PLUGINS = {entry.name: entry for entry in entry_points(group="mathnavi.consensus")}
LINE = Graph.line(NAMES[:3])


@pytest.fixture(params=sorted(PLUGINS), scope="module")
def plugin(request: pytest.FixtureRequest) -> type[ConsensusPlugin]:
    loaded: type[ConsensusPlugin] = load("consensus", request.param)
    return loaded


def built(plugin: type[ConsensusPlugin], graph: Graph) -> dict[str, Consensus]:
    return {name: checked_consensus(PluginSpec.with_fields(plugin), graph.neighbourhood(name)) for name in graph.names}


def outbox(plugin: type[ConsensusPlugin], graph: Graph, starts: Array, network: Network, rounds: int) -> Array:
    return exchanged(started(built(plugin, graph), starts), graph, network, rounds)


def radio(graph: Graph, seed: int, loss: float, delay: float) -> Network:
    rng = np.random.default_rng(seed)
    return LossyLinks(DelayedLinks(IdealNetwork(graph.names), 0.0, delay, rng), loss, 0.3, rng)


def test_the_built_in_ones_are_there() -> None:
    assert {"laplacian", "maximum", "clock"} <= set(names("consensus"))


def test_conforms_to_the_protocol(plugin: type[ConsensusPlugin]) -> None:
    part = built(plugin, LINE)["b"]
    assert isinstance(part, Consensus)
    assert math.isfinite(part.period)
    assert part.period > 0.0
    assert isinstance(plugin.within_starts, bool)
    assert not part.refused


def test_its_configuration_is_frozen_and_checks_itself(plugin: type[ConsensusPlugin]) -> None:
    config = plugin.Config()
    with pytest.raises(dataclasses.FrozenInstanceError):
        config.period = 1.0
    for period in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match=r"period = .*; allowed"):
            plugin.Config(period=period)


@settings(max_examples=10)
@given(graph=graphs(), seed=st.integers(0, 2**32 - 1))
def test_all_agree_on_a_connected_graph_without_loss(plugin: type[ConsensusPlugin], graph: Graph, seed: int) -> None:
    starts = starts_for(graph, seed)
    scaled = Graph(graph.names, graph.weights / graph.algebraic_connectivity)
    values = outbox(plugin, scaled, starts, IdealNetwork(graph.names), 600)
    assert np.ptp(values[-1]) <= 0.05 * np.ptp(starts)
    assert np.ptp(values[-1]) <= 0.6 * np.ptp(values[300]) + 1e-9


@settings(max_examples=10)
@given(graph=graphs(), seed=st.integers(0, 2**32 - 1), loss=st.floats(0.0, 0.6), delay=st.floats(0.0, 0.3))
def test_the_same_messages_give_the_same_values(
    plugin: type[ConsensusPlugin], graph: Graph, seed: int, loss: float, delay: float
) -> None:
    one, other = (outbox(plugin, graph, starts_for(graph, seed), radio(graph, seed, loss, delay), 30) for _ in range(2))
    np.testing.assert_array_equal(one, other)


@settings(max_examples=10)
@given(graph=graphs(), seed=st.integers(0, 2**32 - 1), delay=st.floats(0.05, 0.3))
def test_the_order_in_which_the_messages_of_a_round_arrive_does_not_matter(
    plugin: type[ConsensusPlugin], graph: Graph, seed: int, delay: float
) -> None:
    starts = starts_for(graph, seed)
    one, other = (
        outbox(plugin, graph, starts, Shuffled(radio(graph, seed, 0.0, delay), np.random.default_rng(order)), 30)
        for order in range(2)
    )
    np.testing.assert_array_equal(one, other)


@settings(max_examples=10)
@given(graph=graphs(), seed=st.integers(0, 2**32 - 1), loss=st.floats(0.0, 0.6), delay=st.floats(0.0, 0.3))
def test_where_it_says_so_the_values_stay_within_the_starts(
    plugin: type[ConsensusPlugin], graph: Graph, seed: int, loss: float, delay: float
) -> None:
    starts = starts_for(graph, seed)
    values = outbox(plugin, graph, starts, radio(graph, seed, loss, delay), 30)
    assert np.isfinite(values).all()
    if plugin.within_starts:
        assert starts.min() <= values.min()
        assert values.max() <= starts.max()


# ---- messages that no neighbour should send

numbers = st.one_of(st.floats(), st.integers(), st.none(), st.text(max_size=2), st.booleans(), st.just(10**400))


def spoilt(payload: Any, field: int, value: Any) -> Any:
    """The payload of a plug-in with one of its fields replaced, where it has fields."""
    if not dataclasses.is_dataclass(payload) or isinstance(payload, type):
        return value
    names_ = [each.name for each in dataclasses.fields(payload)]
    return dataclasses.replace(payload, **{names_[field % len(names_)]: value})


@pytest.mark.honoured("plug-in", "consensus: messages that are garbage, doubled or late")
@settings(max_examples=25)
@given(data=st.data())
def test_garbage_doubled_and_late_messages_raise_nothing_and_leave_a_finite_value(
    plugin: type[ConsensusPlugin], data: st.DataObject
) -> None:
    parts = built(plugin, LINE)
    started(parts, [100.0, 120.0, 90.0])
    messages: list[Message] = []
    for k in range(8):
        t = k * parts["a"].period
        received: list[Any] = [] if k == 0 else [m for m in messages if m.sender in ("a", "c")][-2:]
        for _ in range(data.draw(st.integers(0, 4))):
            old = data.draw(st.sampled_from(messages)) if messages else Message(0.0, "a", "", None)
            payload = spoilt(old.payload, data.draw(st.integers(0, 4)), data.draw(numbers))
            stamp = data.draw(st.one_of(st.just(old.t), st.floats(), st.floats(-1.0, 1.0)))
            sender = data.draw(st.sampled_from(["a", "b", "c", "z"]))
            bad: list[Any] = [old, None, 3.0, Message(stamp, sender, "", payload), Message(old.t, old.sender, "", 7)]
            received.append(data.draw(st.sampled_from(bad)))
        payloads = {"b": parts["b"].exchange(t, received)}
        payloads |= {name: parts[name].exchange(t, []) for name in ("a", "c")}
        messages += [Message(t, name, "consensus", payload) for name, payload in payloads.items()]
        assert math.isfinite(parts["b"].value)


def refused_for(part: Consensus, t: float, received: Sequence[Any]) -> int:
    """How many more messages are refused."""
    before = sum(part.refused.values())
    part.exchange(t, received)
    return sum(part.refused.values()) - before


def test_what_cannot_be_used_is_counted_by_why(plugin: type[ConsensusPlugin]) -> None:
    parts = started(built(plugin, LINE), [100.0, 120.0, 90.0])
    payload = parts["a"].exchange(0.0, [])
    part, t = parts["b"], 10.0
    part.exchange(t, [])
    value = part.value
    assert refused_for(part, t + 0.1, [Message(t + 1e6, "a", "", payload)]) == 1
    assert part.refused["from the future"] == 1
    assert refused_for(part, t + 0.2, [None, Message(math.nan, "a", "", payload), Message(t, "a", "", math.nan)]) == 3
    assert part.refused["garbage"] == 3
    assert refused_for(part, t + 0.3, [Message(t, "z", "", payload), Message(t, "b", "", payload)]) == 2
    assert part.refused["stranger"] == 2
    assert part.value == value
    good = Message(t + 0.35, "a", "", payload)
    assert refused_for(part, t + 0.4, [good, good]) == 1
    assert refused_for(part, t + 0.5, [good]) == 1
    assert part.refused["repeated or overtaken"] == 2


def test_a_vehicle_that_has_no_number_raises_nothing(plugin: type[ConsensusPlugin]) -> None:
    for number in (math.nan, math.inf, -math.inf):
        parts = started(built(plugin, LINE), [100.0, number, 90.0])
        values = exchanged(parts, LINE, IdealNetwork(LINE.names), 100)
        assert np.isfinite(values[2:]).all()
