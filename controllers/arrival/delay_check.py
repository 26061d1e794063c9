"""Separation of vehicles by the delay check of RMADER: sound as long as messages take less than a declared time.

Kondo, Figueroa, Rached, Tordesillas, Lusk and How, "Robust MADER: decentralized multiagent trajectory planner robust to
communication delay in dynamic environments" (arXiv 2303.06222). A vehicle that has an *optimised* trajectory

  1. checks it against all trajectories received so far, committed and optimised ones, and drops it in a conflict;
  2. publishes it, flies on by the one *committed* before, and for delta_DC checks it against all that arrives;
  3. commits to it, and publishes it as committed, if there was no conflict; otherwise it stays with the one before.

A committed trajectory takes the place of all that its receiver has stored of that sender. There are no answers.

**Guarantee.** Let every message arrive within delta_DC > 0. Of two vehicles whose optimised trajectories are in
conflict let i be the first to publish. By the time at which j could commit it has received i's trajectory, and drops
its own. So committed trajectories are D (``Zone``) apart. **A message that takes longer, or is lost, voids the
guarantee**, and neither vehicle notices: ``mathnavi.controllers.arrival.separation`` is a rule that needs no bound.

Where the paper leaves a choice, the one that favours its rule is made:
  - vehicles plan at the same instants here, and asynchronously there: each publishes after a random wait;
  - the links there repeat what is lost: each message is sent again in every exchange;
  - messages may overtake each other: trajectories are numbered, and an old one replaces no new one;
  - a published trajectory that was dropped blocks no vehicle: the committed one is published again in its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.controllers.arrival.separation_rule import TOPIC, Zone, check_content, objection
from mathnavi.interfaces.checks import check, check_names
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Event, Message, Plan
from mathnavi.models.aerial.plan_distance import PlannedTrajectory
from mathnavi.models.tolerances import TIME_TOLERANCE


@dataclass(frozen=True)
class Published:
    """Trajectory that a vehicle flies from now on: the plan before, up to the start of the new one, then that."""

    id: int  # of this vehicle, increasing
    trajectory: PlannedTrajectory
    committed: bool  # False: optimised

    def __post_init__(self) -> None:
        check_content(self.id, self.trajectory)
        if not isinstance(self.committed, bool):
            raise ArgumentError(f"committed = {self.committed!r}; allowed: True, False")


@dataclass
class _Candidate:
    """The plan that a vehicle would like to fly."""

    id: int
    plan: PlannedTrajectory
    trajectory: PlannedTrajectory  # the plan, and up to its start the one before
    begin: float  # [s] not published before
    published: float | None = None  # [s]
    committed: bool = False

    @property
    def start(self) -> float:
        return float(self.plan.t[0])


class DelayCheck:
    """The ``SeparationRule`` of one vehicle, by the delay check.

    ``events``: ``separation-refused``, ``separation-late`` (not committed by its start), ``separation-ignored`` (an
    impossible message) and ``separation-unguaranteed`` (it flies another plan than it has committed to).
    """

    binding = True

    def __init__(
        self,
        name: str,
        peers: Sequence[str],
        zone: Zone,
        current: Plan | PlannedTrajectory,
        rng: np.random.Generator,
        delay: float,
        wait: float = 0.0,
        step: float = 0.0,
    ) -> None:
        """``peers`` are all other vehicles, ``current`` is the plan that ``checked_start`` passed.

        ``delay`` [s] is delta_DC; ``wait`` [s] the longest random wait before a plan is published, which it is at the
        latest ``delay`` and two periods ``step`` [s] of the exchange before its start. ValueError for a name twice and
        for a time that is negative or not finite.
        """
        check_names([name, *peers])
        check(delay, "delay", 0.0)
        check(wait, "wait", 0.0)
        check(step, "step", 0.0)
        self.name, self.peers, self.zone = name, tuple(peers), zone
        self.events: list[Event] = []
        self.guaranteed = True
        self._delay, self._wait, self._step, self._rng = delay, wait, step, rng
        self._current = PlannedTrajectory.from_plan(current)
        self._committed = Published(0, self._current, committed=True)
        self._candidate: _Candidate | None = None
        self._last_id = 0
        self._stored: dict[str, dict[int, Published]] = {peer: {} for peer in peers}

    @property
    def pending(self) -> int | None:
        """Identifier of the proposal that is underway or committed to."""
        return self._candidate.id if self._candidate else None

    @property
    def unheard(self) -> tuple[str, ...]:
        """Empty: this rule asks for no answers."""
        return ()

    def propose(self, plan: Plan | PlannedTrajectory) -> int:
        """Make a plan pending, in place of one that may be, and return its id.

        ValueError for what ``PlannedTrajectory.from_plan`` refuses: that is never pending.
        """
        trajectory = PlannedTrajectory.from_plan(plan)
        self.withdraw()
        self._last_id += 1
        begin = float(trajectory.t[0]) - self._delay - 2.0 * self._step - self._wait * float(self._rng.random())
        self._candidate = _Candidate(self._last_id, trajectory, joined(self._current, trajectory), begin)
        return self._last_id

    def withdraw(self) -> None:
        """Give up the pending plan, if there is one; the guarantee is lost if it was committed to."""
        candidate, self._candidate = self._candidate, None
        if candidate is not None and candidate.committed:
            self._stay(candidate.start)
        elif candidate is not None and candidate.published is not None:
            self._committed = Published(candidate.id, self._current, committed=True)

    def admitted(self, id: int) -> bool:
        """True if this proposal is pending and has been committed to."""
        return self._candidate is not None and self._candidate.id == id and self._candidate.committed

    def adopt(self, t: float) -> None:
        """Make the plan committed to the one being flown from t [s] on, at the hand-over.

        ArgumentError if no plan is committed to, or before its start.
        """
        candidate = self._candidate
        if candidate is None or not candidate.committed:
            raise ArgumentError(f"pending = {self.pending!r} of {self.name}; allowed: a proposal that is committed to")
        if t < candidate.start - TIME_TOLERANCE:
            raise ArgumentError(f"t = {t!r} of {self.name}; allowed: >= {candidate.start!r}, where the plan starts")
        self._current, self._candidate, self.guaranteed = candidate.plan, None, True

    def rebase(self, plan: Plan | PlannedTrajectory) -> None:
        """Note that the vehicle left its plan and flies this one unchecked: no guarantee until it next adopts one."""
        self._candidate, self.guaranteed = None, False  # which is announced where the plan takes over
        self._current = PlannedTrajectory.from_plan(plan)
        self._stay(float(self._current.t[0]))

    def exchange(self, t: float, received: Sequence[Message]) -> list[tuple[str, Message]]:
        """Process the messages received by t [s] of this vehicle's clock; return those to send, with the receivers."""
        arrived = [each for message in received if message.topic == TOPIC for each in self._taken(message, t)]
        self._proceed(t, arrived)
        candidate, messages = self._candidate, [self._committed]
        if candidate is not None and candidate.published is not None and not candidate.committed:
            messages.append(Published(candidate.id, candidate.trajectory, committed=False))
        published = [Message(t, self.name, TOPIC, each) for each in messages]
        return [(peer, message) for message in published for peer in self.peers]

    def _taken(self, message: Message, t: float) -> tuple[Published, ...]:
        """Store a message's trajectory; return it if it is new."""
        if wrong := objection(message, t, self._stored, self.zone, Published):
            self._record(t, "ignored", wrong)
            return ()
        stored, one = self._stored[message.sender], message.payload
        known = stored.get(one.id)
        if known is one:
            return ()
        last = max((each.id for each in stored.values() if each.committed), default=-1)
        if one.id < last or (known is not None and known.committed >= one.committed):
            return ()
        if one.committed:
            self._stored[message.sender] = stored = {id: each for id, each in stored.items() if id > one.id}
        stored[one.id] = one
        return (one,)

    def _proceed(self, t: float, arrived: Sequence[Published]) -> None:
        """Check the pending plan against what is known; publish it, commit to it or drop it when that falls due."""
        candidate = self._candidate
        if candidate is None or t < candidate.begin - TIME_TOLERANCE:
            return
        if candidate.committed:
            if t > candidate.start + self._step + TIME_TOLERANCE:
                self.withdraw()  # it has not been adopted
            return
        if t > candidate.start + TIME_TOLERANCE:
            self._record(t, "late", f"proposal {candidate.id}")
            self.withdraw()
            return
        if candidate.published is None:
            arrived = [each for stored in self._stored.values() for each in stored.values()]
        others = [each.trajectory for each in arrived]
        if not all(self.zone.kept_from_each(candidate.trajectory, others, np.full(len(others), t))):
            self._record(t, "refused", f"proposal {candidate.id}")
            self.withdraw()
        elif candidate.published is None:
            candidate.published = t
        elif t >= candidate.published + self._delay - TIME_TOLERANCE:
            candidate.committed = True
            self._committed = Published(candidate.id, candidate.trajectory, committed=True)

    def _stay(self, t: float) -> None:
        """Commit to the plan being flown at t [s] without a check."""
        self._last_id += 1
        self._committed = Published(self._last_id, self._current, committed=True)
        if self.guaranteed:
            self._record(t, "unguaranteed", "it flies a plan that it has not checked")
        self.guaranteed = False

    def _record(self, t: float, kind: str, message: str) -> None:
        self.events.append(Event(t, self.name, f"separation-{kind}", message))


def joined(before: PlannedTrajectory, after: PlannedTrajectory) -> PlannedTrajectory:
    """Join two trajectories: the first up to the start of the second, then the second."""
    start = float(after.t[0])
    kept = int(np.searchsorted(before.t, start - TIME_TOLERANCE))
    t, x, u = before.t[:kept], before.x[:kept].copy(), before.u[:kept]
    if len(u) < kept:  # at rest between the two
        x[-1, 3:] = 0.0
        u = np.vstack([u, np.zeros((1, 3))])
    arcs = np.vstack([u, after.u])
    return PlannedTrajectory.from_plan(
        Plan(np.concatenate([t, after.t]), np.vstack([x, after.x]), arcs, np.zeros(len(arcs), np.int64))
    )
