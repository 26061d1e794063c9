"""Separation of vehicles by acknowledged plans: sound though messages are lost, late, doubled or cut off.

Own_i = {current, pending} are the plans that vehicle i flies or may come to fly. i *proposes* pi' under an id that is
never used again; pi' is pending from then on, before any other vehicle receives it. j answers a proposal once, in one
step with its check: it acknowledges if and only if pi' keeps the zone from all of Own_j. i *adopts* pi' at its start
time t_s if every other vehicle has acknowledged it, and then Own_i = {pi'}; otherwise the stored plan stays. i may
withdraw pi' at any time before: a plan that is not adopted is never flown.

**Invariant.** Current plans are pairwise at least D (``Zone``) apart for all future time.

Proof. It holds at the start (``checked_start``), and only an adoption can break it. Let j adopt pi_j at T* while i
flies pi_i, and let T_a be when i checked pi_j, T_a < T*, for j counts only acknowledgements of this id.
  1. If pi_i was in Own_i at T_a, it was checked then against pi_j, from T_a (or when both may be flown) on for ever.
  2. Otherwise i proposed pi_i after T_a, as a plan enters Own_i only so, and adopted it by T*. So j checked it at some
     T_b, T_a < T_b <= T*. pi_j had been proposed before T_a and was adopted at T* and not withdrawn, for then its id
     were void: so it was in Own_j at T_b, and pi_i was checked against it.
The proof assumes nothing on when messages arrive, or whether they do. Two adoptions at one instant are the case of
either order.

What follows from this for the corners:
  - *j need not remember what it acknowledged*: what it later proposes itself i will check, against Own_i, which has
    held pi_i since before j received it. It does remember its latest answer to each, so that a copy of a proposal gets
    the same answer again, as if the first had been late or doubled, and costs no second check.
  - *i withdraws after some acknowledgements*: they are for an id that is void, and are ignored whenever they arrive.
    No vehicle has to be informed.
  - *j adopts its pending plan between the check and the adoption of i*: pi_i was checked against it while pending.
  - *j proposes after it acknowledged pi_i*: case 2 with the roles changed; i refuses, or one of both gives way.
  - *A check covers only when both plans may be flown*: a current plan from now on, a pending one from its start. Until
    then its vehicle flies what is current, which is checked as well.
  - *Memory lost, or ids used again after a restart*, are outside of this; so are clocks that run backwards.

**Conflicts.** Each proposal carries a rank, drawn from the generator at hand. j gives way, it withdraws its own pending
plan and acknowledges, if that plan is all that is in the way, is not yet admitted, and has the lower (rank, name). Any
other conflict is refused, and a refused proposal is withdrawn. There is no livelock: among proposals in conflict the
highest gives way to none and is refused only for plans that are flown or admitted. Ranks are drawn again each time, so
where n vehicles propose once a period a proposal that clears those is the highest with probability 1/n at least: no
vehicle starves, and no fixed order lets one whose plan is hopeless block the others for ever. A vehicle that waits
flies its stored plan.

**Out of reach.** A plan is the whole way to the target, and is compared with others for all future time. So distance
alone makes no vehicle irrelevant: one out of the radio's range, or silent, may not be left out, and no plan is admitted
until it has acknowledged. What is lost is the new plans, not the separation: every vehicle flies its stored plan.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numba import float64

from mathnavi.controllers.arrival.separation_rule import TOPIC, Zone, check_content, objection
from mathnavi.controllers.flight.ahead import PLAN
from mathnavi.interfaces.checks import check_names
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.kernel_types import ONE, TWO
from mathnavi.interfaces.signals import Event, Message, Plan
from mathnavi.models.aerial.kernels import state_on
from mathnavi.models.aerial.plan_distance import PlannedTrajectory, _least_squared
from mathnavi.models.tolerances import TIME_TOLERANCE


@dataclass(frozen=True)
class Proposal:
    """Proposal of a vehicle i to fly a trajectory from its start on."""

    id: int  # of this vehicle, increasing
    rank: float
    trajectory: PlannedTrajectory

    def __post_init__(self) -> None:
        check_content(self.id, self.trajectory)
        if not (isinstance(self.rank, float) and math.isfinite(self.rank)):
            raise ArgumentError(f"rank = {self.rank!r}; allowed: a finite number")


@dataclass(frozen=True)
class SeparationReply:
    """Reply of a vehicle j to a proposal."""

    id: int  # of the proposal
    clear: bool

    def __post_init__(self) -> None:
        check_content(self.id)
        if not isinstance(self.clear, bool):
            raise ArgumentError(f"clear = {self.clear!r}; allowed: True, False")


class Separation:
    """The ``SeparationRule`` of one vehicle, by acknowledged plans.

    ``events`` are those since they were last taken: ``separation-refused``, ``separation-yielded``,
    ``separation-late`` (not admitted by its start) and ``separation-ignored`` (an impossible message).
    """

    binding = False

    def __init__(
        self, name: str, peers: Sequence[str], zone: Zone, current: Plan | PlannedTrajectory, rng: np.random.Generator
    ) -> None:
        """``peers`` are all other vehicles, ``current`` is from ``checked_start``; ValueError for a name twice."""
        check_names([name, *peers])
        self.name, self.peers, self.zone = name, tuple(peers), zone
        self.events: list[Event] = []
        self.guaranteed = True  # False from a ``rebase`` to the next adoption
        self._current = PlannedTrajectory.from_plan(current)
        self._pending: Proposal | None = None
        self._acknowledged: set[str] = set()  # vehicles that have acknowledged the pending proposal
        self._known = dict.fromkeys(peers)  # as ``peers``, to be found at once
        self._rng = rng
        self._last_id = 0
        self._answered: dict[str, SeparationReply] = {}  # the latest to each
        self._reply = SeparationReply(0, clear=False)  # the latest of all, to be given again where it is the same

    @property
    def pending(self) -> int | None:
        """Identifier of the proposal that is underway or admitted."""
        return self._pending.id if self._pending else None

    @property
    def own(self) -> tuple[PlannedTrajectory, ...]:
        """Own_i: the trajectory being flown, and the one that may come to be."""
        return (self._current, self._pending.trajectory) if self._pending else (self._current,)

    def propose(self, plan: Plan | PlannedTrajectory) -> int:
        """Make a plan pending, in place of one that may be, and return its id; ``exchange`` sends it to the others.

        ValueError for what ``PlannedTrajectory.from_plan`` refuses: that is never pending.
        """
        trajectory = PlannedTrajectory.from_plan(plan)
        self.withdraw()
        self._last_id += 1
        self._pending = Proposal(self._last_id, float(self._rng.random()), trajectory)
        return self._last_id

    @property
    def unheard(self) -> tuple[str, ...]:
        """Vehicles that have not acknowledged the pending proposal; empty without one."""
        if self._pending is None or len(self._acknowledged) == len(self.peers):
            return ()
        return tuple(peer for peer in self.peers if peer not in self._acknowledged)

    def withdraw(self) -> None:
        """Give up the pending plan, if there is one; its id is void for ever."""
        self._pending = None
        self._acknowledged = set()

    def admitted(self, id: int) -> bool:
        """True if this proposal is pending and every other vehicle has acknowledged it."""
        return self.pending == id and len(self._acknowledged) == len(self.peers)

    def adopt(self, t: float) -> None:
        """Make the admitted plan the one being flown from t [s] on, at the hand-over.

        ArgumentError if no plan is admitted, or before its start: until then the vehicle flies the plan before.
        """
        if self._pending is None or not self.admitted(self._pending.id):
            raise ArgumentError(
                f"pending = {self.pending!r} of {self.name}; allowed: a proposal that all have acknowledged"
            )
        start = self._pending.trajectory.begin
        if t < start - TIME_TOLERANCE:
            raise ArgumentError(f"t = {t!r} of {self.name}; allowed: >= {start!r}, where the plan starts")
        self._current = self._pending.trajectory
        self.guaranteed = True
        self.withdraw()

    def rebase(self, plan: Plan | PlannedTrajectory) -> None:
        """Note that the vehicle left its plan and flies this one unchecked: no guarantee until it next adopts one.

        The others receive it as their proposals are checked against it. The invariant holds again between any two
        that have adopted a plan since they were last rebased: the proof is about adopted plans only.
        """
        self._current = PlannedTrajectory.from_plan(plan)
        self.guaranteed = False
        self.withdraw()

    def exchange(self, t: float, received: Sequence[Message]) -> list[tuple[str, Message]]:
        """Process the messages received by t [s] of this vehicle's clock; return those to send, with the receivers.

        These are answers, and the pending proposal again to each that has not answered it. A proposal that is not
        admitted when its start has passed is withdrawn: it came too late.
        """
        if (
            self._pending
            and t > self._pending.trajectory.begin + TIME_TOLERANCE
            and not self.admitted(self._pending.id)
        ):
            self._record(t, "late", f"proposal {self._pending.id}: {', '.join(self.unheard)} have not acknowledged it")
            self.withdraw()
        answers: dict[str, SeparationReply] = {}
        heard: list[tuple[Message, str]] = []
        asking: list[Message] = []  # with a proposal that is newer than what its sender has been answered
        for message in received:
            if message.topic == TOPIC:
                wrong = objection(message, t, self._known, self.zone, Proposal, SeparationReply)
                heard.append((message, wrong))
                if not wrong and isinstance(message.payload, Proposal):
                    before = self._answered.get(message.sender)
                    if before is None or before.id < message.payload.id:
                        asking.append(message)
        kept = self._kept(t, asking)
        for message, wrong in heard:
            if wrong:
                self._record(t, "ignored", wrong)
            elif isinstance(message.payload, SeparationReply):
                self._take(message.sender, message.payload, t)
            elif answer := self._answer(message, t, kept):
                answers[message.sender] = answer
        outgoing: list[tuple[str, Message]] = []
        reply: Message | None = None
        for sender, answer in answers.items():
            if reply is None or reply.payload is not answer:
                reply = Message(t, self.name, TOPIC, answer)  # one for all that get the same answer
            outgoing.append((sender, reply))
        if self._pending and len(self._acknowledged) < len(self.peers):
            again = Message(t, self.name, TOPIC, self._pending)
            outgoing += [(peer, again) for peer in self.peers if peer not in self._acknowledged]
        return outgoing

    def _kept(self, t: float, asking: Sequence[Message]) -> dict[int, tuple[bool, bool]]:
        """Check if each proposal keeps the zone from the current plan and from the pending one, by id() of its message.

        All are checked at once, and before any is answered: what Own holds only goes while they are answered.
        """
        if not asking:
            return {}
        theirs = [message.payload.trajectory for message in asking]
        begins = np.maximum(t, [each.begin for each in theirs])  # not flown before
        from_current = self.zone.kept_from_each(self._current, theirs, begins)
        if (mine := self._pending) is None:
            return {id(message): (kept, True) for message, kept in zip(asking, from_current, strict=True)}
        from_pending = self.zone.kept_from_each(mine.trajectory, theirs, np.maximum(begins, mine.trajectory.begin))
        return dict(zip(map(id, asking), zip(from_current, from_pending, strict=True), strict=True))

    def _take(self, sender: str, answer: SeparationReply, t: float) -> None:
        """Count an answer to the pending proposal; any other is void."""
        if self._pending is None or answer.id != self._pending.id:
            return
        if answer.clear:
            self._acknowledged.add(sender)
        elif sender not in self._acknowledged:
            self._record(t, "refused", f"proposal {answer.id}, by {sender}")
            self.withdraw()

    def _answer(self, message: Message, t: float, kept: Mapping[int, tuple[bool, bool]]) -> SeparationReply | None:
        """Check a proposal and reply; a copy gets the same reply again, one older than the latest gets none."""
        sender, proposal = message.sender, message.payload
        before = self._answered.get(sender)
        if before is None or before.id < proposal.id:
            clear = self._clears_all(sender, proposal, t, *kept[id(message)])
            if (self._reply.id, self._reply.clear) != (proposal.id, clear):
                self._reply = SeparationReply(proposal.id, clear)
            self._answered[sender] = self._reply
        elif before.id > proposal.id:
            return None
        return self._answered[sender]

    def _clears_all(self, sender: str, proposal: Proposal, t: float, from_current: bool, from_pending: bool) -> bool:
        """True if a proposal clears all of Own; what is in its way may give way.

        ``from_pending`` counts while the plan is pending.
        """
        if not from_current:
            return False
        mine = self._pending
        if mine is None or from_pending:
            return True
        if self.admitted(mine.id) or (mine.rank, self.name) > (proposal.rank, sender):
            return False
        self._record(t, "yielded", f"proposal {mine.id}, to {proposal.id} of {sender}")
        self.withdraw()
        return True

    def _record(self, t: float, kind: str, message: str) -> None:
        self.events.append(Event(t, self.name, f"separation-{kind}", message))


# Kernels that are compiled before a run (``sim.engine.compilation``), for arguments of these types.
KERNELS: tuple[Signature, ...] = (
    (_least_squared, (*PLAN, *PLAN, float64, float64)),
    (state_on, (ONE, TWO, TWO, float64)),
)
