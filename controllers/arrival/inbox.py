"""Inbox of a vehicle: it selects the messages that count, and keeps the last of each neighbour."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mathnavi.interfaces.signals import Message
from mathnavi.models.fleet.graph import Neighbourhood
from mathnavi.models.tolerances import TIME_TOLERANCE


@dataclass(frozen=True)
class ConsensusPayload:
    """Message of a vehicle to all its neighbours."""

    value: float | None  # None: an outlier that has received no other value yet
    valency: float  # d_m of the sender, its links' weights together
    outlier: bool = False  # the sender's own number takes no part

    @staticmethod
    def sound(payload: Any) -> bool:
        """True if a payload is a ``ConsensusPayload`` with finite numbers."""
        return (
            isinstance(payload, ConsensusPayload)
            and (payload.value is None or finite(payload.value))
            and finite(payload.valency)
            and payload.valency >= 0.0
        )


def finite(value: Any) -> bool:
    """True for a finite floating-point number."""
    return isinstance(value, float) and math.isfinite(value)


def edge_weight(weight: float, amount: float, own: float, others: float) -> float:
    """Weight w_lm = a_lm min(amount, 1 / (2 max(d_l, d_m))): what a link moves in a round (see ``laplacian``)."""
    return weight * min(amount, 0.5 / max(own, others))


class Inbox:
    """Inbox of one vehicle."""

    def __init__(self, neighbourhood: Neighbourhood, sound: Callable[[Any], bool], ahead: float = 0.0) -> None:
        """``sound`` returns True for a usable payload; a sender's clock may lead this vehicle's by ``ahead`` [s]."""
        self.refused: Counter[str] = Counter()
        self._neighbourhood, self._sound, self._ahead = neighbourhood, sound, ahead
        self._since = -math.inf
        self._heard: dict[str, Message] = {}

    @property
    def heard(self) -> Mapping[str, Message]:
        """Last message that counts of each neighbour, by its time of sending."""
        return self._heard

    def begin(self, t: float, received: Sequence[Any]) -> None:
        """Forget the messages received and arrived by t [s]; messages sent before t count no longer."""
        self._since = math.inf
        self.take(t, received)
        self._since = t
        self._heard = {}

    def take(self, t: float, received: Sequence[Any]) -> list[Message]:
        """Store the messages received by t [s] and return those that count, in the order of their sending."""
        sound = [message for message in received if self._is_sound(message)]
        self.refused["garbage"] += len(received) - len(sound)
        taken = []
        for message in sorted(sound, key=lambda each: each.t):
            if why := self._objection(t, message):
                self.refused[why] += 1
            else:
                self._heard[message.sender] = message
                taken.append(message)
        self.refused = +self.refused  # without zeros
        return taken

    def _is_sound(self, message: Any) -> bool:
        return (
            isinstance(message, Message)
            and isinstance(message.sender, str)
            and finite(message.t)
            and self._sound(message.payload)
        )

    def _objection(self, t: float, message: Message) -> str:
        last = self._heard.get(message.sender)
        if message.sender not in self._neighbourhood.weights:
            return "stranger"
        if message.t > t + self._ahead + TIME_TOLERANCE:
            return "from the future"
        if message.t < self._since - TIME_TOLERANCE:
            return "from before the start"
        return "repeated or overtaken" if last is not None and message.t <= last.t else ""
