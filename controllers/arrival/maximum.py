"""The plug-in ``maximum``: the vehicles agree on the largest of their numbers, which only rises.

The least times in which the vehicles can arrive have one common value that all can keep: their maximum, up to the
deadline D of the fleet. Each vehicle sends the largest that it knows, so all know it after as many rounds as the
graph's diameter, in any order of messages, and no message that is late, lost or doubled makes it fall. A vehicle
whose own number is above D announces itself an outlier: it follows what the others agree on, and comes back when its
own number is at most D again.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence

from mathnavi.controllers.arrival.inbox import ConsensusPayload, Inbox
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.protocols import Consensus
from mathnavi.interfaces.signals import Message
from mathnavi.models.fleet.graph import Neighbourhood


@configuration
class MaximumConfig:
    """Fields of the plug-in."""

    period: Positive = 1.0 / 60.0
    """time between two rounds [s]"""


class Maximum:
    """Max-consensus: the largest number, which only rises, up to the fleet's deadline."""

    Config = MaximumConfig
    within_starts = True
    only_rises = True  # a later time that one vehicle communicates becomes the agreed one

    @staticmethod
    def build(config: MaximumConfig, mission: Neighbourhood) -> Consensus:
        """Return the consensus of one vehicle; MissionError for a deadline that is NaN."""
        if math.isnan(mission.deadline):
            raise MissionError(f"deadline = {mission.deadline!r}; allowed: a number")
        return MaximumConsensus(config, mission)


class MaximumConsensus:
    """The largest number that one vehicle knows of."""

    def __init__(self, config: MaximumConfig, neighbourhood: Neighbourhood) -> None:
        self.period = config.period
        self._neighbourhood = neighbourhood
        self._inbox = Inbox(neighbourhood, ConsensusPayload.sound, 2.0 * neighbourhood.clock_error)
        self._beyond = 0  # numbers received above D
        self._largest: float | None = None
        self._own = math.nan

    @property
    def value(self) -> float:
        """Agreed number; D where nothing is agreed and its own number is above it."""
        if self._largest is not None:
            return self._largest
        return self._neighbourhood.deadline if self._own > self._neighbourhood.deadline else math.nan

    @property
    def outlier(self) -> bool:
        """True if the vehicle only follows: its own number is above D, or it has none."""
        return not (math.isfinite(self._own) and self._own <= self._neighbourhood.deadline)

    @property
    def refused(self) -> Mapping[str, int]:
        """Number of messages refused, by the reason."""
        return self._inbox.refused + Counter({"beyond the deadline": self._beyond})

    def start(self, value: float, now: float = 0.0) -> None:
        """Set the vehicle's own number; the agreed one rises to it if it is at most D."""
        self._own = float(value)
        if not self.outlier:
            self._rise(self._own)

    def exchange(self, t: float, received: Sequence[Message]) -> ConsensusPayload:
        """Exchange one round at t [s]: take what was ``received``, return the payload to send."""
        for message in self._inbox.take(t, received):
            payload: ConsensusPayload = message.payload
            if payload.value is not None and payload.value > self._neighbourhood.deadline:
                self._beyond += 1
            elif payload.value is not None:
                self._rise(payload.value)
        return ConsensusPayload(self._largest, self._neighbourhood.valency, self.outlier)

    def _rise(self, value: float) -> None:
        self._largest = value if self._largest is None else max(self._largest, value)
