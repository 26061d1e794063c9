"""Cases of the study ``consensus``: clocks that agree (Remark A.6), and outliers that follow (A.14)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.controllers.arrival.clock import ClockConfig, ClockConsensus
from mathnavi.controllers.arrival.laplacian import LaplacianConfig, LaplacianConsensus
from mathnavi.sim.engine.network import Addressed, DelayedLinks, IdealNetwork, single_messages
from mathnavi.sim.interfaces.protocols import Consensus
from mathnavi.sim.interfaces.signals import Array, Message
from mathnavi.sim.studies.fleet.consensus.exchange import exchanged, graph_of

FAR = 3  # which of the eight has another arrival time; in the middle of a line, so that without it two parts are left
_BACK = 3  # planning period at which its arrival time is as the others' again
PLANNING = 5.0 / 3.0  # [s]


# ---- clocks


@dataclass(frozen=True)
class ClockCase:
    """Delays [s] from a vehicle to the next and back, each with its spread."""

    name: str
    there: tuple[float, float]
    back: tuple[float, float]
    drift: float = 0.0  # of the clocks, at most
    rate_scaling: float = 0.0
    n: int = 8


@dataclass(frozen=True)
class ClockFound:
    """Differences between clocks before and after agreement."""

    first: float  # [s] by which the clocks differ at most
    last: float  # [s] by which the corrected ones do
    allowed: float  # [s] what the delays' asymmetry adds up to along the line


class _EachWay:
    """Delays of their own to vehicles that are later in the alphabet, and to earlier ones."""

    def __init__(self, network: IdealNetwork, case: ClockCase, rng: np.random.Generator) -> None:
        self._network = network
        self._there, self._back = (DelayedLinks(network, *span, rng) for span in (case.there, case.back))

    def send(self, messages: Sequence[Addressed], t: float) -> None:
        for receiver, message in single_messages(messages):
            (self._there if message.sender < receiver else self._back).send(((receiver, message),), t)

    def receive(self, receiver: str, t: float) -> list[Message]:
        return self._network.receive(receiver, t)


def clocks_agree(case: ClockCase) -> ClockFound:
    """Run clock consensus on a line, with clocks that are up to 5 s off and drift."""
    graph, period, seconds = graph_of("line", case.n), 0.01, 15.0
    rng = np.random.default_rng(3)
    offsets, drifts = rng.uniform(-5.0, 5.0, case.n), rng.uniform(-case.drift, case.drift, case.n)
    clocks = {
        name: (lambda t, o=float(offset), r=float(drift): t + o + r * t)
        for name, offset, drift in zip(graph.names, offsets, drifts, strict=True)
    }
    config = ClockConfig(period=period, scaling=25.0, rate_scaling=case.rate_scaling, baseline=1.0)
    parts: dict[str, Consensus] = {name: ClockConsensus(config, graph.node(name)) for name in graph.names}
    network = _EachWay(IdealNetwork(graph.names), case, rng)
    values = exchanged(parts, graph, network, round(seconds / period), clocks=clocks)
    shown = np.array([clocks[name](seconds) for name in graph.names])
    worst = max(abs(a - b) for a, b in ((case.there[0], case.back[1]), (case.there[1], case.back[0])))
    return ClockFound(float(np.ptp(shown)), float(np.ptp(shown + values[-1])), 0.5 * worst * (case.n - 1))


# ---- outliers


@dataclass(frozen=True)
class OutlierCase:
    """Number of rounds in a planning period, and whether the rule (A.14) is followed."""

    rounds: int  # in a planning period
    delta: float | None = 0.3  # None: everybody takes part
    steps: int = 5


@dataclass(frozen=True, eq=False)
class OutlierFound:
    """Values that the vehicles hold, with an outlier among them."""

    t: Array  # (k,) [s]
    values: Array  # (k, n) [s] eta, and the values that an outlier sends
    follows: Array  # (steps,) whether the far one is an outlier
    others: Array  # (steps,) [s] average of the others' starts
    agreed: Array  # (steps,) [s] average of what the others hold at the end
    spread: Array  # (steps,) [s] of what all hold at the end
    everybody: Array  # (steps,) [s] average of all starts


def with_outlier(case: OutlierCase) -> OutlierFound:
    """Eight vehicles on a line over some planning periods; each one's estimate falls as time passes."""
    graph, n = graph_of("line", 8), 8
    period = PLANNING / case.rounds
    delta = 1.0 if case.delta is None else case.delta  # with 1 the rule lets everything up to twice the own time pass
    config = LaplacianConfig(scaling=60.0, period=period, memory=1.5 * period, delta=delta)
    far = 220.0
    starts = 100.0 + np.random.default_rng(5).uniform(-10.0, 10.0, n)
    parts = {name: LaplacianConsensus(config, graph.node(name)) for name in graph.names}
    network = IdealNetwork(graph.names)
    found: list[tuple[Array, bool, float, float, float, float]] = []
    for step in range(case.steps):
        own = starts - PLANNING * step
        own[FAR] = (far if step < _BACK else 115.0) - PLANNING * step
        for part, eta in zip(parts.values(), own, strict=True):
            part.start(float(eta))
        values = exchanged(parts, graph, network, case.rounds - 1, begin=PLANNING * step)
        rest = np.delete(np.arange(n), FAR)
        follows = parts[graph.names[FAR]].outlier
        last = values[-1]
        found.append((values, follows, own[rest].mean(), last[rest].mean(), float(np.ptp(last)), own.mean()))
    blocks, follows_, others, agreed, spread, everybody = zip(*found, strict=True)
    t = period * np.arange(case.rounds * case.steps, dtype=np.float64)
    return OutlierFound(
        t,
        np.concatenate(blocks),
        *(np.array(each, dtype=np.float64) for each in (follows_, others, agreed, spread, everybody)),
    )
