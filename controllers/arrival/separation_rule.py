"""The rule by which the vehicles of a fleet keep their plans apart, as a coordinator uses it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from mathnavi.controllers.arrival.zone import Zone
from mathnavi.interfaces.signals import Event, Message, Plan
from mathnavi.models.aerial.plan_distance import PlannedTrajectory
from mathnavi.models.tolerances import TIME_TOLERANCE

TOPIC = "separation"


class SeparationRule(Protocol):
    """Protocol of one vehicle. It keeps no time and sends nothing by itself: ``exchange`` is to be called often."""

    name: str
    peers: tuple[str, ...]  # all other vehicles
    events: list[Event]  # since they were last taken
    binding: bool  # True if an admitted plan has to be flown, since the others rely on it

    @property
    def pending(self) -> int | None:
        """Identifier of the proposal that is underway or admitted."""
        ...

    @property
    def unheard(self) -> tuple[str, ...]:
        """Vehicles without whose answer the pending proposal is not admitted."""
        ...

    def propose(self, plan: Plan | PlannedTrajectory) -> int:
        """Make a plan pending, in place of one that may be, and return its id."""
        ...

    def withdraw(self) -> None:
        """Give up the pending plan, if there is one."""
        ...

    def admitted(self, id: int) -> bool:
        """True if this proposal is pending and may be flown from its start on."""
        ...

    def adopt(self, t: float) -> None:
        """Make the admitted plan the one being flown from t [s] on, at the hand-over."""
        ...

    def rebase(self, plan: Plan | PlannedTrajectory) -> None:
        """Note that the vehicle left its plan and flies this one, which the others have not checked."""
        ...

    def exchange(self, t: float, received: Sequence[Message]) -> list[tuple[str, Message]]:
        """Process the messages received by t [s] of this vehicle's clock; return those to send, with the receivers."""
        ...


def objection(message: Message, t: float, peers: Mapping[str, Any], zone: Zone, *payloads: type) -> str:
    """Reason why a message received at t [s] is impossible, or "". Ignoring a message is as safe as losing it.

    ``peers`` has the names of all other vehicles, ``payloads`` are the types that a payload may have.
    """
    if message.sender not in peers:
        return f"sender = {message.sender!r}; allowed: {', '.join(peers)}"
    if not message.t <= t + 2.0 * zone.clock_error + TIME_TOLERANCE:
        return f"t = {message.t!r} of {message.sender} lies in the future; allowed: <= {t!r}"
    if not isinstance(message.payload, payloads):
        allowed = ", ".join(each.__name__ for each in payloads)
        return f"payload of {message.sender} is {type(message.payload).__name__}; allowed: {allowed}"
    return ""
