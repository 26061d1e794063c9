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
    pass_time,
    remainder,
)
from mathnavi.controllers.flight.held_input import NO_LAG, HeldInput
from mathnavi.controllers.flight.planner import StopAndHover
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

_ROUNDING = 1e-3  # share of a declared deviation, and [m, m/s]


def _owned(plan: Plan) -> Plan:
    """Copy a plan into read-only arrays, so that a planner which uses its arrays again cannot change it."""
    t, x, u = (np.array(values, dtype=np.float64) for values in (plan.t, plan.x, plan.u))
    phase = np.array(plan.phase, dtype=np.int64)
    for values in (t, x, u, phase):
        values.setflags(write=False)
    return dataclasses.replace(plan, t=t, x=x, u=u, phase=phase)


def doubt(estimate: Estimate, worst: tuple[float, ...]) -> str:
    """Reason why a tracking bound cannot be relied on with an estimate; "" if it can.

    A DEGRADED estimate is judged by its covariance, and without one it cannot be relied on.
    ``worst`` are the declared standard deviations of its position [m] and velocity [m/s], at their worst.
    """
    if not estimate.status.usable or (estimate.covariance is None and estimate.status is not Status.OK):
        return str(estimate.status.value)
    if estimate.covariance is None:
        return ""
    if estimate.covariance.shape != (6, 6):
        return f"the estimate's covariance has shape {estimate.covariance.shape}; allowed: (6, 6)"
    variance = estimate.covariance.diagonal().tolist()
    for what, unit, (x, y, z), declared in (
        ("position", "m", variance[:3], worst[0]),
        ("velocity", "m/s", variance[3:], worst[1]),
    ):
        allowed = ((1.0 + _ROUNDING) * declared + _ROUNDING) ** 2
        if not (x <= allowed and y <= allowed and z <= allowed):  # nor is NaN
            deviation = float(np.sqrt(np.max((x, y, z))))
            return f"the estimate's {what} is off by {deviation:.3g} {unit}, one sigma; declared: {declared:.3g}"
    return ""


class Certified:
    """A planner all of whose plans are certified, and that falls back on a safe plan where it finds one.

    ``fallback(certificate)`` makes the planner that is used where there is no plan to fall back on: at the start, when
    the vehicle has left its plan, and when its plan turns out to be unsafe.

    Between two planning instants ``monitor`` checks, at every control step, what cannot wait. *A vehicle outside its
    tracking bound* ("tracking-breach"): a plan from its estimate takes over at once, or the loss is announced
    ("guarantee-lost"). *An estimate that is lost, or worse than declared*: the loss is announced, and the plan being
    flown stays, for it is the best guess of where the vehicle is.

    New information (``mathnavi.models.aerial.knowledge``) is checked at the next planning instant, a map as soon as it
    arrives. *A map that was wrong*: if what is left of the plan being flown is safe over the new map, the guarantee is
    kept. Otherwise a certified plan from where the plan is now takes over without delay; if none exists, the loss is
    announced ("guarantee-lost"), the present plan or that of the fallback planner is flown, the one with more
    clearance, and the search goes on at every period until there is one ("guarantee-regained"). *A target elsewhere*:
    the vehicle is as safe as before, but its plan leads to where the target was. The first certified plan that leads to
    the new one takes over, and if it ends after the deadline, the deadline is D = t_s + gamma V from then on, t_s its
    start ("deadline-moved"). Where none has taken over by the next instant the loss is announced ("arrival-lost") until
    one has.
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
        self.deadline = np.inf  # [s] in force now
        self.promised = np.inf  # [s] the deadline without what was lost: missed passes, and rebased plans
        self._planner, self._make_fallback = planner, fallback
        self._fallback = fallback(certificate)
        self._certificate, self._bound, self._factor = certificate, bound, deadline_factor
        self._next_pass = np.inf  # [s] of the plan that was being flown at the last request
        self._unheard: tuple[Message, ...] = ()  # of requests that could not be answered
        self._unsure = False  # True if the plan being flown was certified over another map
        self._lost = False  # True from when the loss of the guarantee was announced until it is regained
        self._doubted = False  # True while the estimate is lost or worse than declared
        self._breached = False  # True from a breach that found no plan until the next planning instant
        self._worst = worst
        self._start = start
        self._flown: Plan | None = None  # the plan being flown, at the last request
        self._lag, self._lag_t = NO_LAG, 0.0  # (6,) [m, m/s] of the vehicle behind it, at [s]
        self._astray = 0  # planning instants at which it has led elsewhere
        self._announced = False  # True once that was announced

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
        current, x = request.current, request.estimate.x
        if self._unheard:
            request = dataclasses.replace(request, messages=(*self._unheard, *request.messages))
            self._unheard = ()
        if x.shape != (6,):
            self._unheard = request.messages
            return Plan.failure(Status.MALFORMED, f"the estimate's state has shape {x.shape}; allowed: (6,)")
        notes = self._listen(request.messages)
        if current is None:
            plan = self._fresh(self._from_start(request))
            if plan.ok:
                self.deadline = self.promised = request.t + self._factor * (plan.t_end - request.t)
                self._next_pass = pass_time(plan, self._certificate.target, request.t)
            else:
                self._lost, notes = True, (*notes, "guarantee-lost")  # nothing is flown, the vehicle may go anywhere
            return dataclasses.replace(plan, notes=notes + plan.notes)
        notes += self._followed(current)
        # That the mission goes on says that the pass was missed. One at this very tick may still be judged.
        missed = self._next_pass < request.t - TIME_TOLERANCE
        self._next_pass = pass_time(current, self._certificate.target, request.t - 2.0 * TIME_TOLERANCE)
        if missed:
            notes = (*notes, "missed-pass")
            left = max(current.t_end - request.t, self.period)
            self.deadline = max(self.deadline, request.t + self._factor * left)
        self._follow(current, request.t)
        self._breached = False
        self._doubted = bool(doubt(request.estimate, self._worst))
        if self._doubted:
            # The vehicle's position is unknown: its plan is the best guess, and there is no estimate to plan from.
            self._lost = True
            notes = (*notes, "guarantee-lost")
        elif (far := self._breach(request)) is not None:
            answer = self._rebased(request, request.estimate, (*notes, "tracking-breach"), far)
            self._breached = not answer.ok
            return answer if self._danger(current, request.t) is None else self._evading(answer, request)
        if (danger := self._danger(current, request.t)) is not None:
            return self._endangered(request, current, danger, notes)
        if self._lost and "guarantee-lost" not in notes:
            self._lost = False
            notes = (*notes, "guarantee-regained")
        plan = self._judged(self._planner, request)
        return dataclasses.replace(plan, notes=notes + self._following(current, plan) + plan.notes)

    def _from_start(self, request: PlanRequest) -> PlanRequest:
        """The first request, from the start that the mission states unless the estimate contradicts it."""
        if self._start is None:
            return request
        error = request.estimate.x - self._start
        if self._bound.broken_by(error) or not np.linalg.norm(error[3:]) <= self._bound.speed:
            return request
        return dataclasses.replace(request, estimate=dataclasses.replace(request.estimate, x=self._start.copy()))

    def monitor(self, request: PlanRequest) -> Plan | None:
        """Check at a control step what cannot wait for the next planning instant.

        Returns a plan that takes over at once, a failure that announces a loss, or None. The request's messages are
        those of the next one too.
        """
        current = request.current
        self._listen(request.messages)
        if current is None or request.estimate.x.shape != (6,):
            return None
        self._follow(current, request.t)
        if request.messages and (danger := self._danger(current, request.t)) is not None:
            return self._endangered(request, current, danger, ())
        reason, doubted = doubt(request.estimate, self._worst), self._doubted
        self._doubted = bool(reason)
        if reason:
            self._lost = True
            return None if doubted else Plan.failure(Status.LOST, reason, notes=("guarantee-lost",))
        far = None if self._breached else self._breach(request)
        if far is None:
            return None
        answer = self._rebased(request, request.estimate, ("tracking-breach",), far)
        self._breached = not answer.ok
        return answer

    def _breach(self, request: PlanRequest) -> str | None:
        """Message with the distance from the plan of a vehicle outside its tracking bound; None for one within."""
        assert request.current is not None
        plan = request.current
        error = offset_from(plan.t, plan.x, plan.u, request.t, request.estimate.x)
        if not self._bound.broken_by(error):
            return None
        return f"{np.hypot(error[0], error[1]):.1f} m across, {error[2]:.1f} m up from the plan"

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

    def _endangered(self, request: PlanRequest, current: Plan, danger: Refusal, notes: tuple[str, ...]) -> Plan:
        """Leave the plan being flown from where it is now."""
        here = dataclasses.replace(request, estimate=Estimate(request.t, state_at(current, request.t)))
        reason = f"over the new map: {danger.message}"
        return self._evading(self._rebased(here, here.estimate, (*notes, "plan-endangered"), reason), here)

    def _listen(self, messages: Sequence[Message]) -> tuple[str, ...]:
        """Update target and map from ``messages``; "message-ignored" for those that cannot be used."""
        if not messages:
            return ()
        before, now = self._certificate, self._certificate.updated_with(messages)
        if now is not before:
            self._certificate, self._fallback = now, self._make_fallback(now)
            self._unsure = self._unsure or now.terrain is not before.terrain
            if now.target is not before.target:
                self._next_pass = np.inf  # the vehicle will not be there
        known = Knowledge(now.terrain, tuple(now.target.tolist()))
        return ("message-ignored",) if any(known.complaint(message) for message in messages) else ()

    def _danger(self, current: Plan, t: float) -> Refusal | None:
        """Reason why the rest of the plan being flown is not safe over a map that it was not certified over."""
        if not self._unsure:
            return None
        danger = self._certificate.check_clearance(remainder(current, t))
        self._unsure = danger is not None
        return danger

    def _evading(self, plan: Plan, request: PlanRequest) -> Plan:
        """Return ``plan`` if it is certified; else that of the fallback planner, if it has more clearance than now."""
        assert request.current is not None
        if plan.ok:
            return plan
        self._lost = True
        notes = tuple(dict.fromkeys(plan.notes))
        fallback = self._fallback.plan(dataclasses.replace(request, t_start=request.t, current=None))
        present = remainder(request.current, request.t)
        if not fallback.ok or self._least_clearance(fallback) <= self._least_clearance(present):
            return dataclasses.replace(plan, notes=notes)
        notes = (*notes, *self._extended(fallback, request.t), "rebased")
        return dataclasses.replace(_owned(fallback), notes=notes, message=plan.message)

    def _least_clearance(self, plan: Plan) -> float:
        return float(self._certificate.clearances(plan).min())

    def _followed(self, current: Plan) -> tuple[str, ...]:
        """Notes on the plan being flown after the target has moved: it leads there, or not yet."""
        if not self._certificate.reaches_target(current):
            self._astray += 1
            return self._announce() if self._astray > 1 else ()
        notes: tuple[str, ...] = ("arrival-regained",) if self._announced else ()
        if self._astray and current.t_end > self.deadline + TIME_TOLERANCE:
            self.deadline = self._deadline_of(current)
            self.promised = max(self.promised, self.deadline)
            notes = (*notes, "deadline-moved")
        self._astray, self._announced = 0, False
        return notes

    def _following(self, current: Plan, plan: Plan) -> tuple[str, ...]:
        """Notes on the plan being flown where it does not lead to the target and ``plan`` cannot take over."""
        there = plan.ok and plan.ready <= plan.t_start + TIME_TOLERANCE
        return () if there or self._certificate.reaches_target(current) else self._announce()

    def _announce(self) -> tuple[str, ...]:
        """Announce, once, that the plan being flown leads elsewhere."""
        before, self._announced = self._announced, True
        return () if before else ("arrival-lost",)

    def _deadline_of(self, plan: Plan) -> float:
        """Deadline [s] of a plan to a target that has moved."""
        return max(self.deadline, plan.t_start + self._factor * (plan.t_end - plan.t_start))

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
        """Plan again from ``origin``, at once, or announce the loss: the plan being flown is void."""
        plan = self._fresh(dataclasses.replace(request, t_start=request.t, current=None, estimate=origin))
        if not plan.ok:
            self._lost = True
            return dataclasses.replace(plan, notes=(*notes, "guarantee-lost"), message=f"{why}; {plan.message}")
        return dataclasses.replace(plan, notes=(*notes, *self._extended(plan, request.t), "rebased"), message=why)

    def _extended(self, plan: Plan, t: float) -> tuple[str, ...]:
        """Notes on a plan that takes over even if late: "deadline-lost" if it is, and its end is the new deadline."""
        self._next_pass = pass_time(plan, self._certificate.target, t)
        if plan.t_end <= self.deadline:
            return ()
        self.deadline = plan.t_end
        return ("deadline-lost",)

    def _judged(self, planner: Planner, request: PlanRequest) -> Plan:
        """The planner's plan if it may be flown, otherwise a failure."""
        try:
            plan = planner.plan(request)
            if not isinstance(plan, Plan):
                raise TypeError(f"plan() returned {type(plan).__name__}; allowed: Plan")
            return self._examined(plan, request)
        except (Exception, SystemExit) as error:  # whatever a third-party planner does, the vehicle flies on
            return Plan.raised(error)

    def _examined(self, plan: Plan, request: PlanRequest) -> Plan:
        if not plan.ok:
            return plan
        plan = _owned(plan)
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
            deadline = self.deadline if leads else self._deadline_of(plan)
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
