"""Cases of the study ``consensus``: rate of the Laplacian protocol, delays, links that switch or lose messages."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle, islice
from typing import Literal

import numpy as np
from scipy.special import lambertw

from mathnavi.controllers.arrival.maximum import MaximumConfig, MaximumConsensus
from mathnavi.models.fleet.graph import Graph
from mathnavi.models.fleet.switching import Switching
from mathnavi.sim.engine.network import DelayedLinks, IdealNetwork, LossyLinks, Network
from mathnavi.sim.interfaces.protocols import Consensus
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.studies.fleet.consensus.exchange import (
    H,
    Kind,
    disagreement,
    exchanged,
    graph_of,
    laplacians,
    names_of,
    slope,
)

_FINE, SLOW = 0.25, 0.04  # s h d_max and s h lambda_2 at most, so that rounds are nearly continuous time
LOSS = 0.2
_STAY = 12  # rounds on one graph


# ---- the rate on one graph


@dataclass(frozen=True)
class RateCase:
    """A graph, and the step of the protocol on it."""

    kind: Kind
    n: int
    seed: int
    amount: float = 0.0  # s h d_max; 0: so small that rounds are nearly continuous time


@dataclass(frozen=True, eq=False)
class RateFound:
    """Measured rate of consensus on one graph."""

    connectivity: float  # lambda_2
    rate: float  # measured over the scaling
    above: float  # largest disagreement from a random start over exp(-s lambda_2 t), less 1
    moved: float  # of the average, over the first disagreement
    diameter: int
    rounds_to_maximum: int


def rate_on(case: RateCase) -> RateFound:
    """The decay of log disagreement, started in the slowest mode and a tenth of noise; and max-consensus beside it."""
    graph = graph_of(case.kind, case.n, case.seed)
    second = graph.algebraic_connectivity
    valency = float(graph.weights.sum(axis=1).max())
    s = (case.amount / valency if case.amount else min(_FINE / valency, SLOW / second)) / H
    rng = np.random.default_rng([case.n, case.seed, 1])
    slowest = np.linalg.eigh(graph.laplacian)[1][:, 1]
    rounds = max(math.ceil(5.0 / (s * second * H)), 12)
    starts = 100.0 + 10.0 * (slowest + 0.1 * rng.standard_normal(case.n) / math.sqrt(case.n))
    values = exchanged(laplacians(graph, starts, scaling=s), graph, IdealNetwork(graph.names), rounds)
    size, t = disagreement(values), H * np.arange(rounds + 1)
    tail = t >= 0.4 * t[-1]
    drawn = exchanged(
        laplacians(graph, rng.uniform(50, 150, case.n), scaling=s), graph, IdealNetwork(graph.names), rounds // 2
    )
    bound = disagreement(drawn) / disagreement(drawn)[0] * np.exp(s * second * t[: len(drawn)])
    return RateFound(
        second,
        -slope(t[tail], size[tail]) / s,
        float(bound.max()) - 1.0,
        float(abs(values[-1].mean() - values[0].mean()) / size[0]),
        int(graph.diameter),
        _rounds_to_maximum(graph, rng),
    )


def _rounds_to_maximum(graph: Graph, rng: np.random.Generator) -> int:
    parts: dict[str, Consensus] = {name: MaximumConsensus(MaximumConfig(), graph.node(name)) for name in graph.names}
    starts = rng.uniform(50.0, 150.0, len(parts))
    for part, start in zip(parts.values(), starts, strict=True):
        part.start(float(start))
    values = exchanged(parts, graph, IdealNetwork(graph.names), int(graph.diameter) + 1)
    return int(np.flatnonzero((values == starts.max()).all(axis=1))[0])


# ---- delays


@dataclass(frozen=True)
class DelayCase:
    """A delay, as a multiple of the bound pi / (2 s lambda_n)."""

    fraction: float
    own: Literal["now", "then"]
    n: int = 8


@dataclass(frozen=True, eq=False)
class DelayFound:
    """Disagreement over time with a delay on every link."""

    t: Array  # (k,) over the bound
    size: Array  # (k,) disagreement, over the first
    rate: float  # measured decay over s
    predicted: float  # by the roots of z + s lambda exp(-z tau) = 0; NaN where only the neighbours are delayed
    moved: float  # of the average, over the first disagreement


def delayed(case: DelayCase) -> DelayFound:
    """Run consensus on a random graph, with the same delay on every link."""
    graph = graph_of("random", case.n)
    s = 0.05 / (graph.eigenvalues[-1] * H)
    bound = math.pi / (2.0 * s * graph.eigenvalues[-1])  # [s]
    tau = H * round(case.fraction * bound / H)
    rounds = math.ceil(30.0 * bound / H)
    rng = np.random.default_rng(case.n)
    modes = np.linalg.eigh(graph.laplacian)[1]
    starts = 100.0 + 30.0 * (modes[:, 1] + modes[:, -1]) + 0.1 * rng.standard_normal(case.n)  # one of them dominates
    parts = laplacians(graph, starts, scaling=s, own=case.own, memory=tau + 2.0 * H)
    values = exchanged(parts, graph, DelayedLinks(IdealNetwork(graph.names), tau, tau, rng), rounds)
    size, t = disagreement(values), H * np.arange(rounds + 1)
    held = tau - 0.5 * H  # [s] a value is used for a round from its arrival on, so it is as old as this on average
    roots = [complex(lambertw(-s * value * held)) / held for value in graph.eigenvalues[1:]]
    dominant = max(roots, key=lambda z: z.real)
    swing = min(rounds // 4, math.ceil(math.pi / max(abs(dominant.imag), 1e-9) / H))  # rounds of half a swing
    envelope = np.array([size[k : k + swing].max() for k in range(rounds + 1 - swing)])
    tail = slice(rounds // 3, None) if case.own == "then" else slice(rounds // 3, rounds - swing)
    return DelayFound(
        t / bound,
        size / size[0],
        -slope(t[: len(envelope)][tail], envelope[tail]) / s,
        -dominant.real / s if case.own == "then" else math.nan,
        float(abs(values[-1].mean() - values[0].mean()) / size[0]),
    )


# ---- switching and loss


@dataclass(frozen=True)
class LinkCase:
    """Links that change, or lose messages."""

    name: Literal["switching", "matchings", "loss"]
    seed: int
    n: int = 8


@dataclass(frozen=True, eq=False)
class LinkFound:
    """Disagreement over time on links that change or lose messages."""

    t: Array  # (k,) [s] times s
    size: Array  # (k,) disagreement, over the first
    rate: float  # measured over s
    reference: float  # lambda_2 that it is held against
    least: float  # slowest decay over any one graph's stay, over s
    moved: float  # of the average, over the first disagreement


def over_links(case: LinkCase) -> LinkFound:
    """Switching among connected graphs; among two of which neither is connected; and a ring that loses messages."""
    names = names_of(case.n)
    ring, line, complete = Graph.ring(names), Graph.line(names), Graph.complete(names)
    s, rounds = 0.04 / H, 240 if case.name == "switching" else 720
    rng = np.random.default_rng([case.seed, 7])
    network: Network = IdealNetwork(names)
    graph: Graph | Switching = ring
    memory, stay, reference = 0.25, _STAY, ring.algebraic_connectivity
    if case.name == "switching":
        graph, memory, reference = _alternating((line, ring, complete), _STAY), 1.5 * H, line.algebraic_connectivity
    elif case.name == "matchings":
        pairs = [(names[k], names[(k + 1) % case.n]) for k in range(case.n)]
        halves = tuple(Graph.from_edges(names, dict.fromkeys(pairs[k::2], 1.0)) for k in range(2))
        graph, memory = _alternating(halves, 2), 1.5 * H
        reference = 0.5 * ring.algebraic_connectivity  # of the mean of the two
        stay = 4
    else:
        network = LossyLinks(network, LOSS, 0.0, rng)
    graph.checked_connected()
    starts = 100.0 + 10.0 * np.linalg.eigh(line.laplacian)[1][:, 1] + rng.standard_normal(case.n)
    values = exchanged(laplacians(graph, starts, scaling=s, memory=memory), graph, network, rounds)
    size, t = disagreement(values), H * np.arange(rounds + 1)
    heard = size > 1e-9 * size[0]  # what is left is rounding
    size, t = size[heard], t[heard]
    tail = t >= 0.3 * t[-1]
    stays = np.diff(np.log(size[1::stay])) / (stay * H)  # what is sent first is taken in with the second round
    moved = float(abs(values[-1].mean() - values[0].mean()) / disagreement(values)[0])
    return LinkFound(s * t, size / size[0], -slope(t[tail], size[tail]) / s, reference, float(-stays.max()) / s, moved)


def _alternating(graphs: Sequence[Graph], stay: int) -> Switching:
    """Switch between graphs, each for ``stay`` rounds, over and over; it changes between two rounds."""
    return Switching(tuple((H * (stay * k - 0.5), graph) for k, graph in enumerate(islice(cycle(graphs), 1000))))
