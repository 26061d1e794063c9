"""Vehicles that exchange messages in rounds over a network: the fast time scale of A.8.2, without dynamics.

The study ``consensus`` uses it for the rate of the Laplacian protocol, with delays, on links that switch or lose
messages; for the agreement of clocks (Remark A.6); and for outliers that follow (A.14).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle, islice
from typing import Any, Literal

import numpy as np
from scipy.special import lambertw

from mathnavi.controllers.arrival.clock import ClockConfig, ClockConsensus
from mathnavi.controllers.arrival.laplacian import LaplacianConfig, LaplacianConsensus
from mathnavi.controllers.arrival.maximum import MaximumConfig, MaximumConsensus
from mathnavi.interfaces.protocols import Consensus
from mathnavi.interfaces.signals import Array, Message
from mathnavi.models.fleet.graph import Graph, Switching
from mathnavi.sim.engine.network import (
    Addressed,
    DelayedLinks,
    IdealNetwork,
    Linked,
    LossyLinks,
    Network,
    single_messages,
)

H = 1.0 / 60.0  # [s] of a round, where nothing else is said
PLANNING = 5.0 / 3.0  # [s] of a planning period
Kind = Literal["line", "ring", "complete", "random"]
KINDS: tuple[Kind, ...] = ("line", "ring", "complete", "random")
_FINE, SLOW = 0.25, 0.04  # s h d_max and s h lambda_2 at most, so that rounds are nearly continuous time
LOSS = 0.2
_STAY = 12  # rounds on one graph
FAR = 3  # which of the eight has another arrival time; in the middle of a line, so that without it two parts are left
_BACK = 3  # planning period at which its arrival time is as the others' again


def names_of(n: int) -> tuple[str, ...]:
    """Return the names vehicle-00, vehicle-01, ..."""
    return tuple(f"vehicle-{k:02d}" for k in range(n))


def graph_of(kind: Kind, n: int, seed: int = 0) -> Graph:
    """Return a connected graph; a random one has weights from 0.5 to 2."""
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
    """Return the values (rounds + 1, n) after each round, the first at ``begin`` [s].

    In a round every vehicle processes the messages that have arrived, and then sends to its present neighbours in the
    graph. ``clocks`` map the true time [s] to the clock of each vehicle, which stamps its messages.
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
    """Start the Laplacian protocol in each vehicle of a graph, and return the protocols by name."""
    config = LaplacianConfig(**fields)
    parts: dict[str, Consensus] = {name: LaplacianConsensus(config, graph.neighbourhood(name)) for name in graph.names}
    for part, start in zip(parts.values(), starts, strict=True):
        part.start(float(start))
    return parts


def disagreement(values: Array) -> Array:
    """Return the Euclidean distance (k,) of the values (k, n) from their average."""
    distance: Array = np.linalg.norm(values - values.mean(axis=1, keepdims=True), axis=1)
    return distance


def slope(t: Array, size: Array) -> float:
    """Return the slope [1/s] of log ``size`` over ``t`` [s] by least squares."""
    return float(np.polyfit(t, np.log(size), 1)[0])


def moved(values: Array) -> float:
    """Return how far the average of the values (k, n) has moved, divided by the first disagreement."""
    return float(abs(values[-1].mean() - values[0].mean()) / disagreement(values)[0])


# ---- the rate on one graph


@dataclass(frozen=True)
class RateCase:
    """A graph, and the step of the protocol on it."""

    kind: Kind
    n: int
    seed: int
    amount: float = 0.0  # s h d_max; 0: so small that rounds are nearly continuous time


def rate_on(case: RateCase) -> dict[str, Any]:
    """A job: row of a graph, with its decay from the slowest mode with a tenth of noise, over the scaling.

    ``off`` is the error of the rate relative to ``lambda_2``, ``above`` the largest disagreement from a random start
    over exp(-s lambda_2 t), less 1, and ``average_moved`` the shift of the average over the first disagreement.
    """
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
    rate = -slope(t[tail], size[tail]) / s
    return {
        "graph": case.kind, "vehicles": case.n, "seed": case.seed, "lambda_2": second, "rate": rate,
        "off": rate / second - 1.0, "average_moved": moved(values), "diameter": int(graph.diameter),
        "rounds_to_maximum": _rounds_to_maximum(graph, rng), "above": float(bound.max()) - 1.0,
    }  # fmt: skip


def _rounds_to_maximum(graph: Graph, rng: np.random.Generator) -> int:
    parts: dict[str, Consensus] = {
        name: MaximumConsensus(MaximumConfig(), graph.neighbourhood(name)) for name in graph.names
    }
    starts = rng.uniform(50.0, 150.0, len(parts))
    for part, start in zip(parts.values(), starts, strict=True):
        part.start(float(start))
    values = exchanged(parts, graph, IdealNetwork(graph.names), int(graph.diameter) + 1)
    return int(np.flatnonzero((values == starts.max()).all(axis=1))[0])


# ---- delays


@dataclass(frozen=True)
class DelayCase:
    """Delay as a multiple of the bound pi / (2 s lambda_n)."""

    fraction: float
    own: Literal["now", "then"]
    n: int = 8


def delayed(case: DelayCase) -> dict[str, Any]:
    """A job: consensus on a random graph, with the same delay on every link.

    ``t`` (k,) is the time over the bound, ``size`` (k,) the disagreement over the first, ``rate`` the decay over s, and
    ``predicted`` that by the roots of z + s lambda exp(-z tau) = 0; NaN where only the neighbours are delayed.
    """
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
    return {
        "fraction": case.fraction, "own": case.own, "t": t / bound, "size": size / size[0],
        "rate": -slope(t[: len(envelope)][tail], envelope[tail]) / s,
        "predicted": -dominant.real / s if case.own == "then" else math.nan, "average_moved": moved(values),
    }  # fmt: skip


# ---- switching and loss


@dataclass(frozen=True)
class LinkCase:
    """Links that change, or lose messages."""

    name: Literal["switching", "matchings", "loss"]
    seed: int
    n: int = 8


def over_links(case: LinkCase) -> dict[str, Any]:
    """A job: consensus on links that switch among connected graphs, or between two unconnected ones, or lose messages.

    ``t`` (k,) is s times the time, ``size`` (k,) the disagreement over the first, ``rate`` the decay over s,
    ``reference`` the lambda_2 that it is held against, and ``least`` the slowest decay over any one graph's stay.
    """
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
    rate, least = -slope(t[tail], size[tail]) / s, float(-stays.max()) / s
    return {
        "links": case.name, "t": s * t, "size": size / size[0], "rate": rate, "reference": reference, "least": least,
        "average_moved": moved(values),
    }  # fmt: skip


def _alternating(graphs: Sequence[Graph], stay: int) -> Switching:
    """Return a graph that cycles through ``graphs``, each for ``stay`` rounds; it changes between two rounds."""
    return Switching(tuple((H * (stay * k - 0.5), graph) for k, graph in enumerate(islice(cycle(graphs), 1000))))


# ---- clocks


@dataclass(frozen=True)
class ClockCase:
    """Delays [s] from a vehicle to the next and back, each as (least, largest)."""

    name: str
    there: tuple[float, float]
    back: tuple[float, float]
    drift: float = 0.0  # of the clocks, at most
    rate_scaling: float = 0.0
    n: int = 8


class _EachWay:
    """Network with different delays to vehicles that are later in the alphabet and to earlier ones."""

    def __init__(self, network: IdealNetwork, case: ClockCase, rng: np.random.Generator) -> None:
        self._network = network
        self._there, self._back = (DelayedLinks(network, *span, rng) for span in (case.there, case.back))

    def send(self, messages: Sequence[Addressed], t: float) -> None:
        for receiver, message in single_messages(messages):
            (self._there if message.sender < receiver else self._back).send(((receiver, message),), t)

    def receive(self, receiver: str, t: float) -> list[Message]:
        return self._network.receive(receiver, t)


def clocks_agree(case: ClockCase) -> dict[str, Any]:
    """A job: clock consensus on a line, with clocks that are up to 5 s off and drift.

    ``first`` and ``last`` [s] are the largest differences of the clocks and of the corrected ones, and ``allowed`` [s]
    is what the delays' asymmetry adds up to along the line.
    """
    graph, period, seconds = graph_of("line", case.n), 0.01, 15.0
    rng = np.random.default_rng(3)
    offsets, drifts = rng.uniform(-5.0, 5.0, case.n), rng.uniform(-case.drift, case.drift, case.n)
    clocks = {
        name: (lambda t, o=float(offset), r=float(drift): t + o + r * t)
        for name, offset, drift in zip(graph.names, offsets, drifts, strict=True)
    }
    config = ClockConfig(period=period, scaling=25.0, rate_scaling=case.rate_scaling, baseline=1.0)
    parts: dict[str, Consensus] = {name: ClockConsensus(config, graph.neighbourhood(name)) for name in graph.names}
    network = _EachWay(IdealNetwork(graph.names), case, rng)
    values = exchanged(parts, graph, network, round(seconds / period), clocks=clocks)
    shown = np.array([clocks[name](seconds) for name in graph.names])
    worst = max(abs(a - b) for a, b in ((case.there[0], case.back[1]), (case.there[1], case.back[0])))
    first, last = float(np.ptp(shown)), float(np.ptp(shown + values[-1]))
    return {"delays": case.name, "first": first, "last": last, "allowed": 0.5 * worst * (case.n - 1)}


# ---- outliers


@dataclass(frozen=True)
class OutlierCase:
    """Number of rounds in a planning period, and whether the rule (A.14) is followed."""

    rounds: int  # in a planning period
    delta: float | None = 0.3  # None: everybody takes part
    steps: int = 5


def with_outlier(case: OutlierCase) -> dict[str, Any]:
    """A job: eight vehicles on a line over some planning periods, in which the estimates decrease with time.

    ``values`` (k, n) [s] are eta, and the values that an outlier sends, at the times ``t`` (k,) [s]. By planning
    period: whether the far one ``follows``, the average [s] of the ``others``' starts, the average [s] on which they
    ``agreed`` at the end, the ``spread`` [s] of all there, and the average [s] of ``everybody``'s starts. ``shift`` [s]
    is that of the others' agreement from their average in the first period in which the outlier follows.
    """
    graph, n = graph_of("line", 8), 8
    period = PLANNING / case.rounds
    delta = 1.0 if case.delta is None else case.delta  # with 1 the rule lets everything up to twice the own time pass
    config = LaplacianConfig(scaling=60.0, period=period, memory=1.5 * period, delta=delta)
    far = 220.0
    starts = 100.0 + np.random.default_rng(5).uniform(-10.0, 10.0, n)
    parts = {name: LaplacianConsensus(config, graph.neighbourhood(name)) for name in graph.names}
    network = IdealNetwork(graph.names)
    found: list[tuple[Array, bool, float, float, float, float]] = []
    for step in range(case.steps):
        own = starts - PLANNING * step
        own[FAR] = (far if step < _BACK else 115.0) - PLANNING * step
        for part, eta in zip(parts.values(), own, strict=True):
            part.start(float(eta))
        values = exchanged(parts, graph, network, case.rounds - 1, begin=PLANNING * step)
        rest = np.delete(np.arange(n), FAR)
        outlier = parts[graph.names[FAR]].outlier
        last = values[-1]
        found.append((values, outlier, own[rest].mean(), last[rest].mean(), float(np.ptp(last)), own.mean()))
    blocks, follows, *by_step = zip(*found, strict=True)
    others, agreed, spread, everybody = (np.array(each, dtype=np.float64) for each in by_step)
    return {
        "rounds": case.rounds, "delta": case.delta,
        "t": period * np.arange(case.rounds * case.steps, dtype=np.float64), "values": np.concatenate(blocks),
        "follows": list(follows), "others": others, "agreed": agreed, "spread": spread,
        "everybody": everybody, "shift": float(agreed[1] - others[1]),
    }  # fmt: skip
