"""Message passing between vehicles that know of each other only what is communicated.

``IdealNetwork`` delivers at once; wrappers around it model the effects of radio: range, delay, loss, duplication
and partition. Every wrapper draws from a generator that is passed to it, so a run with them is as reproducible as one
without. A message carries its time of sending; only the network knows its time of arrival.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import Protocol

import numpy as np

from mathnavi.interfaces.bounds import NonNegative, configuration
from mathnavi.interfaces.checks import check, check_names
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Message
from mathnavi.models.tolerances import TIME_TOLERANCE

Addressed = tuple[str | tuple[str, ...], Message]
"""pair of a receiver, or several receivers, and a message"""

_ARRIVAL = itemgetter(0)


class Network(Protocol):
    """Network that carries messages."""

    def send(self, messages: Sequence[Addressed], t: float) -> None:
        """Accept messages that are sent at t [s], in this order."""
        ...

    def receive(self, receiver: str, t: float) -> list[Message]:
        """Return the messages that arrived by t [s] and were not received before, in the order of arrival."""
        ...


def single_messages(messages: Sequence[Addressed]) -> list[tuple[str, Message]]:
    """Return messages with one receiver each, in their order."""
    return [(receiver, message) for to, message in messages for receiver in (to if isinstance(to, tuple) else (to,))]


class IdealNetwork:
    """Network that delivers to every receiver at once."""

    def __init__(self, names: Sequence[str]) -> None:
        """Begin with the ``names`` of all vehicles; ValueError if one is there twice."""
        self._underway: dict[str, list[tuple[float, Message]]] = {name: [] for name in check_names(names)}
        """messages under way by receiver: the time of arrival [s] of each, and the message"""
        self._broadcast: dict[str, Addressed] = {}  # by sender: the last message to several

    def send(self, messages: Sequence[Addressed], t: float) -> None:
        """Accept messages; one to several receivers that its sender repeats unchanged is delivered once, as none is
        lost.

        Raises ArgumentError for an unknown receiver.
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
                arrival = t, message  # one for all receivers
            for receiver in to if isinstance(to, tuple) else (to,):
                if receiver not in underway:
                    raise ArgumentError(f"receiver = {receiver!r}; allowed: {', '.join(underway)}")
                underway[receiver].append(arrival)

    def receive(self, receiver: str, t: float) -> list[Message]:
        held = self._underway[receiver]
        held.sort(key=_ARRIVAL)  # stable: messages that arrive at the same time keep the order in which they were sent
        arrived = bisect_right(held, t + TIME_TOLERANCE, key=_ARRIVAL)
        self._underway[receiver] = held[arrived:]
        return [message for _, message in held[:arrived]]


class Linked:
    """Network in which only linked vehicles communicate: ``linked(sender, receiver, t)`` may change with time."""

    def __init__(self, network: Network, linked: Callable[[str, str, float], bool]) -> None:
        self._network, self._linked = network, linked

    def send(self, messages: Sequence[Addressed], t: float) -> None:
        linked = self._linked
        self._network.send([each for each in single_messages(messages) if linked(each[1].sender, each[0], t)], t)

    def receive(self, receiver: str, t: float) -> list[Message]:
        return self._network.receive(receiver, t)


def within_range(network: Network, distance: Callable[[str, str], float], reach: float) -> Linked:
    """Return network of radios with the range ``reach`` [m]; ``distance(sender, receiver)`` [m] is the present one."""
    check(reach, "reach", 0.0, open_low=True)
    return Linked(network, lambda sender, receiver, t: distance(sender, receiver) <= reach)


class DelayedLinks:
    """Network in which every message takes between ``least`` and ``most`` [s], uniformly drawn: one may overtake
    another.
    """

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
    """Network in which a fraction ``loss`` of the messages is lost, and a fraction ``duplication`` of the rest arrives
    twice."""

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
    """Partition: from ``begin`` to ``end`` [s] no message passes between the named vehicles and all others."""

    begin: NonNegative
    end: float
    apart: frozenset[str]

    def __post_init__(self) -> None:
        check(self.end, "end", self.begin)

    def passes(self, sender: str, receiver: str, t: float) -> bool:
        """Return True if a message sent at t [s] passes."""
        between = (sender in self.apart) != (receiver in self.apart)
        return not (between and self.begin <= t < self.end)


def partitioned(network: Network, partitions: Sequence[Partition]) -> Linked:
    """Return the network with these partitions."""
    return Linked(network, lambda sender, receiver, t: all(p.passes(sender, receiver, t) for p in partitions))
