"""The plug-in ``clock``: the vehicles agree on one time without a clock that they share (Remark A.6).

A vehicle reads only its own clock c_m; its corrected time is c_m + x_m, and x_m is a consensus state in addition to the
arrival time. From two messages, one from m to l and one from l to m, each with the local times at which it was sent and
received, the difference of the two clocks follows as in the network time protocol (Mills, RFC 5905, section 8)

    theta_lm = ((taken_l - sent_m) + (sent_l - taken_m)) / 2 = c_l - c_m + (delay there - delay back) / 2,

so a delay that is the same both ways drops out. The corrections then follow the Laplacian protocol,

    x_m' = s sum_l a_lm (x_l + theta_lm - x_m) + y_m,

in rounds as ``laplacian`` describes. At rest the corrected times of two neighbours differ by at most half of what the
delays between them do where they have no other way to each other, and other ways average it. Clocks that drift against
each other by rho leave a spread of about rho / (s lambda_2), unless rates are agreed upon too:

    y_m' = s_y sum_l a_lm (y_l + d theta_lm / dt - y_m),

with the rate of theta_lm over a baseline. Delays that vary disturb that rate by their variation over the baseline,
which is far more than quartz drifts by; so it is left out by default.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mathnavi.controllers.arrival.inbox import Inbox, edge_weight, finite
from mathnavi.interfaces.bounds import NonNegative, Positive, configuration
from mathnavi.interfaces.checks import check
from mathnavi.interfaces.protocols import Consensus
from mathnavi.interfaces.signals import Message
from mathnavi.models.fleet.graph import Neighbourhood
from mathnavi.models.tolerances import TIME_TOLERANCE


@configuration
class ClockConfig:
    """Fields of the plug-in."""

    scaling: Positive = 20.0
    """gain s of the protocol of the corrections [1/s]"""
    rate_scaling: NonNegative = 0.0
    """gain s_y of the protocol of the rates [1/s]; 0: no agreement on rates"""
    period: Positive = 1.0 / 60.0
    """time between two rounds [s]"""
    memory: float = 0.25
    """longest round trip that is used, and age beyond which a neighbour's message no longer counts [s]"""
    baseline: Positive = 2.0
    """time over which a rate is measured [s]"""
    apart: Positive = 60.0
    """largest difference between two clocks [s]; a message that is further ahead is refused as from the future"""

    def __post_init__(self) -> None:
        check(self.memory, "memory", 2.0 * self.period)


class Clock:
    """Clock consensus (Remark A.6): corrections of local clocks, from messages with local time stamps."""

    Config = ClockConfig
    within_starts = False  # corrections make up for the clocks' differences

    @staticmethod
    def build(config: ClockConfig, mission: Neighbourhood) -> Consensus:
        """Return the consensus of one vehicle, to be called with the times of that vehicle's clock."""
        return ClockConsensus(config, mission)


@dataclass(frozen=True)
class ClockPayload:
    """Message of a vehicle to all its neighbours."""

    correction: float  # [s] x_m
    rate: float  # y_m
    valency: float  # d_m
    taken: Mapping[str, tuple[float, float]]  # of each neighbour's last message: when it was sent, and taken here [s]

    @staticmethod
    def sound(payload: Any) -> bool:
        """True if a payload is a ``ClockPayload`` with finite numbers."""
        if not (isinstance(payload, ClockPayload) and isinstance(payload.taken, Mapping)):
            return False
        numbers = [payload.correction, payload.rate, payload.valency]
        for stamps in payload.taken.values():
            if not (isinstance(stamps, tuple) and len(stamps) == 2):
                return False
            numbers.extend(stamps)
        return all(map(finite, numbers)) and payload.valency >= 0.0


@dataclass
class _Link:
    """Knowledge of one neighbour."""

    taken: float  # [s] own clock
    theta: float  # [s] how far its clock is ahead
    payload: ClockPayload
    since: float  # [s] own clock, the baseline's begin
    theta_then: float  # [s]
    rate: float | None = None  # of theta


class ClockConsensus:
    """One vehicle's correction x_m."""

    def __init__(self, config: ClockConfig, neighbourhood: Neighbourhood) -> None:
        self.period = config.period
        self._config, self._neighbourhood = config, neighbourhood
        self._inbox = Inbox(neighbourhood, ClockPayload.sound, config.apart)
        self._unusable: Counter[str] = Counter()
        self._correction = self._rate = 0.0
        self._stamps: dict[str, tuple[float, float]] = {}  # of each neighbour's last message: sent, taken
        self._links: dict[str, _Link] = {}
        self._last: float | None = None  # [s] own clock, of the last round

    @property
    def value(self) -> float:
        """x_m [s], to be added to what the vehicle's own clock shows."""
        return self._correction

    @property
    def rate(self) -> float:
        """y_m, by which the correction grows with its own clock."""
        return self._rate

    @property
    def disagreement(self) -> float:
        """Greatest difference [s] of the neighbours' corrected clocks, as last received, from its own."""
        known = [link for link in self._links.values() if self._last is not None and self._recent(link, self._last)]
        return max((abs(link.payload.correction + link.theta - self._correction) for link in known), default=0.0)

    @property
    def outlier(self) -> bool:
        """False: every clock takes part."""
        return False

    @property
    def refused(self) -> Mapping[str, int]:
        """Number of messages refused, by the reason."""
        return self._inbox.refused + self._unusable

    def start(self, value: float, now: float = 0.0) -> None:
        """Set the first guess of the correction [s]; a value that is not finite changes nothing."""
        if math.isfinite(value):
            self._correction = float(value)

    def exchange(self, t: float, received: Sequence[Message]) -> ClockPayload:
        """Exchange one round when its own clock shows t [s]: take what was ``received``, return the payload to send."""
        for message in self._inbox.take(t, received):
            self._compare(t, message)
        if self._last is not None:
            self._correction += self._rate * min(max(t - self._last, 0.0), self._config.memory)
            self._integrate(t)
        self._last = t
        return ClockPayload(self._correction, self._rate, self._neighbourhood.valency, dict(self._stamps))

    def _compare(self, t: float, message: Message) -> None:
        """Update the lead [s] of a neighbour's clock, if the neighbour has answered a message of this vehicle."""
        payload: ClockPayload = message.payload
        name = message.sender
        if message.t < t - self._config.apart - self._config.memory:
            self._unusable["late"] += 1
            return
        self._stamps[name] = (message.t, t)
        if self._neighbourhood.name not in payload.taken:
            return
        sent, taken = payload.taken[self._neighbourhood.name]
        round_trip = (t - sent) - (message.t - taken)
        if not -TIME_TOLERANCE <= round_trip <= self._config.memory:
            self._unusable["round trip"] += 1
            return
        theta = 0.5 * ((taken - sent) + (message.t - t))
        if abs(theta) > self._config.apart or abs(payload.correction) > 2.0 * self._config.apart:
            self._unusable["clocks too far apart"] += 1
            return
        link = self._links.setdefault(name, _Link(t, theta, payload, t, theta))
        link.taken, link.theta, link.payload = t, theta, payload
        if t - link.since >= self._config.baseline:
            link.rate = (theta - link.theta_then) / (t - link.since)
            link.since, link.theta_then = t, theta

    def _recent(self, link: _Link, t: float) -> bool:
        return t - link.taken <= self._config.memory + TIME_TOLERANCE

    def _integrate(self, t: float) -> None:
        correction, rate = self._correction, self._rate
        for name, link in sorted(self._links.items()):
            if not self._recent(link, t):
                continue
            known = (self._neighbourhood.valency, link.payload.valency)
            weight = edge_weight(self._neighbourhood.weights[name], self._config.scaling * self.period, *known)
            self._correction += weight * (link.payload.correction + link.theta - correction)
            if link.rate is not None:
                weight = edge_weight(self._neighbourhood.weights[name], self._config.rate_scaling * self.period, *known)
                self._rate += weight * (link.payload.rate + link.rate - rate)
