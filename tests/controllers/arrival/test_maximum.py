"""Max-consensus rises to the maximum in as many rounds as the diameter, and never above the deadline."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.controllers.arrival.inbox import ConsensusPayload
from mathnavi.controllers.arrival.maximum import Maximum, MaximumConfig, MaximumConsensus
from mathnavi.interfaces.signals import Message
from mathnavi.models.fleet.graph import Graph
from mathnavi.sim.engine.network import DelayedLinks, IdealNetwork, LossyLinks
from mathnavi.studies.fleet.message_exchange import exchanged
from tests.fleet import Shuffled, graphs, maxima, started, starts_for


@settings(max_examples=40)
@given(graphs(), st.integers(0, 2**32 - 1))
def test_all_know_the_maximum_after_the_diameter_whatever_the_order_of_messages(graph: Graph, seed: int) -> None:
    starts = starts_for(graph, seed)
    network = Shuffled(IdealNetwork(graph.names), np.random.default_rng(seed))
    values = exchanged(started(maxima(graph, math.inf), starts), graph, network, int(graph.diameter))
    reached = graph.hops[int(starts.argmax())]
    for k in range(len(values)):
        np.testing.assert_array_equal(values[k] == starts.max(), reached <= k)


@settings(max_examples=20)
@given(graphs(), st.integers(0, 2**32 - 1), st.floats(0.0, 0.5))
def test_it_only_rises_and_arrives_in_spite_of_loss_delay_and_duplication(graph: Graph, seed: int, loss: float) -> None:
    starts, rng = starts_for(graph, seed), np.random.default_rng(seed)
    network = LossyLinks(DelayedLinks(IdealNetwork(graph.names), 0.0, 0.05, rng), loss, 0.3, rng)
    values = exchanged(started(maxima(graph, math.inf), starts), graph, network, 150)
    assert (np.diff(values, axis=0) >= 0.0).all()
    assert (values[-1] == starts.max()).all()


def test_a_vehicle_above_the_deadline_is_an_outlier_that_moves_nobody_and_comes_back() -> None:
    graph = Graph.line(("a", "b", "c"))
    parts = started(maxima(graph, 100.0), [80.0, 130.0, 90.0])
    network = IdealNetwork(graph.names)
    assert parts["b"].value == 100.0  # capped, while it knows nothing of the others
    values = exchanged(parts, graph, network, 5)
    np.testing.assert_array_equal(values[-1], 90.0)  # through the outlier
    outlier = parts["b"]
    assert isinstance(outlier, MaximumConsensus)
    assert outlier.outlier
    outlier.start(95.0)
    assert not outlier.outlier
    np.testing.assert_array_equal(exchanged(parts, graph, network, 5, begin=1.0)[-1], 95.0)


def test_it_says_that_it_is_an_outlier() -> None:
    part = MaximumConsensus(MaximumConfig(), Graph.line(("a", "b")).neighbourhood("a", deadline=100.0))
    part.start(101.0)
    assert part.exchange(0.0, []) == ConsensusPayload(None, 1.0, outlier=True)
    part.start(99.0)
    assert part.exchange(0.1, []) == ConsensusPayload(99.0, 1.0, outlier=False)
    part.start(70.0)
    assert part.value == 99.0  # it only rises


def test_a_value_above_the_deadline_is_refused_and_counted() -> None:
    part = MaximumConsensus(MaximumConfig(), Graph.line(("a", "b")).neighbourhood("a", deadline=100.0))
    part.start(80.0)
    part.exchange(1.0, [Message(0.5, "b", "", ConsensusPayload(100.5, 1.0))])
    assert part.value == 80.0
    assert part.refused == {"beyond the deadline": 1}


def test_a_deadline_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="deadline = nan"):
        Maximum.build(MaximumConfig(), Graph.line(("a", "b")).neighbourhood("a", deadline=math.nan))
