"""A consensus of a stranger: whatever it answers, its vehicle's separation goes on, and no other vehicle is changed."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pytest

from mathnavi.controllers.arrival.coordinator import AGREEMENT
from mathnavi.controllers.arrival.inbox import ConsensusPayload
from mathnavi.controllers.arrival.separation import SeparationReply
from mathnavi.controllers.arrival.separation_rule import TOPIC
from mathnavi.interfaces.signals import Message
from tests.controllers.arrival.test_coordinator import NAMES, ROUND, Fleet, H, along


class Strange:
    """The consensus of a stranger, which answers as it is told."""

    def __init__(self, part: Any, method: str, answer: Callable[[Any], Any]) -> None:
        self._part, self._method, self._answer, self.period = part, method, answer, part.period
        self.received: list[Sequence[Message]] = []

    def _told(self, method: str, good: Callable[[], Any]) -> Any:
        return self._answer(good()) if method == self._method else good()

    value = property(lambda self: self._told("value", lambda: self._part.value))
    outlier = property(lambda self: self._told("outlier", lambda: self._part.outlier))
    refused = property(lambda self: self._part.refused)

    def start(self, value: float, now: float = 0.0) -> Any:
        return self._told("start", lambda: self._part.start(value, now))

    def exchange(self, t: float, received: Sequence[Message]) -> Any:
        self.received.append(received)
        return self._told("exchange", lambda: self._part.exchange(t, list(received)))


class Pair(NamedTuple):
    value: float
    valency: float


class Mutable:
    """An object that its maker can change later."""


USED, NOT_USED = False, True
ANSWERS: dict[tuple[str, str], tuple[Callable[[Any], Any], bool]] = {
    ("start", "as it should"): (lambda good: good, USED),
    ("start", "raises"): (lambda good: 1 / 0, NOT_USED),
    ("exchange", "raises"): (lambda good: 1 / 0, NOT_USED),
    ("exchange", "exits"): (lambda good: sys.exit(1), NOT_USED),
    ("exchange", "nothing"): (lambda good: None, USED),
    ("exchange", "an object"): (lambda good: Mutable(), NOT_USED),
    ("exchange", "a class"): (lambda good: ConsensusPayload, NOT_USED),
    ("exchange", "an array of objects"): (lambda good: np.array([Mutable()]), NOT_USED),
    ("exchange", "a list"): (lambda good: [1.0, [math.nan]], USED),
    ("exchange", "a mapping"): (lambda good: {"value": np.zeros(3), "of": {"a"}}, USED),
    ("exchange", "a named tuple"): (lambda good: Pair(1.0, 1.0), USED),
    ("exchange", "a list in itself"): (lambda good: in_itself(), NOT_USED),
    ("exchange", "what is not finite"): (lambda good: ConsensusPayload(math.inf, math.nan), USED),
    ("value", "raises"): (lambda good: 1 / 0, NOT_USED),
    ("value", "nothing known"): (lambda good: math.nan, USED),
    ("value", "infinite"): (lambda good: math.inf, NOT_USED),
    ("value", "infinite before"): (lambda good: -math.inf, NOT_USED),
    ("value", "huge"): (lambda good: 1e300, NOT_USED),
    ("value", "an integer that is huge"): (lambda good: 10**400, NOT_USED),
    ("value", "text"): (lambda good: "50", NOT_USED),
    ("value", "none"): (lambda good: None, NOT_USED),
    ("value", "an array"): (lambda good: np.zeros(1), NOT_USED),
    ("value", "True"): (lambda good: True, NOT_USED),
    ("value", "long ago"): (lambda good: -1e9, USED),
    ("value", "of NumPy"): (np.float64, USED),
    ("outlier", "raises"): (lambda good: 1 / 0, NOT_USED),
    ("outlier", "text"): (lambda good: "no", NOT_USED),
    ("outlier", "of NumPy"): (np.bool_, USED),
}


def in_itself() -> list[Any]:
    values: list[Any] = []
    values.append(values)
    return values


def fleet_with(method: str, answer: Callable[[Any], Any], names: Sequence[str] = ("b",)) -> Fleet:
    """Vehicles on a line a - b - c; the consensus of those named is a stranger's."""

    def made(name: str, part: Any) -> Any:
        return Strange(part, method, answer) if name in names else part

    return Fleet(dict.fromkeys(NAMES, 50.0), wrapped=made)


@pytest.mark.refused("plug-in", "consensus: an answer that cannot be used")
@pytest.mark.parametrize(("method", "answer"), ANSWERS)
def test_what_cannot_be_used_is_said_once_and_separation_goes_on(method: str, answer: str) -> None:
    told, unusable = ANSWERS[method, answer]
    fleet = fleet_with(method, told)
    b, plan = fleet.coordinators["b"], along(900.0, t=1.0)
    b.propose(0.0, plan)
    fleet.exchange(0.0, 1.0)
    assert b.admits(1.0, plan)
    said = [text for kind, text in fleet.events if kind == "consensus-unusable"]
    assert len(said) == unusable
    assert all(text.startswith("Strange: ") for text in said)
    assert fleet.announced["a"] == fleet.announced["c"] == [pytest.approx(50.0)]
    assert all(map(math.isfinite, fleet.announced["b"]))


def test_a_consensus_that_answers_again_takes_part_again() -> None:
    answers = iter([1.0, math.inf, math.inf])
    fleet = fleet_with("value", lambda good: next(answers, good))
    fleet.exchange(0.0, 1.0)
    assert [kind for kind, _ in fleet.events] == ["consensus-unusable"]
    assert fleet.announced["b"][-1] == fleet.announced["a"][-1]


def test_what_it_does_with_messages_reaches_neither_their_other_receivers_nor_its_own_coordinator() -> None:
    fleet = fleet_with("start", lambda good: good, ("a", "c"))
    a, c = (fleet.coordinators[name] for name in "ac")
    sent = [Message(0.0, "b", AGREEMENT, ConsensusPayload(60.0, 2.0)), Message(0.0, "b", "weather", None)]
    a.exchange(0.0, sent)
    (held,) = a._consensus.received
    assert [message.topic for message in held] == [AGREEMENT]
    assert held[0] is not sent[0]
    object.__setattr__(held[0], "topic", TOPIC)
    object.__setattr__(held[0], "payload", SeparationReply(1, True))
    object.__setattr__(held[0].payload, "id", 7)
    c.exchange(0.0, sent)
    assert c._consensus.received[0][0] == sent[0] == Message(0.0, "b", AGREEMENT, ConsensusPayload(60.0, 2.0))


@pytest.mark.parametrize("payload", [[1.0], {"value": [1.0]}, np.ones(3)], ids=["list", "mapping", "array"])
def test_what_it_sends_it_cannot_change_later(payload: Any) -> None:
    fleet = fleet_with("exchange", lambda good: payload)
    outbox = fleet.coordinators["b"].exchange(0.0, [])
    (message,) = {id(m): m for _, m in outbox.messages if m.topic == AGREEMENT}.values()
    before = repr(message.payload)
    if isinstance(payload, dict):
        payload["value"].append(2.0)
    elif isinstance(payload, list):
        payload.append(2.0)
    else:
        payload += 1.0
    assert repr(message.payload) == before


def test_a_length_to_go_that_raises_leaves_the_vehicle_without_a_time_of_its_own() -> None:
    times = {"a": 50.0, "c": 60.0}  # of b there is none
    fleet = Fleet(times)
    fleet.exchange(0.0, 1.0)
    assert [kind for kind, _ in fleet.events] == ["arrival-unknown", "outlier"]
    assert [each[-1] for each in fleet.announced.values()] == [pytest.approx(60.0)] * 3
    times["b"] = 70.0
    fleet.exchange(1.0, 2.0 * H + 3.0 * ROUND)
    assert [each[-1] for each in fleet.announced.values()] == [pytest.approx(70.0)] * 3
