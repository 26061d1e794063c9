"""What a vehicle of a fleet says to the others: its plans, for their room, and when it can arrive, for a common time.

    plan proposed -> Separation, over the network, with every other vehicle -> admitted, or the stored plan stays
    ``ArrivalEstimate`` of the plan being flown -> Consensus, with the neighbours in the graph -> t_a for the planner

Once a planning period the vehicle gives its consensus its own time of arrival. What is agreed is rounded up to the
fleet's time grid, so that a vehicle which knows it to a rounding error asks its planner for the same instant as all
others, and is communicated to the planner when it changes. Separation and agreement know nothing of each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from mathnavi.controllers.arrival.separation import TOPIC, Separation
from mathnavi.controllers.flight.planner import ARRIVAL
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.interfaces.protocols import Consensus
from mathnavi.sim.interfaces.signals import Message, Outbox, Plan

AGREEMENT = "arrival consensus"  # the topic of the consensus's messages

_ROUNDING = 1e-3  # of the time grid: what is that little above a grid point is on it


class FleetCoordinator:
    """The ``Coordinator`` of one vehicle."""

    def __init__(
        self,
        separation: Separation,
        consensus: Consensus,
        neighbours: Sequence[str],
        estimate: Callable[[Plan, float], float],
        planning_period: float,
        grid: float,
    ) -> None:
        """``neighbours`` send to ``consensus``; ``grid`` [s] is that of common arrival times.

        The period is that of the consensus' rounds. ValueError for a grid that is not positive.
        """
        if not (math.isfinite(grid) and grid > 0.0):
            raise ValueError(f"grid = {grid!r}; allowed: a finite value > 0")
        self.period = consensus.period
        self._separation, self._consensus, self._neighbours = separation, consensus, tuple(neighbours)
        self._estimate, self._planning_period, self._grid = estimate, planning_period, grid
        self._flown: Plan | None = None
        self._proposed: tuple[int, Plan] | None = None
        self._next_step = -math.inf  # [s] when the consensus is given the vehicle's own time again
        self._announced: float | None = None  # [s] of arrival, to the planner
        self._outlier = False

    def exchange(self, t: float, received: Sequence[Message]) -> Outbox:
        """Exchange messages at t [s]: return what goes to the neighbours and to the planner, and the events."""
        if self._flown is not None and t >= self._next_step - TIME_TOLERANCE:
            self._consensus.start(self._estimate(self._flown, t), t)
            self._next_step = t + self._planning_period
        messages = self._separation.exchange(t, [message for message in received if message.topic == TOPIC])
        payload = self._consensus.exchange(t, [message for message in received if message.topic == AGREEMENT])
        messages += [(name, Message(t, self._separation.name, AGREEMENT, payload)) for name in self._neighbours]
        happened = [(event.kind, event.message) for event in self._separation.events]
        self._separation.events.clear()
        return Outbox(tuple(messages), self._planner_messages(t), (*happened, *self._taking_part()))

    def propose(self, t: float, plan: Plan) -> None:
        """Propose a plan to the others."""
        self._proposed = self._separation.propose(plan), plan

    def admits(self, t: float, plan: Plan) -> bool:
        """True if a plan may be flown: all others have acknowledged it.

        True too, unasked and with the guarantee lost, for a plan made anew because the one before was worth nothing.
        """
        if "rebased" in plan.notes:
            self._separation.rebase(plan)
            return True
        if self._proposed is None or self._proposed[1] is not plan:
            return False
        admitted = self._separation.admitted(self._proposed[0])
        if not admitted:
            self._separation.withdraw()
        return admitted

    def adopted(self, t: float, plan: Plan) -> None:
        """Note that the vehicle flies ``plan`` from t [s] on."""
        if self._proposed is not None and self._proposed[1] is plan and self._separation.admitted(self._proposed[0]):
            self._separation.adopt(t)
        self._flown = plan

    def _taking_part(self) -> tuple[tuple[str, str], ...]:
        """What to record where the vehicle becomes an outlier, or takes part again."""
        outlier = self._consensus.outlier and self._flown is not None
        if outlier == self._outlier:
            return ()
        self._outlier = outlier
        return (
            ("outlier", "it follows what the others agree on") if outlier else ("outlier-returns", "it takes part"),
        )

    def _planner_messages(self, t: float) -> tuple[Message, ...]:
        agreed = self._consensus.value
        if not math.isfinite(agreed):
            return ()
        arrival = self._grid * math.ceil(agreed / self._grid - _ROUNDING)
        if arrival == self._announced:
            return ()
        self._announced = arrival
        return (Message(t, self._separation.name, ARRIVAL, arrival),)
