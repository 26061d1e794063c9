"""Message passing between vehicles that know of each other only what is communicated.

``Network`` delivers at once; around it stand wrappers for what a radio does: who hears whom, delay, loss, duplication
and partition. Every wrapper draws from a generator that is passed in, so a run with them is as reproducible as one
without. A message says when it was sent; when it arrives is the network's to know.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.interfaces.bounds import NonNegative, configuration
from mathnavi.sim.interfaces.checks import check, check_names
from mathnavi.sim.interfaces.errors import ArgumentError
from mathnavi.sim.interfaces.signals import Message


class Network(Protocol):
    """A carrier of messages."""

    def send(self, message: Message, receiver: str, t: float) -> None:
        """Take a message that sets out at t [s]."""
        ...

    def receive(self, receiver: str, t: float) -> list[Message]:
        """Messages that arrived by t [s] and were not received before, in the order of arrival."""
        ...


@dataclass(frozen=True)
class _Underway:
    t: float  # [s] of arrival
    number: int  # of those taken, so that what arrives at once arrives in the order in which it was sent
    receiver: str
    message: Message


class IdealNetwork:
    """Delivers to everyone at once."""

    def __init__(self, names: Sequence[str]) -> None:
        """``names`` of all vehicles; ValueError if one is there twice."""
        self._underway: dict[str, list[_Underway]] = {name: [] for name in check_names(names)}
        self._taken = 0

    def send(self, message: Message, receiver: str, t: float) -> None:
        """ArgumentError for a receiver that is none."""
        if receiver not in self._underway:
            raise ArgumentError(f"receiver = {receiver!r}; allowed: {', '.join(self._underway)}")
        self._underway[receiver].append(_Underway(t, self._taken, receiver, message))
        self._taken += 1

    def receive(self, receiver: str, t: float) -> list[Message]:
        held = sorted(self._underway[receiver], key=lambda each: (each.t, each.number))
        arrived = [each.message for each in held if each.t <= t + TIME_TOLERANCE]
        self._underway[receiver] = held[len(arrived) :]
        return arrived


class Linked:
    """Only what has a link comes through: ``linked(sender, receiver, t)``, which may change with time."""

    def __init__(self, network: Network, linked: Callable[[str, str, float], bool]) -> None:
        self._network, self._linked = network, linked

    def send(self, message: Message, receiver: str, t: float) -> None:
        if self._linked(message.sender, receiver, t):
            self._network.send(message, receiver, t)

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

    def send(self, message: Message, receiver: str, t: float) -> None:
        self._network.send(message, receiver, t + self._rng.uniform(self._least, self._most))

    def receive(self, receiver: str, t: float) -> list[Message]:
        return self._network.receive(receiver, t)


class LossyLinks:
    """A fraction ``loss`` of the messages is lost, and a fraction ``duplication`` of the rest arrives twice."""

    def __init__(self, network: Network, loss: float, duplication: float, rng: np.random.Generator) -> None:
        check(loss, "loss", 0.0, 1.0)
        check(duplication, "duplication", 0.0, 1.0)
        self._network, self._loss, self._duplication, self._rng = network, loss, duplication, rng

    def send(self, message: Message, receiver: str, t: float) -> None:
        lost, doubled = self._rng.random(2) < (self._loss, self._duplication)
        for _ in range(0 if lost else 2 if doubled else 1):
            self._network.send(message, receiver, t)

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
