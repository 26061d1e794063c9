"""Coordinator of a vehicle of a fleet: it communicates plans, to keep them apart, and arrivals, to agree on a time.

    plan proposed -> SeparationRule, over the network, with every other vehicle -> admitted, or the stored plan stays
    ``ArrivalEstimate`` of the plan being flown -> Consensus, with the neighbours in the graph -> t_a for the planner

Once a planning period the vehicle gives its consensus its own time of arrival. What is agreed is rounded up to the
fleet's time grid, so that a vehicle which knows it to a rounding error asks its planner for the same instant as all
others, and is communicated to the planner when it changes.

**Vehicles that queue.** The time of arrival by (A.12) is the least possible; a vehicle whose plans are refused cannot
keep it. All stored plans arrive at T_A, the assured time, independent of messages and proposals. So a vehicle
defers its arrival to T_A ("arrival-deferred") and communicates this to all others, if it has queued for ``PATIENCE``
planning instants running, if the plan by which it commits to the agreed time is refused, or if it has none some periods
after the horizon has reached that. The agreed time then moves to T_A, once: all have known it from the start, and one
that has not committed to an earlier arrival need not do anything to keep it. A plan that commits to a time before the
agreed one is not adopted any more, even if it was admitted, unless the rule binds the vehicle to it. What is agreed and
the plan being flown does not keep is announced when it is known ("arrival-unkept").

**Time of arrival**: (A.12) of the thesis, and with other speeds in its denominator.

    eta = T_p + L(p_N) / v,

L being the remaining length by the terminal cost (the thesis prints "Psi") and v

    max        v_max, which makes it the *least* time that is left: no vehicle can go faster (A.12);
    mean       the mean of the speeds at the nodes of the plan, the first alternative printed;
    largest    the largest of them, the second.

The nodes are those at which an optimised arc begins, p_1 ... p_(N-1); as printed p_N counts, too.

Communicated as a time of arrival, t + eta, it does not fall by h from one planning instant to the next, and vehicles
that plan at different instants can compare theirs. A plan that meets its target within its optimised part arrives when
it says; of a plan whose optimised part is over, the length is measured from where the vehicle is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from mathnavi.controllers.arrival.separation_rule import TOPIC, SeparationRule
from mathnavi.controllers.flight.certificate import pass_time
from mathnavi.controllers.flight.planner import ARRIVAL
from mathnavi.interfaces.boundary import Unusable, answered, guest, lent
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.communicated import usable_round
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.protocols import Consensus
from mathnavi.interfaces.signals import OPTIMISED, Array, Message, Outbox, Plan
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.tolerances import TIME_TOLERANCE

SpeedName = Literal["max", "mean", "largest"]

_SLOWEST = 1e-3  # [m/s] below which a plan gives no time


@configuration
class ArrivalEstimate:
    """Estimate of the time at which plans arrive at one target."""

    length_to_go: Callable[[Array], Array]  # (n, 3) [m] -> (n,) [m]
    target: Array  # (3,) [m]
    speed_max: Positive  # [m/s] v_max
    speed: SpeedName = "max"

    def __call__(self, plan: Plan, t: float) -> float:
        """Time [s] at which a vehicle on ``plan`` arrives, as known at t [s]; infinite for a plan that stands still."""
        met = self.arrives(plan, t)
        optimised = plan.phase == OPTIMISED
        end = float(plan.t[1:][optimised][-1]) if optimised.any() else plan.t_start
        if met <= end:
            return met
        last = max(t, end)
        left = float(self.length_to_go(state_at(plan, last)[np.newaxis, :3])[0])
        speeds = np.linalg.norm(plan.x[:-1][optimised][:, 3:], axis=1)
        v = self.speed_max
        if self.speed != "max":
            v = float(speeds.mean() if self.speed == "mean" else speeds.max()) if len(speeds) else 0.0
        return last + left / v if v > _SLOWEST else np.inf

    def arrives(self, plan: Plan, t: float) -> float:
        """Time [s] after t [s] at which a plan, flown to its end, is at the target; infinite if it never is."""
        return pass_time(plan, self.target, t)


AGREEMENT = "arrival consensus"  # the topic of the consensus's messages
DEFERRAL = "arrival deferral"  # the topic of messages, to all, that the assured time is the fleet's
PATIENCE = 3  # planning instants running at which a vehicle's plan is refused
SETTLING = 3  # planning instants from the first on, after which the vehicles have agreed
DECISION = 2  # planning instants within the horizon by which a plan that arrives at the agreed time is there

_ROUNDING = 1e-3  # of the time grid: a time so little above a grid point is on it


@dataclass(frozen=True)
class AssuredArrival:
    """The time that every vehicle's stored plan keeps."""

    time: float  # [s] T_A
    arrives: Callable[[Plan, float], float]  # [s] when a plan is at rest at the slot, or passes it, after a time [s]
    braking: float  # [s] before which, at most, it is within the arrival radius


class FleetCoordinator:
    """The ``Coordinator`` of one vehicle."""

    def __init__(
        self,
        separation: SeparationRule,
        consensus: Consensus,
        neighbours: Sequence[str],
        estimate: Callable[[Plan, float], float],
        planning_period: float,
        grid: float,
        assured: AssuredArrival | None = None,
    ) -> None:
        """``neighbours`` send to ``consensus``; ``grid`` [s] is that of common arrival times; ``assured`` if there is.

        The period is that of the consensus' rounds. ArgumentError for a grid that is not positive.
        """
        if not (math.isfinite(grid) and grid > 0.0):
            raise ArgumentError(f"grid = {grid!r}; allowed: a finite value > 0")
        self.period = consensus.period
        self._separation, self._consensus, self._neighbours = separation, consensus, tuple(neighbours)
        self._peers = frozenset(separation.peers)
        self._estimate, self._planning_period, self._grid = estimate, planning_period, grid
        self._assured = assured
        self._queued = 0  # planning instants running at which the vehicle's plan was not admitted
        self._notice: Message | None = None  # of its deferral: a new one every planning period, repeated until then
        self._deferred = False  # True from when its own time of arrival is the assured one
        self._reach = 0.0  # [s] of a plan's optimised part
        self._changed = -math.inf  # [s] when the agreed time last changed
        self._begun = math.inf  # [s] of the first exchange
        self._kept = True
        self._silent = False
        self._news: list[tuple[str, str]] = []
        self._flown: Plan | None = None
        self._proposed: tuple[int, Plan] | None = None
        self._next_step = -math.inf  # [s] when the consensus is given the vehicle's own time again
        self._announced: float | None = None  # [s] of arrival, to the planner
        self._agreed = math.nan  # [s] the consensus's value after its last round
        self._follows = False  # it was an outlier then
        self._outlier = False
        self._guest = guest(consensus)
        self._unusable = {"arrival-unknown": False, "consensus-unusable": False}

    def exchange(self, t: float, received: Sequence[Message]) -> Outbox:
        """Exchange messages at t [s]: return what goes to the neighbours and to the planner, and the events."""
        own = None
        if (flown := self._flown) is not None and t >= self._next_step - TIME_TOLERANCE:
            found = answered(lambda: self._own_time(t, flown))  # its length to go is the planner's
            self._complain("arrival-unknown", found)
            own = math.nan if isinstance(found, Unusable) else found
            self._next_step = t + self._planning_period
            self._news += self._keeping(t, flown)
        plans = self._separation.exchange(t, [message for message in received if message.topic == TOPIC])
        deferral = self._deferring(t, [message for message in received if message.topic == DEFERRAL])
        agreement = self._agreeing(t, own, [message for message in received if message.topic == AGREEMENT])
        messages: list[tuple[str | tuple[str, ...], Message]] = [*plans, *deferral, *agreement]
        happened = [(event.kind, event.message) for event in self._separation.events]
        self._separation.events.clear()
        news, self._news = self._news, []
        return Outbox(tuple(messages), self._planner_messages(t), (*happened, *news, *self._taking_part()))

    def propose(self, t: float, plan: Plan) -> None:
        """Propose a plan to the others."""
        self._proposed = self._separation.propose(plan), plan

    def admits(self, t: float, plan: Plan) -> bool:
        """True if a plan may be flown: the rule of separation has admitted it.

        Also True for a rebased plan, made from the estimate because the one before was void: the others are not asked
        for it, and the guarantee is lost.
        """
        if "rebased" in plan.notes:
            self._separation.rebase(plan)
            return True
        if self._proposed is None or self._proposed[1] is not plan:
            return False
        rule = self._separation
        admitted = rule.admitted(self._proposed[0]) and (rule.binding or not self._outdated(t, plan))
        silence = self._silence()
        if not admitted:
            self._separation.withdraw()
        self._queued = 0 if admitted else self._queued + 1
        self._news += silence
        return admitted

    def adopted(self, t: float, plan: Plan) -> None:
        """Note that the vehicle flies ``plan`` from t [s] on."""
        if self._proposed is not None and self._proposed[1] is plan and self._separation.admitted(self._proposed[0]):
            self._separation.adopt(t)
        self._flown = plan
        optimised = plan.t[1:][plan.phase == OPTIMISED]
        self._reach = max(self._reach, float(optimised[-1]) - plan.t_start if len(optimised) else 0.0)

    def _agreeing(self, t: float, own: float | None, received: Sequence[Message]) -> list[tuple[str, Message]]:
        """Do a round of the consensus, started with the vehicle's ``own`` time [s] if given; return what it sends.

        A consensus whose answers cannot be used sends nothing, and what was agreed before is no longer known to it.
        """
        answer = answered(lambda: self._round(t, own, received))
        found = answer if isinstance(answer, Unusable) else usable_round(*answer, self._guest)
        self._complain("consensus-unusable", found, self._guest or type(self._consensus).__name__)
        if isinstance(found, Unusable):
            self._agreed = math.nan
            return []
        payload, self._agreed, self._follows = found
        message = Message(t, self._separation.name, AGREEMENT, payload)
        return [(name, message) for name in self._neighbours]

    def _round(self, t: float, own: float | None, received: Sequence[Message]) -> tuple[Any, Any, Any]:
        consensus = self._consensus
        if own is not None:
            consensus.start(own, t)
        payload = consensus.exchange(t, lent(received) if self._guest else received)
        return payload, consensus.value, consensus.outlier

    def _complain(self, kind: str, answer: Any, name: str = "") -> None:
        """Note an event where answers begin to be unusable."""
        unusable = isinstance(answer, Unusable)
        if unusable and not self._unusable[kind]:
            self._news.append((kind, f"{name}: {answer.reason}" if name else answer.reason))
        self._unusable[kind] = unusable

    def _own_time(self, t: float, flown: Plan) -> float:
        """Time of arrival [s] that the vehicle communicates: the least possible, or the assured one once it defers."""
        least, assured = self._estimate(flown, t), self._assured
        if assured is None or assured.arrives(flown, t) - assured.braking > assured.time + self._planning_period:
            return least  # no time is assured, or no longer: the vehicle had to leave its plan
        if not self._deferred and (why := self._cannot_keep(t, flown, assured)):
            self._defer(why, assured)
        return assured.time if self._deferred else min(least, assured.time)

    def _defer(self, why: str, assured: AssuredArrival) -> None:
        self._deferred = True
        self._next_step = -math.inf  # the consensus is to know at once
        self._news.append(("arrival-deferred", f"{why}; its stored plan arrives at {assured.time:.2f} s"))

    def _deferring(self, t: float, received: Sequence[Message]) -> list[tuple[tuple[str, ...], Message]]:
        """Defer where others do, or where the plan that commits to the agreed time was refused; send it to all."""
        assured = self._assured
        if assured is None:
            return []
        if not self._deferred and (others := [each.sender for each in received if each.sender in self._peers]):
            self._defer(f"{others[0]} defers", assured)
        elif not self._deferred and self._proposed is not None and self._flown is not None:
            id, plan = self._proposed
            lost = self._separation.pending != id and plan is not self._flown and t < plan.t_start
            if lost and self._commits(t, plan) and not self._commits(t, self._flown):
                self._defer("no room to arrive as agreed", assured)
        if not self._deferred:
            return []
        if self._notice is None or t >= self._notice.t + self._planning_period - TIME_TOLERANCE:
            self._notice = Message(t, self._separation.name, DEFERRAL, None)
        return [(self._separation.peers, self._notice)]

    def _commits(self, t: float, plan: Plan) -> bool:
        """True if a plan arrives within its optimised part, before the assured time."""
        assured = self._assured
        return assured is not None and assured.arrives(plan, t) < assured.time - self._planning_period

    def _outdated(self, t: float, plan: Plan) -> bool:
        """True if a plan commits to a time before the agreed one, and the plan being flown does not."""
        if not self._deferred or self._flown is None:
            return False
        return self._commits(t, plan) and not self._commits(t, self._flown)

    def _cannot_keep(self, t: float, flown: Plan, assured: AssuredArrival) -> str:
        """Reason why the vehicle may not be able to keep a time before the assured one; "" while it may."""
        agreed = self._agreed
        if not agreed < assured.time - self._planning_period:
            return ""
        if self._queued >= PATIENCE:
            return f"no plan admitted {self._queued} times running"
        reached = agreed - t <= self._reach - DECISION * self._planning_period
        if reached and assured.arrives(flown, t) - assured.braking > agreed + self._planning_period:
            return f"no plan that arrives at {agreed:.2f} s"
        return ""

    def _keeping(self, t: float, flown: Plan) -> tuple[tuple[str, str], ...]:
        """Events to record where the plan being flown begins to miss the agreed time for good, or keeps it again."""
        agreed, assured, period = self._announced, self._assured, self._planning_period
        if assured is None or agreed is None or t < self._changed + 2.0 * period:
            return ()
        arrival = assured.arrives(flown, t)
        early, late = arrival < agreed - period, arrival - assured.braking > max(agreed, assured.time) + period
        kept = not (math.isfinite(arrival) and (early or late))
        if kept == self._kept:
            return ()
        self._kept = kept
        text = f"the plan being flown arrives at {arrival:.2f} s, agreed is {agreed:.2f} s"
        return (("arrival-kept" if kept else "arrival-unkept", text),)

    def _silence(self) -> tuple[tuple[str, str], ...]:
        """Events to record where others begin to leave a proposal unanswered to its start, or all answer again."""
        silent = self._separation.unheard
        if bool(silent) == self._silent or not (silent or self._separation.pending):
            return ()
        self._silent = bool(silent)
        if not silent:
            return (("separation-heard", "all others answer"),)
        return (("separation-silent", f"no answer of {', '.join(silent)}: the stored plan is flown"),)

    def _taking_part(self) -> tuple[tuple[str, str], ...]:
        """Events to record where the vehicle becomes an outlier, or takes part again."""
        outlier = self._follows and self._flown is not None
        if outlier == self._outlier:
            return ()
        self._outlier = outlier
        return (
            ("outlier", "it follows what the others agree on") if outlier else ("outlier-returns", "it takes part"),
        )

    def _planner_messages(self, t: float) -> tuple[Message, ...]:
        agreed = self._agreed
        self._begun = min(self._begun, t)
        settling = t < self._begun + SETTLING * self._planning_period
        if not math.isfinite(agreed) or (settling and self._assured is not None and agreed - t < 2.0 * self._reach):
            return ()  # a vehicle this near waits for the answers of the others
        arrival = self._grid * math.ceil(agreed / self._grid - _ROUNDING)
        if arrival == self._announced:
            return ()
        self._announced, self._changed = arrival, t
        return (Message(t, self._separation.name, ARRIVAL, arrival),)
