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
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from models.aerial.dynamics import state_at
from models.aerial.mission import FlightMission
from models.terrain.height_field import HeightField
from sim.protocols import Planner
from sim.signals import Array, Phase, Plan, PlanRequest, Status

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
            mission.cruise_level,
        )

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
        miss = float(np.linalg.norm(p[-1] - self.target))
        if miss > self.arrival_radius or speed[-1] > _BOUND:
            return Refusal(Status.NO_ARRIVAL, f"ends {miss:.1f} m from the target at {speed[-1]:.2f} m/s")
        clearance = self.terrain.path_clearance(p[:-1], v[:-1], plan.u, duration)
        worst = int(clearance.argmin()) if len(clearance) else 0
        if len(clearance) and clearance[worst] < self.clearance_min:
            phase = Phase(int(plan.phase[worst]))
            if np.isneginf(clearance[worst]):
                return Refusal(Status.OFF_MAP, f"in the {phase.name.lower()} arc at {plan.t[worst]:.1f} s", phase)
            low = f"{clearance[worst]:.1f} m in the {phase.name.lower()} arc at {plan.t[worst]:.1f} s"
            return Refusal(Status.LOW_CLEARANCE, f"{low}; allowed {self.clearance_min:g}", phase)
        edge = np.array([self.terrain.width, self.terrain.depth])
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


class Certified:
    """A planner whose every answer is certified, and which answers something safe where that can be had.

    ``reserve`` is asked where there is no plan to fall back on: at the start, and when the vehicle has left its plan.
    """

    def __init__(
        self,
        planner: Planner,
        reserve: Planner,
        certificate: Certificate,
        bound: TrackingBound,
        deadline_factor: float,
    ) -> None:
        if not deadline_factor >= 1.0:
            raise ValueError(f"deadline_factor = {deadline_factor!r}; allowed: >= 1")
        self.period = planner.period
        self.deadline = np.inf  # [s] in force now
        self._planner, self._reserve = planner, reserve
        self._certificate, self._bound, self._factor = certificate, bound, deadline_factor
        self._next_pass = np.inf  # [s] of the plan that was being flown at the last request

    def plan(self, request: PlanRequest) -> Plan:
        """The planner's answer if it may be flown; a failure that says why not otherwise."""
        current, x = request.current, request.estimate.x
        if x.shape != (6,):
            return Plan.failure(Status.MALFORMED, f"the estimate's state has shape {x.shape}; allowed: (6,)")
        if current is None:
            plan = self._fresh(request)
            if plan.ok:
                self.deadline = request.t + self._factor * (plan.t_end - request.t)
                self._next_pass = pass_time(plan, self._certificate.target, request.t)
            return plan
        notes: tuple[str, ...] = ()
        # That the mission goes on says that the pass was missed. One at this very tick may still be judged.
        missed = self._next_pass < request.t - _SIMULTANEOUS
        self._next_pass = pass_time(current, self._certificate.target, request.t - 2.0 * _SIMULTANEOUS)
        if missed:
            notes = ("missed-pass",)
            left = max(current.t_end - request.t, self.period)
            self.deadline = max(self.deadline, request.t + self._factor * left)
        error = x - state_at(current, request.t)
        if request.estimate.status is not Status.OK:
            # Nobody knows where the vehicle is: its plan is the best guess, and no estimate to plan from anew.
            notes = (*notes, "guarantee-lost")
        elif self._bound.broken_by(error):
            return self._rebased(request, error, notes)
        plan = self._judged(self._planner, request)
        return dataclasses.replace(plan, notes=notes + plan.notes)

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

    def _rebased(self, request: PlanRequest, error: Array, notes: tuple[str, ...]) -> Plan:
        """The vehicle is off its plan: plan anew from the estimate, at once, or announce the loss."""
        notes = (*notes, "tracking-breach")
        far = f"{np.hypot(error[0], error[1]):.1f} m across, {error[2]:.1f} m up from the plan"
        here = dataclasses.replace(request, t_start=request.t, current=None)
        plan = self._fresh(here)
        if not plan.ok:
            return dataclasses.replace(plan, notes=(*notes, "guarantee-lost"), message=f"{far}; {plan.message}")
        self._next_pass = pass_time(plan, self._certificate.target, request.t)
        if plan.t_end > self.deadline:
            notes = (*notes, "deadline-lost")
            self.deadline = plan.t_end
        return dataclasses.replace(plan, notes=(*notes, "rebased"), message=far)

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
        if refusal is None and request.current is not None and plan.t_end > self.deadline + _SIMULTANEOUS:
            refusal = Refusal(Status.DEADLINE, f"ends at {plan.t_end:.1f} s; the deadline is {self.deadline:.1f} s")
        if refusal is None:
            return plan
        notes = ("manoeuvre-rejected",) if refusal.phase is Phase.MANOEUVRE else ()
        return dataclasses.replace(
            Plan.failure(refusal.status, refusal.message, ready=plan.ready, solve_ms=plan.solve_ms), notes=notes
        )
