"""Vehicles without a common clock: each reads its own, and they agree on the time as well as on their arrival.

A vehicle's clock shows c_m(t) = (1 + rho_m) t + o_m; what it sends to the others, and receives from them, is in
corrected time

    T_m = c_m + x_m,

x_m being the state of the clock consensus (Remark A.6). For ``settling`` it does nothing else: it flies its stored plan
and asks for no room. From then on the trajectories it announces, and the time of arrival it agrees on, are in T_m, and
the zone that vehicles keep is larger by what two corrected clocks may differ in (``Zone.clock_error``). Where a
neighbour's corrected clock is seen to differ by more than twice that error, "clock-apart" is recorded: the separation
rests on clocks that are less accurate than was assumed.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mathnavi.controllers.arrival.clock import ClockConsensus
from mathnavi.controllers.arrival.coordinator import FleetCoordinator
from mathnavi.controllers.flight.planner import ARRIVAL
from mathnavi.interfaces.signals import Message, Outbox, Plan

CLOCK = "clock consensus"  # the topic of the consensus's messages


@dataclass(frozen=True)
class LocalClock:
    """A clock with an offset and a drift."""

    offset: float = 0.0  # [s] o
    drift: float = 0.0  # rho

    def __call__(self, t: float) -> float:
        """Time [s] that the clock shows at t [s]."""
        return (1.0 + self.drift) * t + self.offset


class ClockedCoordinator:
    """The ``Coordinator`` of a vehicle that reads its own clock.

    ``coordinator(stored, ahead)`` makes the one that communicates plans and arrivals once the clocks agree: from the
    plan that is flown then, in corrected time, and from the lead [s] of this over the time in which the vehicle plans.
    """

    def __init__(
        self,
        name: str,
        clock: LocalClock,
        consensus: ClockConsensus,
        neighbours: Sequence[str],
        settling: float,
        error: float,
        coordinator: Callable[[Plan, float], FleetCoordinator],
    ) -> None:
        """``settling`` [s] is time of the vehicle's clock, ``error`` [s] the largest error of a corrected clock."""
        self.period = consensus.period
        self._name, self._clock, self._consensus = name, clock, consensus
        self._neighbours, self._settling, self._error = tuple(neighbours), settling, error
        self._make = coordinator
        self._inner: FleetCoordinator | None = None
        self._flown: Plan | None = None
        self._proposed: tuple[Plan, Plan] | None = None  # as flown, and as the others know it
        self._began: float | None = None  # [s] own clock
        self._apart = False

    def corrected(self, t: float) -> float:
        """Corrected time T_m [s] at t [s]."""
        return self._clock(t) + self._consensus.value

    def exchange(self, t: float, received: Sequence[Message]) -> Outbox:
        """Exchange messages at t [s]: those of the clocks, and once these agree those of plans and arrivals."""
        c = self._clock(t)
        payload = self._consensus.exchange(c, [message for message in received if message.topic == CLOCK])
        clocks = [(name, Message(c, self._name, CLOCK, payload)) for name in self._neighbours]
        self._began = c if self._began is None else self._began
        if self._inner is None and self._flown is not None and c - self._began >= self._settling:
            self._inner = self._make(self._shifted(t, self._flown), self.corrected(t) - t)
            self._inner.adopted(self.corrected(t), self._shifted(t, self._flown))
        if self._inner is None:
            return Outbox(tuple(clocks))
        outbox = self._inner.exchange(self.corrected(t), [message for message in received if message.topic != CLOCK])
        return Outbox(
            (*clocks, *outbox.messages),
            tuple(self._back(t, message) for message in outbox.planner_messages),
            (*outbox.events, *self._seen_apart()),
        )

    def propose(self, t: float, plan: Plan) -> None:
        """Propose a plan to the others, in corrected time; nothing before the clocks agree."""
        if self._inner is not None:
            self._proposed = plan, self._shifted(t, plan)
            self._inner.propose(self.corrected(t), self._proposed[1])

    def admits(self, t: float, plan: Plan) -> bool:
        """True if a plan may be flown; before the clocks agree, only a rebased one."""
        if self._inner is None:
            return "rebased" in plan.notes
        return self._inner.admits(self.corrected(t), self._known(t, plan))

    def adopted(self, t: float, plan: Plan) -> None:
        """Note that the vehicle flies ``plan`` from t [s] on."""
        if self._inner is not None:
            known = self._known(t, plan)
            # Its clock may have been put back a little since the plan was proposed.
            self._inner.adopted(max(self.corrected(t), known.t_start), known)
        self._flown = plan

    def _known(self, t: float, plan: Plan) -> Plan:
        """Return a plan as the others know it."""
        if self._proposed is not None and self._proposed[0] is plan:
            return self._proposed[1]
        return self._shifted(t, plan)

    def _shifted(self, t: float, plan: Plan) -> Plan:
        """Return a plan in corrected time, as known at t [s]."""
        return dataclasses.replace(plan, t=plan.t + (self.corrected(t) - t))

    def _back(self, t: float, message: Message) -> Message:
        """Return a message in the time of the vehicle's own planner."""
        ahead = self.corrected(t) - t
        payload = message.payload - ahead if message.topic == ARRIVAL else message.payload
        return Message(message.t - ahead, message.sender, message.topic, payload)

    def _seen_apart(self) -> tuple[tuple[str, str], ...]:
        """Events to record when a neighbour's corrected clock begins to differ by too much."""
        difference = self._consensus.disagreement
        apart = difference > 2.0 * self._error
        news, self._apart = apart and not self._apart, apart
        return (("clock-apart", f"by {difference:.3f} s; allowed {2.0 * self._error:g} s"),) if news else ()
