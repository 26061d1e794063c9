"""Message passing between vehicles that know of each other only what is communicated.

``Network`` delivers at once; around it stand wrappers for what a radio does: who hears whom, delay, loss, duplication
and partition. Every wrapper draws from a generator that is passed in, so a run with them is as reproducible as one
without. A message says when it was sent; when it arrives is the network's to know.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import Protocol

import numpy as np

from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.interfaces.bounds import NonNegative, configuration
from mathnavi.sim.interfaces.checks import check, check_names
from mathnavi.sim.interfaces.errors import ArgumentError
from mathnavi.sim.interfaces.signals import Message

Addressed = tuple[str | tuple[str, ...], Message]
"""receiver, or several receivers, and message"""

_ARRIVAL = itemgetter(0)


class Network(Protocol):
    """A carrier of messages."""

    def send(self, messages: Sequence[Addressed], t: float) -> None:
        """Take messages that set out at t [s], in this order."""
        ...

    def receive(self, receiver: str, t: float) -> list[Message]:
        """Messages that arrived by t [s] and were not received before, in the order of arrival."""
        ...


def single_messages(messages: Sequence[Addressed]) -> list[tuple[str, Message]]:
    """Messages with one receiver each, in their order."""
    return [(receiver, message) for to, message in messages for receiver in (to if isinstance(to, tuple) else (to,))]


class IdealNetwork:
    """Delivers to everyone at once."""

    def __init__(self, names: Sequence[str]) -> None:
        """``names`` of all vehicles; ValueError if one is there twice."""
        self._underway: dict[str, list[tuple[float, Message]]] = {name: [] for name in check_names(names)}
        """by receiver: when each arrives [s], and the message"""
        self._broadcast: dict[str, Addressed] = {}  # by sender: the last message to several

    def send(self, messages: Sequence[Addressed], t: float) -> None:
        """Take messages; one to several that its sender repeats as it is, is delivered once, for here none is lost.

        ArgumentError for a receiver that is none.
        """
        underway = self._underway
        arrival: tuple[float, Message] | None = None
        for to, message in messages:
            if isinstance(to, tuple):
                before = self._broadcast.get(message.sender)
                if before is not None and before[0] is to and before[1] is message:
                    continue
                self._broadcast[message.sender] = to, message
            if arrival is None or arrival[1] is not message:
                arrival = t, message  # one for all who receive it
            for receiver in to if isinstance(to, tuple) else (to,):
                if receiver not in underway:
                    raise ArgumentError(f"receiver = {receiver!r}; allowed: {', '.join(underway)}")
                underway[receiver].append(arrival)

    def receive(self, receiver: str, t: float) -> list[Message]:
        held = self._underway[receiver]
        held.sort(key=_ARRIVAL)  # stable: what arrives at once arrives in the order in which it was sent
        arrived = bisect_right(held, t + TIME_TOLERANCE, key=_ARRIVAL)
        self._underway[receiver] = held[arrived:]
        return [message for _, message in held[:arrived]]


class Linked:
    """Only what has a link comes through: ``linked(sender, receiver, t)``, which may change with time."""

    def __init__(self, network: Network, linked: Callable[[str, str, float], bool]) -> None:
        self._network, self._linked = network, linked

    def send(self, messages: Sequence[Addressed], t: float) -> None:
        linked = self._linked
        self._network.send([each for each in single_messages(messages) if linked(each[1].sender, each[0], t)], t)

    def receive(self, receiver: str, t: float) -> list[Message]:
        return self._network.receive(receiver, t)


def within_range(network: Network, distance: Callable[[str, str], float], reach: float) -> Linked:
    """The network of radios that are heard up to ``reach`` [m]; ``distance(sender, receiver)`` [m] is that of now."""
    check(reach, "reach", 0.0, open_low=True)
    return Linked(network, lambda sender, receiver, t: distance(sender, receiver) <= reach)


class DelayedLinks:
    """Every message takes between ``least`` and ``most`` [s], uniformly drawn: one may overtake another."""

    def __init__(self, network: Network, least: float, most: float, rng: np.random.Generator) -> None:
        check(least, "least delay", 0.0)
        check(most, "most delay", least)
        self._network, self._least, self._most, self._rng = network, least, most, rng

    def send(self, messages: Sequence[Addressed], t: float) -> None:
        single = single_messages(messages)
        delays: list[float] = self._rng.uniform(self._least, self._most, len(single)).tolist()
        for each, delay in zip(single, delays, strict=True):
            self._network.send((each,), t + delay)

    def receive(self, receiver: str, t: float) -> list[Message]:
        return self._network.receive(receiver, t)


class LossyLinks:
    """A fraction ``loss`` of the messages is lost, and a fraction ``duplication`` of the rest arrives twice."""

    def __init__(self, network: Network, loss: float, duplication: float, rng: np.random.Generator) -> None:
        check(loss, "loss", 0.0, 1.0)
        check(duplication, "duplication", 0.0, 1.0)
        self._network, self._loss, self._duplication, self._rng = network, loss, duplication, rng

    def send(self, messages: Sequence[Addressed], t: float) -> None:
        single = single_messages(messages)
        lost, doubled = (self._rng.random((len(single), 2)) < (self._loss, self._duplication)).T
        copies: list[int] = np.where(lost, 0, np.where(doubled, 2, 1)).tolist()
        self._network.send([each for each, count in zip(single, copies, strict=True) for _ in range(count)], t)

    def receive(self, receiver: str, t: float) -> list[Message]:
        return self._network.receive(receiver, t)


@configuration
class Partition:
    """From ``begin`` to ``end`` [s] nothing passes between those named and all others."""

    begin: NonNegative
    end: float
    apart: frozenset[str]

    def __post_init__(self) -> None:
        check(self.end, "end", self.begin)

    def passes(self, sender: str, receiver: str, t: float) -> bool:
        """True if a message sent at t [s] gets through."""
        between = (sender in self.apart) != (receiver in self.apart)
        return not (between and self.begin <= t < self.end)


def partitioned(network: Network, partitions: Sequence[Partition]) -> Linked:
    """The network with these partitions."""
    return Linked(network, lambda sender, receiver, t: all(p.passes(sender, receiver, t) for p in partitions))
