"""The deadline by which a certified flight arrives: what moves it, and its announcements.

It is D = t_s + gamma V, of the first plan, which starts at t_s and lasts V. A missed pass, a plan made again and a
target that moved put it off; each is a note on the plan with which that happens.
"""

from __future__ import annotations

import numpy as np

from mathnavi.controllers.flight.certificate import Certificate, pass_time
from mathnavi.interfaces.signals import Plan
from mathnavi.models.tolerances import TIME_TOLERANCE


class PromisedArrival:
    """Deadline of one vehicle, and whether the plan that is flown leads to where its target is now."""

    def __init__(self, factor: float, period: float) -> None:
        """``factor`` is gamma, ``period`` [s] that of the planning instants."""
        self.deadline = np.inf  # [s] in force now
        self.promised = np.inf  # [s] the deadline without what was lost: missed passes, and rebased plans
        self._factor, self._period = factor, period
        self._next_pass = np.inf  # [s] of the plan that was being flown at the last request
        self._astray = 0  # planning instants at which it has led elsewhere
        self._announced = False  # True once that was announced

    def begin(self, plan: Plan, certificate: Certificate, t: float) -> None:
        """Begin with the first plan, adopted at t [s]."""
        self.deadline = self.promised = t + self._factor * (plan.t_end - t)
        self._next_pass = pass_time(plan, certificate.target, t)

    def target_moved(self) -> None:
        """Forget the pass of a target that the vehicle will not find where it was."""
        self._next_pass = np.inf

    def missed(self, current: Plan, certificate: Certificate, t: float) -> tuple[str, ...]:
        """Notes at a planning instant: the mission goes on after a pass, which says that the pass was missed."""
        missed = self._next_pass < t - TIME_TOLERANCE  # one at this very tick may still be judged
        self._next_pass = pass_time(current, certificate.target, t - 2.0 * TIME_TOLERANCE)
        if not missed:
            return ()
        left = max(current.t_end - t, self._period)
        self.deadline = max(self.deadline, t + self._factor * left)
        return ("missed-pass",)

    def followed(self, current: Plan, certificate: Certificate) -> tuple[str, ...]:
        """Notes on the plan being flown after the target has moved: it leads there, or not yet."""
        if not certificate.reaches_target(current):
            self._astray += 1
            return self._announce() if self._astray > 1 else ()
        notes: tuple[str, ...] = ("arrival-regained",) if self._announced else ()
        if self._astray and current.t_end > self.deadline + TIME_TOLERANCE:
            self.deadline = self.of(current)
            self.promised = max(self.promised, self.deadline)
            notes = (*notes, "deadline-moved")
        self._astray, self._announced = 0, False
        return notes

    def following(self, current: Plan, plan: Plan, certificate: Certificate) -> tuple[str, ...]:
        """Notes on the plan being flown where it does not lead to the target and ``plan`` cannot take over."""
        there = plan.ok and plan.ready <= plan.t_start + TIME_TOLERANCE
        return () if there or certificate.reaches_target(current) else self._announce()

    def extended(self, plan: Plan, certificate: Certificate, t: float) -> tuple[str, ...]:
        """Notes on a plan that takes over even if late: "deadline-lost" if it is, and its end is the new deadline."""
        self._next_pass = pass_time(plan, certificate.target, t)
        if plan.t_end <= self.deadline:
            return ()
        self.deadline = plan.t_end
        return ("deadline-lost",)

    def of(self, plan: Plan) -> float:
        """Deadline [s] of a plan to a target that has moved."""
        return max(self.deadline, plan.t_start + self._factor * (plan.t_end - plan.t_start))

    def _announce(self) -> tuple[str, ...]:
        """Announce, once, that the plan being flown leads elsewhere."""
        before, self._announced = self._announced, True
        return () if before else ("arrival-lost",)
