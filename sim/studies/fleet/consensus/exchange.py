"""Vehicles that exchange messages in rounds over a network: the fast time scale of A.8.2 alone, on which no plant
flies."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from mathnavi.controllers.arrival.laplacian import LaplacianConfig, LaplacianConsensus
from mathnavi.models.fleet.graph import Graph
from mathnavi.models.fleet.switching import Switching
from mathnavi.sim.engine.network import Linked, Network
from mathnavi.sim.interfaces.protocols import Consensus
from mathnavi.sim.interfaces.signals import Array, Message

H = 1.0 / 60.0  # [s] of a round, where nothing else is said
Kind = Literal["line", "ring", "complete", "random"]
KINDS: tuple[Kind, ...] = ("line", "ring", "complete", "random")


def names_of(n: int) -> tuple[str, ...]:
    """vehicle-00, vehicle-01, ..."""
    return tuple(f"vehicle-{k:02d}" for k in range(n))


def graph_of(kind: Kind, n: int, seed: int = 0) -> Graph:
    """A connected graph; a random one has weights from .5 to 2."""
    if kind == "random":
        return Graph.random_connected(names_of(n), 0.3, np.random.default_rng([n, seed]), 0.5, 2.0)
    return {"line": Graph.line, "ring": Graph.ring, "complete": Graph.complete}[kind](names_of(n))


def exchanged(
    parts: Mapping[str, Consensus],
    graph: Graph | Switching,
    network: Network,
    rounds: int,
    begin: float = 0.0,
    clocks: Mapping[str, Callable[[float], float]] | None = None,
) -> Array:
    """(rounds + 1, n) values after each round, the first at ``begin`` [s].

    In a round every vehicle processes the messages that have arrived, and then sends to its present neighbours in the
    graph. ``clocks`` map the true time [s] to each vehicle's own, with which its messages are stamped.
    """
    network = Linked(network, graph.linked) if isinstance(graph, Switching) else network
    union = graph.union if isinstance(graph, Switching) else graph
    receivers = {name: union.neighbours(name) for name in parts}
    period = next(iter(parts.values())).period
    values = np.empty((rounds + 1, len(parts)))
    for k in range(rounds + 1):
        t = begin + k * period
        shown = {name: clocks[name](t) if clocks else t for name in parts}
        sent = {name: part.exchange(shown[name], network.receive(name, t)) for name, part in parts.items()}
        values[k] = [part.value for part in parts.values()]
        for name, payload in sent.items():
            message = Message(shown[name], name, "consensus", payload)
            network.send([(receiver, message) for receiver in receivers[name]], t)
    return values


def laplacians(graph: Graph | Switching, starts: Sequence[float] | Array, **fields: Any) -> dict[str, Consensus]:
    """A vehicle each with the Laplacian protocol, started."""
    config = LaplacianConfig(**fields)
    parts: dict[str, Consensus] = {name: LaplacianConsensus(config, graph.node(name)) for name in graph.names}
    for part, start in zip(parts.values(), starts, strict=True):
        part.start(float(start))
    return parts


def disagreement(values: Array) -> Array:
    """(k,) Euclidean distance of the values (k, n) from their average."""
    distance: Array = np.linalg.norm(values - values.mean(axis=1, keepdims=True), axis=1)
    return distance


def slope(t: Array, size: Array) -> float:
    """[1/s] of log size by least squares."""
    return float(np.polyfit(t, np.log(size), 1)[0])
