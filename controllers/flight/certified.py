"""The invariant behind "never collides, always arrives": nothing is flown that has not been certified whole.

``Certified`` keeps the invariant, at every t before arrival:

    x(t) = x_pi(t) (within the tracking bound),  C(pi),  t_e <= gamma V_0.

That the vehicle is within the bound is known as well as its estimate is: at every control step the estimate must be as
good as was declared when the bound was made, and within the bound of the plan.

A candidate replaces the plan being flown at its start time if and only if it starts on it, is certified, and ends by
the deadline. Otherwise the stored plan stays, which is safe and arrives. This is Propositions A.2 and A.3, made true
for arcs instead of nodes, for any planner. The one exception is announced before it is flown: where the map turns out
to be wrong and nothing can be certified any more, of two plans that cannot the one with more clearance is flown.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from mathnavi.controllers.flight.certificate import (
    STATE_TOLERANCE,
    Certificate,
    Refusal,
    TrackingBound,
    remainder,
)
from mathnavi.controllers.flight.guarantee import Evidence, Guarantee, doubt
from mathnavi.controllers.flight.held_input import NO_LAG, HeldInput
from mathnavi.controllers.flight.planner import StopAndHover
from mathnavi.controllers.flight.promised_arrival import PromisedArrival
from mathnavi.interfaces.boundary import Unusable, answered, guest, handed, usable_plan
from mathnavi.interfaces.errors import ArgumentError, PluginError
from mathnavi.interfaces.protocols import Planner
from mathnavi.interfaces.signals import Array, Estimate, Message, Plan, PlanRequest, Status
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.kernels import offset_from
from mathnavi.models.aerial.knowledge import Knowledge
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.aerial.plan_status import FlightPhase, FlightStatus
from mathnavi.models.tolerances import TIME_TOLERANCE

Certifier = Callable[[Planner, FlightMission, Any], Planner]
"""function (planner, mission, tracker) -> planner whose plans may be flown"""

_ROUNDING = 1e-3  # of a number of control periods

Decision = tuple[Plan | None, Evidence]


class Certified:
    """A planner all of whose plans are certified, and that falls back on a safe plan where it finds one.

    ``fallback(certificate)`` makes the planner that is used where there is no plan to fall back on: at the start, when
    the vehicle has left its plan, and when its plan turns out to be unsafe.

    At every control step ``plan`` or ``monitor`` is called, and ends in a step of ``guarantee``, whose events say what
    is guaranteed. ``monitor`` checks what cannot wait for the next planning instant. *A vehicle outside its tracking
    bound* ("tracking-breach"): a plan from its estimate takes over at once, or the guarantee is lost. *An estimate that
    is lost, or worse than declared*: the guarantee is lost, and the plan being flown stays, for it is the best guess of
    where the vehicle is.

    New information (``mathnavi.models.aerial.knowledge``) is checked at the next planning instant, a map as soon as it
    arrives. *A map that was wrong*: if what is left of the plan being flown is safe over the new map, the guarantee is
    kept. Otherwise a certified plan from where the plan is now takes over without delay ("plan-endangered"); if none
    exists, the guarantee is lost, the present plan or that of the fallback planner is flown, the one with more
    clearance, and the search goes on at every period until there is one. *A target elsewhere*: the vehicle is as safe
    as before, but its plan leads to where the target was. The first certified plan that leads to the new one takes
    over, and if it ends after the deadline, the deadline is D = t_s + gamma V from then on, t_s its start
    ("deadline-moved"). Where none has taken over by the next instant the loss is announced ("arrival-lost") until one
    has.
    """

    def __init__(
        self,
        planner: Planner,
        fallback: Callable[[Certificate], Planner],
        certificate: Certificate,
        bound: TrackingBound,
        deadline_factor: float,
        worst: tuple[float, float] = (np.inf, np.inf),
        start: Array | None = None,
    ) -> None:
        """``worst`` are the declared standard deviations of an estimate's position [m] and velocity [m/s], per axis, at
        their worst; ``bound`` was made with them. ``start`` (6,) is the state in which the mission begins, if known:
        the first plan begins there unless the estimate is outside the bound about it.
        """
        if not deadline_factor >= 1.0:
            raise ArgumentError(f"deadline_factor = {deadline_factor!r}; allowed: >= 1")
        self.period = planner.period
        self.guarantee = Guarantee()
        self._planner, self._make_fallback = planner, fallback
        self._fallback = fallback(certificate)
        self._certificate, self._bound, self._worst, self._start = certificate, bound, worst, start
        self._arrival = PromisedArrival(deadline_factor, planner.period)
        self._unsurveyed = False  # True if the plan being flown was certified over another map
        self._why_none = ""  # why there is no certified plan from where the vehicle is, until the next planning instant
        self._untracked = ""  # why the tracker's last command could not be used
        self._evidence = Evidence()  # of the last control step
        self._flown: Plan | None = None  # the plan being flown, at the last request
        self._lag, self._lag_t = NO_LAG, 0.0  # (6,) [m, m/s] of the vehicle behind it, at [s]

    @property
    def deadline(self) -> float:
        """Deadline [s] in force now."""
        return self._arrival.deadline

    def arrive_by(self, deadline: float) -> None:
        """Set the deadline [s] from outside, as that of a fleet is."""
        self._arrival.deadline = deadline

    @property
    def promised(self) -> float:
        """Deadline [s] without what was lost."""
        return self._arrival.promised

    @staticmethod
    def for_mission(planner: Planner, mission: FlightMission, tracker: Any) -> Certified:
        """Wrap a planner with the certificate of a mission; errors as of ``Certificate.for_mission``.

        ``tracker`` states its ``bound``, and ``held`` if that depends on how fast a plan changes. Where there is no
        plan to fall back on, one that stops and hovers flies in its place. Raises PluginError for a planner whose plans
        begin between two commands of such a tracker.
        """
        held: HeldInput | None = getattr(tracker, "held", None)
        if held is not None:
            periods = planner.period / held.period
            if abs(periods - round(periods)) > _ROUNDING:
                raise PluginError(
                    f"the planner's period = {planner.period!r} s; allowed: a whole number of control periods of "
                    f"{held.period:.6g} s, for its plans are certified for commands that are held so long"
                )
        certificate = Certificate.for_mission(mission, tracker.bound, held)
        fallback = partial(StopAndHover, period=planner.period)
        worst = mission.quality.worst(mission.gust)
        return Certified(
            planner, fallback, certificate, tracker.bound, mission.deadline_factor, worst, mission.start_state
        )

    def plan(self, request: PlanRequest) -> Plan:
        """Return the planner's plan if it may be flown, otherwise a failure with the reason."""
        plan = self._concluded(self._planned, request)
        assert plan is not None
        return plan

    def monitor(self, request: PlanRequest) -> Plan | None:
        """Check at a control step what cannot wait for the next planning instant.

        Returns a plan that takes over at once, a failure to find one, or None. The request's messages are those of the
        next one too.
        """
        return self._concluded(self._monitored, request)

    def commanded(self, reason: str) -> None:
        """Note why the tracker's command cannot be used, so that its bound is not kept; "" once one can be used."""
        self._untracked = reason
        self.guarantee.step(dataclasses.replace(self._evidence, untracked=reason))

    def events(self) -> list[tuple[str, str]]:
        """Kind and message of what was announced of the guarantee since the last call."""
        return self.guarantee.events()

    def _concluded(self, decide: Callable[[PlanRequest], Decision], request: PlanRequest) -> Plan | None:
        """Decide on a request, and conclude from the evidence what is guaranteed, whatever happens."""
        found = answered(decide, request)
        # One that raised is a defect here, after which nothing is known of the plan being flown.
        plan, evidence = (found.plan, Evidence(uncertified=found.reason)) if isinstance(found, Unusable) else found
        self._evidence = dataclasses.replace(evidence, untracked=self._untracked) if self._untracked else evidence
        self.guarantee.step(self._evidence)
        return plan

    def _planned(self, request: PlanRequest) -> Decision:
        notes = self._listen(request.messages)
        current, reason = request.current, doubt(request.estimate, self._worst)
        doubted = self.guarantee.doubted(request.estimate, reason)
        if current is None:
            asked = self._from_start(request)
            plan = self._fresh(asked)
            if plan.ok:
                self._arrival.begin(plan, self._certificate, request.t)
            self._why_none = "" if plan.ok else plan.message or str(plan.status.value)
            contradicts = self._start is not None and asked is request
            outside = "the first estimate contradicts the start of the mission" if contradicts else ""
            evidence = dataclasses.replace(doubted, uncertified=self._why_none, outside=outside)
            return dataclasses.replace(plan, notes=notes + plan.notes), evidence
        notes += self._arrival.followed(current, self._certificate)
        notes += self._arrival.missed(current, self._certificate, request.t)
        self._follow(current, request.t)
        self._why_none = ""
        if not reason and (far := self._breach(request)):
            return self._left(request, current, far, notes)
        if (danger := self._danger(current, request.t)) is not None:
            # Of a doubted estimate the position is unknown: the plan is the best guess, as it is at all other times.
            answer, evidence = self._endangered(request, current, danger, notes)
            return answer, dataclasses.replace(evidence, waiting=doubted.waiting, doubt=doubted.doubt)
        plan = self._judged(self._planner, request)
        notes += self._arrival.following(current, plan, self._certificate)
        return dataclasses.replace(plan, notes=notes + plan.notes), self._on_plan(request.estimate, doubted)

    def _monitored(self, request: PlanRequest) -> Decision:
        current, reason = request.current, doubt(request.estimate, self._worst)
        self._listen(request.messages)
        doubted = self.guarantee.doubted(request.estimate, reason)
        if current is None:
            return None, dataclasses.replace(doubted, uncertified=self._why_none or "there is no plan yet")
        self._follow(current, request.t)
        if request.messages and (danger := self._danger(current, request.t)) is not None:
            plan, evidence = self._endangered(request, current, danger, ())
            return plan, dataclasses.replace(evidence, waiting=doubted.waiting, doubt=doubted.doubt)
        if not reason and (far := self._breach(request)):
            if self._why_none:
                return None, Evidence(uncertified=f"{far}; {self._why_none}")
            return self._left(request, current, far, ())
        return None, self._on_plan(request.estimate, doubted)

    def _on_plan(self, estimate: Estimate, doubted: Evidence) -> Evidence:
        """Evidence for a vehicle that flies on along its plan."""
        uncertified = self._why_none if self._unsurveyed else ""
        fast = "" if doubted.doubt else self._certificate.speeding(estimate.x, self._bound)
        if not (uncertified or fast):
            return doubted
        return dataclasses.replace(doubted, uncertified=uncertified, fast=fast)

    def _from_start(self, request: PlanRequest) -> PlanRequest:
        """The first request, from the start that the mission states unless the estimate contradicts it."""
        if self._start is None:
            return request
        error = request.estimate.x - self._start
        if self._bound.broken_by(error) or not np.linalg.norm(error[3:]) <= self._bound.speed:
            return request
        return dataclasses.replace(request, estimate=dataclasses.replace(request.estimate, x=self._start))

    def _breach(self, request: PlanRequest) -> str:
        """Say how far outside its tracking bound the vehicle is; "" for one within."""
        assert request.current is not None
        plan = request.current
        return self._bound.how_far(offset_from(plan.t, plan.x, plan.u, request.t, request.estimate.x))

    def _left(self, request: PlanRequest, current: Plan, far: str, notes: tuple[str, ...]) -> Decision:
        """Fly on from the estimate of a vehicle that has left its plan."""
        answer = self._rebased(request, request.estimate, (*notes, "tracking-breach"), far)
        if answer.ok:
            return answer, Evidence(outside=far)
        self._why_none = answer.message
        if self._danger(current, request.t) is not None:
            answer = self._evading(answer, request)
        return answer, Evidence(uncertified=answer.message)

    def _endangered(self, request: PlanRequest, current: Plan, danger: Refusal, notes: tuple[str, ...]) -> Decision:
        """Leave the plan being flown from where it is now."""
        here = dataclasses.replace(request, estimate=Estimate(request.t, state_at(current, request.t)))
        reason = f"over the new map: {danger.message}"
        answer = self._rebased(here, here.estimate, (*notes, "plan-endangered"), reason)
        if answer.ok:
            return answer, Evidence(danger=reason)
        self._why_none = answer.message
        return self._evading(answer, here), Evidence(uncertified=answer.message)

    def _follow(self, current: Plan, t: float) -> None:
        """Propagate the lag of a held input to t [s], along the plan being flown."""
        held, flown = self._certificate.held, self._flown
        if held is None or (flown is current and t - self._lag_t < self.period - TIME_TOLERANCE):
            return
        if current is not flown:
            lag = NO_LAG
            if flown is not None and np.abs(current.x[0] - state_at(flown, current.t_start)).max() <= STATE_TOLERANCE:
                lag = held.after(flown, self._lag, self._lag_t, current.t_start)
            self._flown, self._lag, self._lag_t = current, lag, current.t_start
        if t > self._lag_t:
            self._lag, self._lag_t = held.after(current, self._lag, self._lag_t, t), t

    def _lag_at(self, t: float) -> Array:
        """Lag (6,) with which a plan takes over at t [s] from the one being flown."""
        held = self._certificate.held
        if held is None or self._flown is None or t <= self._lag_t:
            return self._lag
        return held.after(self._flown, self._lag, self._lag_t, t)

    def _listen(self, messages: Sequence[Message]) -> tuple[str, ...]:
        """Update target and map from ``messages``; "message-ignored" for those that cannot be used."""
        if not messages:
            return ()
        before, now = self._certificate, self._certificate.updated_with(messages)
        if now is not before:
            self._certificate, self._fallback = now, self._make_fallback(now)
            self._unsurveyed = self._unsurveyed or now.terrain is not before.terrain
            if now.target is not before.target:
                self._arrival.target_moved()
        known = Knowledge(now.terrain, tuple(now.target.tolist()))
        return ("message-ignored",) if any(known.complaint(message) for message in messages) else ()

    def _danger(self, current: Plan, t: float) -> Refusal | None:
        """Reason why the rest of the plan being flown is not safe over a map that it was not certified over."""
        if not self._unsurveyed:
            return None
        danger = self._certificate.check_clearance(remainder(current, t))
        self._unsurveyed = danger is not None
        return danger

    def _evading(self, failure: Plan, request: PlanRequest) -> Plan:
        """The fallback planner's plan, uncertified, if it has more clearance than what is left of the present one."""
        assert request.current is not None
        notes = tuple(dict.fromkeys(failure.notes))
        fallback = self._fallback.plan(dataclasses.replace(request, t_start=request.t, current=None))
        present = remainder(request.current, request.t)
        if not fallback.ok or self._least_clearance(fallback) <= self._least_clearance(present):
            return dataclasses.replace(failure, notes=notes)
        notes = (*notes, *self._arrival.extended(fallback, self._certificate, request.t), "uncertified-plan", "rebased")
        return dataclasses.replace(fallback, notes=notes, message=failure.message)

    def _least_clearance(self, plan: Plan) -> float:
        return float(self._certificate.clearances(plan).min())

    def _fresh(self, request: PlanRequest) -> Plan:
        """A certified plan from the estimate itself, by the planner or, failing that, the fallback planner."""
        plan = self._judged(self._planner, request)
        if plan.ok and plan.ready <= plan.t_start:
            return plan
        reason = plan.message or (Status.LATE if plan.ok else plan.status).value
        fallback = self._judged(self._fallback, request)
        if not fallback.ok:
            return dataclasses.replace(fallback, message=f"{reason}; the fallback planner: {fallback.message}")
        return dataclasses.replace(fallback, notes=("fallback-plan",), message=reason)

    def _rebased(self, request: PlanRequest, origin: Estimate, notes: tuple[str, ...], why: str) -> Plan:
        """Plan again from ``origin``, at once: the plan being flown is void."""
        plan = self._fresh(dataclasses.replace(request, t_start=request.t, current=None, estimate=origin))
        if not plan.ok:
            return dataclasses.replace(plan, notes=notes, message=f"{why}; {plan.message}")
        notes = (*notes, *self._arrival.extended(plan, self._certificate, request.t), "rebased")
        return dataclasses.replace(plan, notes=notes, message=why)

    def _judged(self, planner: Planner, request: PlanRequest) -> Plan:
        """The planner's plan if it may be flown, otherwise a failure."""
        name = guest(planner)
        asked = handed(request) if name else request
        answer = answered(lambda: planner.plan(asked))
        plan = answer if isinstance(answer, Unusable) else usable_plan(answer, name)
        return plan.plan if isinstance(plan, Unusable) else self._examined(plan, request)

    def _examined(self, plan: Plan, request: PlanRequest) -> Plan:
        if not plan.ok:
            return plan
        lag = NO_LAG if request.current is None else self._lag_at(request.t_start)
        refusal = self._certificate.check(plan, lag)
        if refusal is None and abs(plan.t_start - request.t_start) > TIME_TOLERANCE:
            refusal = Refusal(
                FlightStatus.WRONG_START, f"starts at {plan.t_start:.3f} s, asked for {request.t_start:.3f} s"
            )
        if refusal is None:
            origin = request.estimate.x if request.current is None else state_at(request.current, request.t_start)
            gap = float(np.abs(plan.x[0] - origin).max())
            if gap > STATE_TOLERANCE:
                refusal = Refusal(FlightStatus.WRONG_START, f"starts {gap:.3g} away from the plan being flown")
        if refusal is None and request.current is not None:
            leads = self._certificate.reaches_target(request.current)
            deadline = self.deadline if leads else self._arrival.of(plan)
            if plan.t_end > deadline + TIME_TOLERANCE:
                refusal = Refusal(
                    FlightStatus.DEADLINE, f"ends at {plan.t_end:.1f} s; the deadline is {deadline:.1f} s"
                )
        if refusal is None:
            return plan
        notes = ("manoeuvre-rejected",) if refusal.phase is FlightPhase.MANOEUVRE else ()
        return dataclasses.replace(
            Plan.failure(refusal.status, refusal.message, ready=plan.ready, solve_ms=plan.solve_ms), notes=notes
        )
