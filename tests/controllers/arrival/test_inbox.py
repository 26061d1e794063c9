"""The inbox: the messages that count in a round do not depend on their order of arrival."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from mathnavi.controllers.arrival.inbox import ConsensusPayload, Inbox
from mathnavi.interfaces.signals import Message
from mathnavi.models.fleet.graph import Graph

NEIGHBOURHOOD = Graph.line(("a", "b", "c")).neighbourhood("b")
MESSAGES = [Message(0.1 * k, "ac"[k % 2], "", ConsensusPayload(float(k), 1.0)) for k in range(6)]
MESSAGES += [Message(9.0, "a", "", ConsensusPayload(9.0, 1.0)), Message(0.2, "z", "", ConsensusPayload(9.0, 1.0))]


@given(st.permutations(MESSAGES))
def test_the_last_of_each_counts_and_the_same_are_refused(shuffled: list[Message]) -> None:
    inbox = Inbox(NEIGHBOURHOOD, ConsensusPayload.sound)
    assert inbox.take(1.0, shuffled) == MESSAGES[:6]
    assert {name: message.payload.value for name, message in inbox.heard.items()} == {"a": 4.0, "c": 5.0}
    assert inbox.refused == {"from the future": 1, "stranger": 1}
    assert inbox.take(1.1, shuffled) == []
    assert inbox.refused == {"from the future": 2, "stranger": 2, "repeated or overtaken": 6}


def test_after_a_beginning_only_what_was_sent_since_counts() -> None:
    inbox = Inbox(NEIGHBOURHOOD, ConsensusPayload.sound)
    inbox.begin(0.3, MESSAGES[:4])
    assert not inbox.heard
    assert inbox.take(0.6, MESSAGES[:6]) == MESSAGES[3:6]
    assert inbox.refused == {"from before the start": 7}
