"""Communication of a vehicle with others: its coordinator, behind the boundary of plug-ins, and the network.

An answer of the coordinator that cannot be used, and one that raises, is recorded where such answers begin
("coordinator-raised") and has one consequence:

    exchange    it has sent nothing, and its planner has heard nothing of it
    propose     the plan is not proposed, and so not admitted
    admits      the plan is not admitted
    adopted     the others may not count on the plan that is flown: "separation-unguaranteed"

A plan that begins at the estimate because the one before is void ("rebased") takes over whatever the coordinator
answers, for the ground does not wait for the others; the separation is not guaranteed from then on. It is again once a
plan takes over that was admitted.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection
from time import perf_counter
from typing import Any

import numpy as np

from mathnavi.interfaces.boundary import Unusable, answered, guest, lent, locked_plan
from mathnavi.interfaces.communicated import usable_outbox
from mathnavi.interfaces.protocols import Coordinator
from mathnavi.interfaces.signals import Message, Outbox, Plan
from mathnavi.sim.engine.log import AgentRecorder
from mathnavi.sim.engine.network import Network

_OPEN = 16  # plans that a coordinator may be asked about again; it has two or three


class Communication:
    """Communication of one vehicle of a fleet."""

    def __init__(
        self,
        name: str,
        coordinator: Coordinator,
        fleet: Collection[str],
        network: Network,
        record: AgentRecorder,
        noted: Callable[[float], None],
    ) -> None:
        """``fleet`` are the names of all vehicles; ``noted`` takes the time [s] of each answer by the wall clock."""
        self._name, self._coordinator, self._fleet = name, coordinator, fleet
        self._network, self._record, self._noted = network, record, noted
        self._guest = guest(coordinator)
        self._failing: dict[str, bool] = {}  # by method, its last answer
        self._unknown: Plan | None = None  # which the coordinator failed to propose
        self._acknowledged = True  # the plan that is flown, by all others
        self._copies: deque[tuple[Plan, Plan]] = deque(maxlen=_OPEN)  # of plans, that a guest was given

    def exchange(self, t: float) -> tuple[Message, ...]:
        """Pass on what was received and send what the coordinator answers; return its messages to the planner."""
        received = self._network.receive(self._name, t)

        def exchanged() -> Any:
            answer = self._coordinator.exchange(t, lent(received) if self._guest else received)
            return usable_outbox(answer, self._name, self._fleet, self._guest)

        outbox = self._asked(t, "exchange", exchanged, Outbox)
        if not isinstance(outbox, Outbox):
            return ()
        self._network.send(outbox.messages, t)
        for kind, text in outbox.events:
            self._record.event(t, kind, text)
        return outbox.planner_messages

    def propose(self, t: float, plan: Plan) -> None:
        """Have the coordinator propose a plan, in place of any other that it has not proposed yet."""
        answer = self._asked(t, "propose", lambda: self._coordinator.propose(t, self._given(plan)), type(None))
        self._unknown = plan if isinstance(answer, Unusable) else None

    def admits(self, t: float, plan: Plan) -> bool:
        """Return True if the plan may take over."""
        admitted = self._asked(t, "admits", lambda: self._coordinator.admits(t, self._given(plan)), bool, np.bool_)
        if "rebased" in plan.notes:
            return True
        return not isinstance(admitted, Unusable) and bool(admitted) and plan is not self._unknown

    def adopted(self, t: float, plan: Plan) -> None:
        """Tell the coordinator that the plan is flown; announce where the others do not know of it."""
        told = self._asked(t, "adopted", lambda: self._coordinator.adopted(t, self._given(plan)), type(None))
        reason = "its coordinator did not take note of the plan that it flies" if isinstance(told, Unusable) else ""
        if "rebased" in plan.notes:
            reason = "it flies a plan that no vehicle has acknowledged"
        if reason and self._acknowledged:
            self._record.event(t, "separation-unguaranteed", reason)
        self._acknowledged = not reason

    def _asked(self, t: float, method: str, call: Callable[[], Any], *allowed: type) -> Any:
        """Return the answer of a method, or why it cannot be used."""
        began = perf_counter()
        answer = answered(call)
        self._noted(perf_counter() - began)
        usable = isinstance(answer, allowed)
        if not usable and not isinstance(answer, Unusable):
            names = ", ".join(kind.__name__ for kind in allowed)
            answer = Unusable(f"{method}() returned {type(answer).__name__}; allowed: {names}")
        if not usable and not self._failing.get(method, False):
            self._record.event(t, "coordinator-raised", answer.reason)
        self._failing[method] = not usable
        return answer

    def _given(self, plan: Plan) -> Plan:
        """Return the plan as the coordinator knows it: a guest has a copy, the same for the same plan."""
        if not self._guest:
            return plan
        for known, copy in self._copies:
            if known is plan:
                return copy
        copy = locked_plan(plan)
        self._copies.append((plan, copy))
        return copy
