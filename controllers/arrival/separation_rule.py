"""The rule by which the vehicles of a fleet keep their plans apart, and the check of the plans that they start with.

A vehicle flies within r of its plan, by a clock that is off by at most epsilon. Where one clock shows s and the other
s', |s - s'| <= 2 epsilon: the plans, compared at the later of both, are moved against each other by 2 epsilon v_max at
most. Vehicles are d_s apart if their plans are

    D = d_s + 2 r + 2 epsilon v_max

apart at equal times.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any, Protocol

import numpy as np

from mathnavi.interfaces.bounds import NonNegative, Positive, configuration
from mathnavi.interfaces.checks import check_names
from mathnavi.interfaces.errors import ArgumentError, MissionError
from mathnavi.interfaces.signals import Array, Event, Message, Plan
from mathnavi.models.aerial.kernels import state_on
from mathnavi.models.aerial.plan_distance import PlannedTrajectory, clear_of_each, least_distance
from mathnavi.models.tolerances import TIME_TOLERANCE


@configuration
class Zone:
    """Safety zone that every vehicle keeps free around itself, the same for all of a fleet."""

    distance: Positive  # [m] d_s, between vehicles
    bound: NonNegative = 0.0  # [m] r, of a vehicle from its plan
    speed_max: NonNegative = 0.0  # [m/s] v_max
    clock_error: NonNegative = 0.0  # [s] epsilon, of a vehicle's clock

    @property
    def required(self) -> float:
        """Distance D [m] that plans have to keep."""
        return self.distance + 2.0 * self.bound + 2.0 * self.clock_error * self.speed_max

    def between(self, a: PlannedTrajectory, b: PlannedTrajectory) -> float:
        """Distance D [m], with the speed of either plan where it is faster than v_max: a gust may have made it so."""
        return float(self._at(np.maximum(a.speed, b.speed)))

    def _at(self, speed: Array) -> Array:
        """Distances D [m] of plans whose greatest speeds are these [m/s]."""
        return self.distance + 2.0 * self.bound + 2.0 * self.clock_error * np.maximum(self.speed_max, speed)

    def kept_from_each(self, plan: PlannedTrajectory, others: Sequence[PlannedTrajectory], times: Array) -> list[bool]:
        """True, for each other plan, if it and ``plan`` are D apart over [times[k], infinity), (n,) [s]."""
        speeds = np.maximum(plan.speed, [other.speed for other in others])
        return clear_of_each(plan, others, self._at(speeds), times)


def checked_start(
    plans: Sequence[tuple[str, Plan]], slots: Mapping[str, Array], zone: Zone, t: float | None = None
) -> dict[str, PlannedTrajectory]:
    """Stored plan of each vehicle by its name, if a fleet may start so: the initial condition of the protocol.

    ``plans`` are the names with their plans, ``slots`` (3,) [m] where each is to arrive, ``t`` [s] the start of the
    mission, by default that of the earliest plan. Raises MissionError, naming both vehicles, the value and what is
    allowed, for a name that is there twice, and for two vehicles whose starts, whose slots or whose plans anywhere to
    rest and beyond are less than D apart.
    """
    names = check_names([name for name, _ in plans])
    if missing := [name for name in names if name not in slots]:
        raise MissionError(f"slots = {sorted(slots)!r}; allowed: one for every vehicle, also for {', '.join(missing)}")
    stored: dict[str, PlannedTrajectory] = {}
    for name, plan in plans:
        try:
            stored[name] = PlannedTrajectory.from_plan(plan)
        except ValueError as error:
            raise MissionError(f"plan of {name}: {error}") from error
        if np.shape(slots[name]) != (3,) or not np.isfinite(slots[name]).all():
            raise MissionError(f"slot of {name} = {slots[name]!r}; allowed: (3,) finite values")
    if not stored:
        return stored
    begin = min(float(each.t[0]) for each in stored.values()) if t is None else t
    start = {name: state_on(each.t, each.x, each.u, begin)[:3] for name, each in stored.items()}
    for one, other in combinations(names, 2):
        a, b = stored[one], stored[other]
        required = zone.between(a, b)
        for what, apart in (
            ("starts", float(np.linalg.norm(start[one] - start[other]))),
            ("target slots", float(np.linalg.norm(np.subtract(slots[one], slots[other])))),
            ("stored plans", least_distance(a, b, begin)),
        ):
            if apart < required:
                raise MissionError(
                    f"{what} of {one} and {other} are {apart:.2f} m apart; allowed: >= {required:.2f} m, "
                    f"of which {zone.distance:g} m between the vehicles"
                )
    return stored


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


def check_content(id: Any, *trajectories: Any) -> None:
    """Raise ArgumentError for content that no message has: what a coordinator sends passes its constructor again.

    A trajectory checks its own arrays.
    """
    if isinstance(id, bool) or not isinstance(id, int):
        raise ArgumentError(f"id = {id!r}; allowed: a whole number")
    for trajectory in trajectories:
        if not isinstance(trajectory, PlannedTrajectory):
            raise ArgumentError(f"trajectory = {trajectory!r}; allowed: a PlannedTrajectory")


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
