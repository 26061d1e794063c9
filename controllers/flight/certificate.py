"""What makes "never collides, always arrives" true: nothing is flown that has not been certified whole.

A plan pi is certified, C(pi), if over all of it, to rest, the least clearance above the triangles is at least h_min +
delta (delta what the tracker may deviate), it stays that far inside the map, |v| and |a| keep the bounds left to a
plan, its arcs join, and it rests within reach of the target. ``Certified`` keeps the invariant, at every t before
arrival:

    x(t) = x_pi(t) (within the tracking bound),  C(pi),  t_e <= gamma V_0.

A candidate replaces the plan being flown at its start time if and only if it starts on it, is certified, and ends by
the deadline. Otherwise the stored plan stays, which is safe and arrives. This is Propositions A.2 and A.3, made true
for arcs instead of nodes, for any planner.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from models.aerial.dynamics import state_at
from models.aerial.knowledge import Knowledge
from models.aerial.mission import FlightMission
from models.terrain.height_field import HeightField
from sim.protocols import Planner
from sim.signals import Array, Estimate, Message, Phase, Plan, PlanRequest, Status

_JOIN = 1e-6  # [m, m/s] two states closer than this are the same
_BOUND = 1e-6  # [m/s, m/s^2] rounding allowed on a bound
_PASS = 1e-3  # [m] a breakpoint this close to the target is a pass
_SIMULTANEOUS = 1e-9  # [s]


@dataclass(frozen=True)
class TrackingBound:
    """What the tracker keeps: the vehicle stays this close to the plan, at this much feedback."""

    horizontal: float  # [m] r_h
    vertical: float  # [m] r_z
    speed: float  # [m/s] r_v
    feedback: float  # [m/s^2] a_fb

    def broken_by(self, error: Array) -> bool:
        """Whether an error (6,) [m, m/s] of the state lies outside."""
        # Said this way round, so that NaN lies outside.
        return not (np.hypot(error[0], error[1]) <= self.horizontal and abs(error[2]) <= self.vertical)


@dataclass(frozen=True)
class Refusal:
    """Why a plan is not certified."""

    status: Status
    message: str
    phase: Phase | None = None


@dataclass(frozen=True, eq=False)
class Certificate:
    """C(pi) as a function; ``terrain`` is raised by the tracking bound, the other bounds are lowered by it."""

    terrain: HeightField
    clearance_min: float  # [m] h_min
    speed_max: float  # [m/s]
    acceleration_max: float  # [m/s^2]
    target: Array  # (3,) [m]
    arrival_radius: float  # [m]
    border: float = 0.0  # [m] that is kept from the edge of the map
    rise: float = 0.0  # [m] by which the terrain was raised, beside what ``border`` asks for
    cruise_level: float = -np.inf  # [m] below which no completion path flies level

    @staticmethod
    def of(mission: FlightMission, bound: TrackingBound) -> Certificate:
        """The certificate of a mission whose tracker keeps ``bound``; ValueError if that leaves nothing to fly with."""
        speed = mission.speed_max - bound.speed
        acceleration = mission.acceleration_max - bound.feedback
        radius = mission.arrival_radius - float(np.hypot(bound.horizontal, bound.vertical))
        for name, left, whole in (
            ("speed_max", speed, mission.speed_max),
            ("acceleration_max", acceleration, mission.acceleration_max),
            ("arrival_radius", radius, mission.arrival_radius),
        ):
            if left <= 0.0:
                raise ValueError(
                    f"{name} = {whole:g} leaves nothing to plan with; allowed: > {whole - left:.3g}, "
                    "which noise and gusts take"
                )
        return Certificate(
            _raised(mission.terrain, bound.horizontal, bound.vertical),
            mission.clearance_min,
            speed,
            acceleration,
            np.array(mission.target, dtype=np.float64),
            radius,
            bound.horizontal,
            bound.vertical,
            mission.cruise_level,
        )

    def told(self, messages: Sequence[Message]) -> Certificate:
        """With the target and the map that ``messages`` tell of (``models.aerial.knowledge``); itself without any."""
        known = Knowledge(self.terrain, tuple(self.target.tolist()))
        now = known.updated(messages)
        certificate = self
        if now.target != known.target:
            certificate = dataclasses.replace(certificate, target=np.array(now.target, dtype=np.float64))
        if now.terrain is not known.terrain:
            certificate = dataclasses.replace(certificate, terrain=_raised(now.terrain, self.border, self.rise))
        return certificate

    def leads(self, plan: Plan) -> bool:
        """Whether a plan ends at the target."""
        return float(np.linalg.norm(plan.x[-1, :3] - self.target)) <= self.arrival_radius

    def refuse(self, plan: Plan) -> Refusal | None:
        """None if C(plan) holds, else the first reason why not."""
        if malformed := _malformed(plan):
            return malformed
        duration = np.diff(plan.t)
        p, v = plan.x[:, :3], plan.x[:, 3:]
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows does not join
            joint = np.hstack(
                [
                    p[:-1] + duration[:, None] * v[:-1] + 0.5 * duration[:, None] ** 2 * plan.u - p[1:],
                    v[:-1] + duration[:, None] * plan.u - v[1:],
                ]
            )
        gap = float(np.abs(joint).max(initial=0.0))
        if not gap <= _JOIN:  # nor does NaN
            return Refusal(Status.MALFORMED, f"arcs miss each other by {gap:.3g}")
        speed, push = np.linalg.norm(v, axis=1), np.linalg.norm(plan.u, axis=1)
        # A start that is too fast already, after a gust say, can only be slowed down.
        if speed.max() > max(self.speed_max, speed[0]) + _BOUND:
            return Refusal(Status.BOUNDS, f"|v| reaches {speed.max():.2f} m/s; allowed {self.speed_max:.2f}")
        if push.max(initial=0.0) > self.acceleration_max + _BOUND:
            return Refusal(Status.BOUNDS, f"|a| reaches {push.max():.2f} m/s^2; allowed {self.acceleration_max:.2f}")
        if not self.leads(plan) or speed[-1] > _BOUND:
            miss = float(np.linalg.norm(p[-1] - self.target))
            return Refusal(Status.NO_ARRIVAL, f"ends {miss:.1f} m from the target at {speed[-1]:.2f} m/s")
        return self.endangered(plan)

    def clearances(self, plan: Plan) -> Array:
        """(K,) [m] least clearance of each arc of a plan; -inf off the map."""
        return self.terrain.path_clearance(plan.x[:-1, :3], plan.x[:-1, 3:], plan.u, np.diff(plan.t))

    def endangered(self, plan: Plan) -> Refusal | None:
        """Where a plan that is right otherwise comes too near to the ground or to the edge of the map."""
        clearance = self.clearances(plan)
        worst = int(clearance.argmin())
        if clearance[worst] < self.clearance_min:
            phase = Phase(int(plan.phase[worst]))
            if np.isneginf(clearance[worst]):
                return Refusal(Status.OFF_MAP, f"in the {phase.name.lower()} arc at {plan.t[worst]:.1f} s", phase)
            low = f"{clearance[worst]:.1f} m in the {phase.name.lower()} arc at {plan.t[worst]:.1f} s"
            return Refusal(Status.LOW_CLEARANCE, f"{low}; allowed {self.clearance_min:g}", phase)
        edge = np.array([self.terrain.width, self.terrain.depth])
        p, v, duration = plan.x[:, :3], plan.x[:, 3:], np.diff(plan.t)
        for axis in range(2):
            least, greatest = _extent(p[:-1, axis], v[:-1, axis], plan.u[:, axis], duration)
            room = min(least, edge[axis] - greatest)
            if room < self.border:
                return Refusal(Status.OFF_MAP, f"{room:.2f} m from the edge of the map; allowed {self.border:.2f}")
        return None


@lru_cache(maxsize=8)
def _raised(terrain: HeightField, horizontal: float, vertical: float) -> HeightField:
    """The ground that a tracker with this bound needs; every certificate of a mission shares it."""
    return terrain.inflated(horizontal, vertical)


def _extent(p: Array, v: Array, a: Array, duration: Array) -> tuple[float, float]:
    """Least and greatest of p + v t + a t^2 / 2 over 0 <= t <= duration, of all arcs (K,)."""
    turn = np.clip(np.divide(-v, a, out=duration.copy(), where=a != 0.0), 0.0, duration)
    met = np.concatenate([p + t * v + 0.5 * t * t * a for t in (np.zeros(len(p)), turn, duration)])
    return float(met.min()), float(met.max())


def _malformed(plan: Plan) -> Refusal | None:
    arcs = len(plan.t) - 1
    if arcs < 1 or plan.x.shape != (arcs + 1, 6) or plan.u.shape != (arcs, 3) or plan.phase.shape != (arcs,):
        shapes = f"t {plan.t.shape}, x {plan.x.shape}, u {plan.u.shape}, phase {plan.phase.shape}"
        return Refusal(Status.MALFORMED, f"{shapes}; allowed (K + 1,), (K + 1, 6), (K, 3), (K,) with K >= 1")
    if not (np.isfinite(plan.t).all() and np.isfinite(plan.x).all() and np.isfinite(plan.u).all()):
        return Refusal(Status.NOT_FINITE, "t, x or u is not finite")
    if (np.diff(plan.t) <= 0.0).any():
        return Refusal(Status.MALFORMED, "times do not increase")
    if not np.isin(plan.phase, list(Phase)).all():
        return Refusal(Status.MALFORMED, f"phases {np.unique(plan.phase).tolist()}; allowed {[int(p) for p in Phase]}")
    return None


def _owned(plan: Plan) -> Plan:
    """The plan in arrays of its own, read-only, so that a planner which uses its arrays again cannot change it."""
    t, x, u = (np.array(values, dtype=np.float64) for values in (plan.t, plan.x, plan.u))
    phase = np.array(plan.phase, dtype=np.int64)
    for values in (t, x, u, phase):
        values.setflags(write=False)
    return dataclasses.replace(plan, t=t, x=x, u=u, phase=phase)


def pass_time(plan: Plan, target: Array, after: float) -> float:
    """First breakpoint [s] later than ``after`` at which the plan is at the target; inf if none."""
    near = (np.linalg.norm(plan.x[:, :3] - target, axis=1) <= _PASS) & (plan.t > after + _SIMULTANEOUS)
    return float(plan.t[near][0]) if near.any() else np.inf


def remainder(plan: Plan, t: float) -> Plan:
    """What is left of a plan from ``t`` [s] on, itself a plan: of one that has come to its end, a second of rest."""
    if t >= plan.t_end - _SIMULTANEOUS:
        x = np.vstack([plan.x[-1], plan.x[-1]])
        rest = np.array([t, t + 1.0]), x, np.zeros((1, x.shape[1] // 2)), np.array([Phase.HOVER], np.int64)
        return Plan(*rest, cost=plan.cost)
    k = max(0, int(np.searchsorted(plan.t, t + _SIMULTANEOUS, side="right")) - 1)
    left, x = plan.t[k:].copy(), plan.x[k:].copy()
    left[0], x[0] = t, state_at(plan, t)
    return dataclasses.replace(plan, t=left, x=x, u=plan.u[k:], phase=plan.phase[k:], solve_ms=np.nan, notes=())


class Certified:
    """A planner whose every answer is certified, and which answers something safe where that can be had.

    ``reserve(certificate)`` makes the planner that is asked where there is no plan to fall back on: at the start, when
    the vehicle has left its plan, and when its plan turns out to be unsafe.

    What is told on the way (``models.aerial.knowledge``) is judged at once. *A map that was wrong*: if what is left of
    the plan being flown is safe over the map as it is now, the guarantee is kept. Otherwise a certified plan from where
    the plan is now takes over without delay; if none can be had, the loss is announced ("guarantee-lost"), of the
    reserve's plan and the present one that with more clearance is flown, and the search goes on at every period. *A
    target elsewhere*: the vehicle is as safe as before, but its plan leads to where the target was. The first certified
    plan that leads to the new one takes over, and the deadline with it, D = t + gamma V, if it ends later than that
    ("deadline-moved"); where there is none the loss is announced ("arrival-lost") until there is.
    """

    def __init__(
        self,
        planner: Planner,
        reserve: Callable[[Certificate], Planner],
        certificate: Certificate,
        bound: TrackingBound,
        deadline_factor: float,
    ) -> None:
        if not deadline_factor >= 1.0:
            raise ValueError(f"deadline_factor = {deadline_factor!r}; allowed: >= 1")
        self.period = planner.period
        self.deadline = np.inf  # [s] in force now
        self._planner, self._make_reserve = planner, reserve
        self._reserve = reserve(certificate)
        self._certificate, self._bound, self._factor = certificate, bound, deadline_factor
        self._next_pass = np.inf  # [s] of the plan that was being flown at the last request
        self._unsure = False  # whether the plan being flown was certified over another map
        self._astray = False  # whether it was announced that it leads elsewhere

    def plan(self, request: PlanRequest) -> Plan:
        """The planner's answer if it may be flown; a failure that says why not otherwise."""
        current, x = request.current, request.estimate.x
        if x.shape != (6,):
            return Plan.failure(Status.MALFORMED, f"the estimate's state has shape {x.shape}; allowed: (6,)")
        notes = self._listen(request.messages)
        if current is None:
            plan = self._fresh(request)
            if plan.ok:
                self.deadline = request.t + self._factor * (plan.t_end - request.t)
                self._next_pass = pass_time(plan, self._certificate.target, request.t)
            return dataclasses.replace(plan, notes=notes + plan.notes)
        # That the mission goes on says that the pass was missed. One at this very tick may still be judged.
        missed = self._next_pass < request.t - _SIMULTANEOUS
        self._next_pass = pass_time(current, self._certificate.target, request.t - 2.0 * _SIMULTANEOUS)
        if missed:
            notes = (*notes, "missed-pass")
            left = max(current.t_end - request.t, self.period)
            self.deadline = max(self.deadline, request.t + self._factor * left)
        error = x - state_at(current, request.t)
        if request.estimate.status is not Status.OK:
            # Nobody knows where the vehicle is: its plan is the best guess, and no estimate to plan from anew.
            notes = (*notes, "guarantee-lost")
        elif self._bound.broken_by(error):
            far = f"{np.hypot(error[0], error[1]):.1f} m across, {error[2]:.1f} m up from the plan"
            return self._rebased(request, request.estimate, (*notes, "tracking-breach"), far)
        if (danger := self._danger(request)) is not None:
            here = Estimate(request.t, state_at(current, request.t))
            told = f"over the map as it is now: {danger.message}"
            return self._evading(self._rebased(request, here, (*notes, "plan-endangered"), told), request, here)
        plan = self._judged(self._planner, request)
        return dataclasses.replace(plan, notes=notes + self._following(current, plan) + plan.notes)

    def _listen(self, messages: Sequence[Message]) -> tuple[str, ...]:
        """Go by the target and the map that ``messages`` tell of; "message-ignored" for what cannot be."""
        before, now = self._certificate, self._certificate.told(messages)
        if now is not before:
            self._certificate, self._reserve = now, self._make_reserve(now)
            self._unsure = self._unsure or now.terrain is not before.terrain
            if now.target is not before.target:
                self._next_pass = np.inf  # nobody will be there
        known = Knowledge(now.terrain, tuple(now.target.tolist()))
        return ("message-ignored",) if any(known.complaint(message) for message in messages) else ()

    def _danger(self, request: PlanRequest) -> Refusal | None:
        """Why what is left of the plan being flown is not safe over a map that it was not certified over."""
        if not self._unsure or request.current is None:
            return None
        danger = self._certificate.endangered(remainder(request.current, request.t))
        self._unsure = danger is not None
        return danger

    def _evading(self, plan: Plan, request: PlanRequest, here: Estimate) -> Plan:
        """A certified plan if there is one; else the reserve's, if that has more clearance than the present one."""
        assert request.current is not None
        if plan.ok:
            return plan
        reserve = self._reserve.plan(dataclasses.replace(request, t_start=request.t, current=None, estimate=here))
        if not reserve.ok:
            return plan
        kept, other = (
            float(self._certificate.clearances(each).min()) for each in (remainder(request.current, request.t), reserve)
        )
        if other <= kept:
            return plan
        notes = (*plan.notes, *self._extended(reserve, request.t), "rebased")
        return dataclasses.replace(_owned(reserve), notes=notes, message=plan.message)

    def _following(self, current: Plan, plan: Plan) -> tuple[str, ...]:
        """What there is to tell of a target that has moved: the plan being flown leads elsewhere, or again to it."""
        if self._certificate.leads(current):
            regained, self._astray = self._astray, False
            return ("arrival-regained",) if regained else ()
        if not plan.ok:
            lost, self._astray = not self._astray, True
            return ("arrival-lost",) if lost else ()
        if plan.t_end > self.deadline + _SIMULTANEOUS:
            self.deadline = self._deadline_of(plan, current)
            return ("deadline-moved",)
        return ()

    def _deadline_of(self, plan: Plan, current: Plan) -> float:
        """[s] by which a plan has to end: another one than before if the plan being flown leads elsewhere."""
        if self._certificate.leads(current):
            return self.deadline
        return max(self.deadline, plan.t_start + self._factor * (plan.t_end - plan.t_start))

    def _fresh(self, request: PlanRequest) -> Plan:
        """A certified plan from the estimate itself, by the planner or, failing that, the reserve."""
        plan = self._judged(self._planner, request)
        if plan.ok and plan.ready <= plan.t_start:
            return plan
        reason = plan.message or (Status.LATE if plan.ok else plan.status).value
        reserve = self._judged(self._reserve, request)
        if not reserve.ok:
            return dataclasses.replace(reserve, message=f"{reason}; the reserve: {reserve.message}")
        return dataclasses.replace(reserve, notes=("reserve-plan",), message=reason)

    def _rebased(self, request: PlanRequest, origin: Estimate, notes: tuple[str, ...], why: str) -> Plan:
        """The plan being flown is worth nothing: plan anew from ``origin``, at once, or announce the loss."""
        plan = self._fresh(dataclasses.replace(request, t_start=request.t, current=None, estimate=origin))
        if not plan.ok:
            return dataclasses.replace(plan, notes=(*notes, "guarantee-lost"), message=f"{why}; {plan.message}")
        return dataclasses.replace(plan, notes=(*notes, *self._extended(plan, request.t), "rebased"), message=why)

    def _extended(self, plan: Plan, t: float) -> tuple[str, ...]:
        """For a plan that takes over whenever it ends: "deadline-lost" if that is late, and its end is the deadline."""
        self._next_pass = pass_time(plan, self._certificate.target, t)
        if plan.t_end <= self.deadline:
            return ()
        self.deadline = plan.t_end
        return ("deadline-lost",)

    def _judged(self, planner: Planner, request: PlanRequest) -> Plan:
        """The planner's answer if it may be flown, or the failure it is."""
        try:
            plan = planner.plan(request)
            if not isinstance(plan, Plan):
                raise TypeError(f"plan() returned {type(plan).__name__}; allowed: Plan")
            return self._examined(plan, request)
        except (Exception, SystemExit) as error:  # whatever a stranger's planner does, the vehicle flies on
            return Plan.raised(error)

    def _examined(self, plan: Plan, request: PlanRequest) -> Plan:
        if not plan.ok:
            return plan
        plan = _owned(plan)
        refusal = self._certificate.refuse(plan)
        if refusal is None and abs(plan.t_start - request.t_start) > _SIMULTANEOUS:
            refusal = Refusal(Status.WRONG_START, f"starts at {plan.t_start:.3f} s, asked for {request.t_start:.3f} s")
        if refusal is None:
            origin = request.estimate.x if request.current is None else state_at(request.current, request.t_start)
            gap = float(np.abs(plan.x[0] - origin).max())
            if gap > _JOIN:
                refusal = Refusal(Status.WRONG_START, f"starts {gap:.3g} beside the plan being flown")
        if refusal is None and request.current is not None:
            deadline = self._deadline_of(plan, request.current)
            if plan.t_end > deadline + _SIMULTANEOUS:
                refusal = Refusal(Status.DEADLINE, f"ends at {plan.t_end:.1f} s; the deadline is {deadline:.1f} s")
        if refusal is None:
            return plan
        notes = ("manoeuvre-rejected",) if refusal.phase is Phase.MANOEUVRE else ()
        return dataclasses.replace(
            Plan.failure(refusal.status, refusal.message, ready=plan.ready, solve_ms=plan.solve_ms), notes=notes
        )
