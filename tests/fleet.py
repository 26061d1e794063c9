"""Graphs and rounds for the tests of consensus."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from hypothesis import strategies as st

from mathnavi.controllers.arrival.laplacian import LaplacianConfig, LaplacianConsensus
from mathnavi.controllers.arrival.maximum import MaximumConfig, MaximumConsensus
from mathnavi.interfaces.protocols import Consensus
from mathnavi.interfaces.signals import Array, Message
from mathnavi.models.fleet.graph import Graph
from mathnavi.sim.engine.network import Addressed, Network

NAMES = ("a", "b", "c", "d", "e", "f", "g", "h")


class Shuffled:
    """Hands over what has arrived in any order."""

    def __init__(self, network: Network, rng: np.random.Generator) -> None:
        self._network, self._rng = network, rng

    def send(self, messages: Sequence[Addressed], t: float) -> None:
        self._network.send(messages, t)

    def receive(self, receiver: str, t: float) -> list[Message]:
        arrived = self._network.receive(receiver, t)
        return [arrived[k] for k in self._rng.permutation(len(arrived))]


@st.composite
def graphs(draw: st.DrawFn) -> Graph:
    """Connected ones of 2 to 8 vehicles, with weights over two decades."""
    n, chance = draw(st.integers(2, 8)), draw(st.sampled_from([0.0, 0.3, 1.0]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return Graph.random_connected(NAMES[:n], chance, rng, 0.1, 10.0)


def starts_for(graph: Graph, seed: int) -> Array:
    return np.random.default_rng(seed).uniform(-100.0, 200.0, len(graph.names))


def started(parts: Mapping[str, Consensus], starts: Sequence[float] | Array) -> Mapping[str, Consensus]:
    for part, start in zip(parts.values(), starts, strict=True):
        part.start(float(start))
    return parts


def laplacians(graph: Graph, config: LaplacianConfig) -> dict[str, Consensus]:
    return {name: LaplacianConsensus(config, graph.neighbourhood(name)) for name in graph.names}


def maxima(graph: Graph, deadline: float) -> dict[str, Consensus]:
    return {
        name: MaximumConsensus(MaximumConfig(), graph.neighbourhood(name, deadline=deadline)) for name in graph.names
    }
