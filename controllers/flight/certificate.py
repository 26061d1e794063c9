"""C(pi): the conditions on a plan before it is flown, over its whole future, to rest.

A plan pi is certified, C(pi), if over its whole future the least clearance above the triangles is at least h_min +
delta (delta the tracking bound), it stays that far inside the map, |v| and |a| keep the bounds left to a
plan, its arcs join, it rests within reach of the target, and it is trackable: the vehicle's lag from holding each
command (``held_input``) is no more than the tracking bound sets aside.

A plan is the path of the vehicle's centre, and the vehicle is a ball of radius r about it. The centre keeps h_min above
all ground within r across, and r from the edge of the map, in addition to the tracking bound; with h_min >= r the ball
then touches nothing. A smaller h_min is refused.

A start may be too fast already, after a gust for instance. Then the excess e over v_max is at most e (1 - t / T) from
there on, with T = max(v_max / a_max, 4 e / a_max): it is gone when a stop from v_max would be over or, where it is
greater, falls at a quarter of a_max.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

import numpy as np

from mathnavi.controllers.flight.held_input import NO_LAG, HeldInput
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.errors import ArgumentError, FieldError, MissionError
from mathnavi.interfaces.signals import Array, Message, Plan, Status
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.knowledge import Knowledge
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.aerial.plan_status import FlightPhase, FlightStatus
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.tolerances import TIME_TOLERANCE

STATE_TOLERANCE = 1e-6  # [m, m/s] two states closer than this are the same
_BOUND = 1e-6  # [m/s, m/s^2] rounding allowed on a bound
_NEARLY = 0.8  # share of a tracking bound in speed that is left to a vehicle before its guarantee is in danger
_FALL = 4.0  # the part of a_max at which a large excess of speed falls at least
_PASS = 1e-3  # [m] a breakpoint this close to the target is a pass
_LOOKS = 512  # places on an arc at which filled cells are counted
_PHASES = frozenset(int(phase) for phase in FlightPhase)


@dataclass(frozen=True)
class TrackingBound:
    """Bounds that the tracker keeps: distance to the plan, speed error, and feedback."""

    horizontal: float  # [m] r_h
    vertical: float  # [m] r_z
    speed: float  # [m/s] r_v
    feedback: float  # [m/s^2] a_fb
    held: float | None = None
    """part of both distances [m] that is set aside for the lag of a held input; None for a tracker that keeps its bound
    over every plan within v_max and a_max"""

    def __post_init__(self) -> None:
        for name in ("horizontal", "vertical", "speed", "feedback", "held"):
            value = getattr(self, name)
            if value is not None and not value >= 0.0:  # nor is NaN
                raise ArgumentError(f"tracking bound: {name} = {value!r}; allowed: >= 0")

    def broken_by(self, error: Array | tuple[float, float, float]) -> bool:
        """True if an error of the state lies outside, whose first three numbers are those of the position [m]."""
        # Written this way round, so that NaN lies outside.
        return not (math.hypot(error[0], error[1]) <= self.horizontal and abs(error[2]) <= self.vertical)

    def how_far(self, error: Array | tuple[float, float, float]) -> str:
        """Say by how much an error of the state lies outside; "" for one within."""
        if not self.broken_by(error):
            return ""
        return f"{math.hypot(error[0], error[1]):.1f} m across, {error[2]:.1f} m up from the plan"


@dataclass(frozen=True)
class Refusal:
    """The reason why a plan is not certified."""

    status: Enum  # Status or FlightStatus
    message: str
    phase: FlightPhase | None = None


@dataclass(frozen=True, eq=False)
class Certificate:
    """C(pi) as a function; ``terrain`` is raised by ``raised_ground``, the other bounds are lowered by the tracking
    bound.
    """

    terrain: HeightField
    clearance_min: float  # [m] h_min
    speed_max: float  # [m/s]
    acceleration_max: float  # [m/s^2]
    target: Array  # (3,) [m]
    arrival_radius: float  # [m]
    border: float = 0.0  # [m] that is kept from the edge of the map
    across: float = 0.0  # [m] within which the terrain was raised to the highest ground: tracking bound and body
    rise: float = 0.0  # [m] by which it was raised in addition
    cruise_level: float = -np.inf  # [m] below which no completion path flies level
    held: HeldInput | None = None  # of a tracker that does not follow every plan

    @staticmethod
    def for_mission(mission: FlightMission, bound: TrackingBound, held: HeldInput | None = None) -> Certificate:
        """The certificate of a mission whose tracker keeps ``bound``, over plans whose lag ``held`` allows.

        Raises FieldError for an h_min below the body's reach; MissionError if the bound leaves nothing to fly with.
        """
        if not (mission.reach_in_terrain or mission.clearance_min >= mission.reach):
            raise FieldError(
                f"clearance_min = {mission.clearance_min:g} m; allowed: >= {mission.reach:g} m, the radius of the "
                "vehicle's hull"
            )
        speed = mission.speed_max - bound.speed
        acceleration = mission.acceleration_max - bound.feedback
        radius = mission.arrival_radius - float(np.hypot(bound.horizontal, bound.vertical))
        for name, left, whole in (
            ("speed_max", speed, mission.speed_max),
            ("acceleration_max", acceleration, mission.acceleration_max),
            ("arrival_radius", radius, mission.arrival_radius),
        ):
            if left <= 0.0:
                age = mission.quality.age
                late = f" with up to {age:.3g} s without a reading" if age > 0.0 else ""
                raise MissionError(
                    f"{name} = {whole:g} leaves nothing to plan with; allowed: > {whole - left:.3g}, "
                    f"which noise and gusts take{late}{_by_beacons(mission)}"
                )
        across = bound.horizontal + (0.0 if mission.reach_in_terrain else mission.reach)
        return Certificate(
            raised_ground(mission.terrain, across, bound.vertical),
            mission.clearance_min,
            speed,
            acceleration,
            np.array(mission.target, dtype=np.float64),
            radius,
            bound.horizontal + mission.reach,
            across,
            bound.vertical,
            mission.cruise_level,
            held,
        )

    def updated_with(self, messages: Sequence[Message]) -> Certificate:
        """The certificate with target and map of ``messages`` (``models.aerial.knowledge``); itself for none."""
        known = Knowledge(self.terrain, tuple(self.target.tolist()))
        now = known.updated_with(messages)
        certificate = self
        if now.target != known.target:
            certificate = dataclasses.replace(certificate, target=np.array(now.target, dtype=np.float64))
        if now.terrain is not known.terrain:
            certificate = dataclasses.replace(certificate, terrain=raised_ground(now.terrain, self.across, self.rise))
        return certificate

    def reaches_target(self, plan: Plan) -> bool:
        """True if a plan ends within ``arrival_radius`` of the target."""
        return math.dist(plan.x[-1, :3].tolist(), self.target.tolist()) <= self.arrival_radius

    def speeding(self, x: Array, bound: TrackingBound) -> str:
        """Say that a vehicle at the estimate x (6,) may soon be faster than v_max; "" for one that may not.

        v_max is what plans are left and the tracking bound in speed, of which it has used up most then.
        """
        speed, most = math.hypot(x[3], x[4], x[5]), self.speed_max + _NEARLY * bound.speed
        return "" if speed <= most else f"{speed:.2f} m/s; allowed {self.speed_max + bound.speed:.2f}"

    def check(self, plan: Plan, lag: Array = NO_LAG) -> Refusal | None:
        """Check C(plan): None if it holds, else the first reason why not.

        ``lag`` (6,) [m, m/s] is that of the vehicle when the plan takes over (``HeldInput``).
        """
        if misfit := _misfit(plan):
            return misfit
        finite, increasing, gap, speed, push = _along_arcs(*_writable(plan))
        if not finite:
            return Refusal(Status.NOT_FINITE, "t, x or u is not finite")
        if not increasing:
            return Refusal(Status.MALFORMED, "times do not increase")
        if not _PHASES.issuperset(plan.phase.tolist()):
            return Refusal(
                Status.MALFORMED, f"phases {np.unique(plan.phase).tolist()}; allowed {[int(p) for p in FlightPhase]}"
            )
        if not gap <= STATE_TOLERANCE:  # nor does NaN
            return Refusal(Status.MALFORMED, f"arcs miss each other by {gap:.3g}")
        if too_fast := self._check_speed(plan, speed):
            return too_fast
        if push > self.acceleration_max + _BOUND:
            return Refusal(FlightStatus.BOUNDS, f"|a| reaches {push:.2f} m/s^2; allowed {self.acceleration_max:.2f}")
        if not self.reaches_target(plan) or speed[-1] > _BOUND:
            miss = float(np.linalg.norm(plan.x[-1, :3] - self.target))
            return Refusal(FlightStatus.NO_ARRIVAL, f"ends {miss:.1f} m from the target at {speed[-1]:.2f} m/s")
        return self._check_lag(plan, lag) or self.check_clearance(plan)

    def _check_lag(self, plan: Plan, lag: Array) -> Refusal | None:
        if self.held is None:
            return None
        greatest = self.held.greatest(plan, lag)
        if greatest <= self.held.allowed:
            return None
        return Refusal(
            FlightStatus.NOT_TRACKABLE,
            f"commands held for {1e3 * self.held.period:.3g} ms fall {greatest:.3g} m behind it; "
            f"allowed {self.held.allowed:.3g}",
        )

    def _check_speed(self, plan: Plan, speed: Array) -> Refusal | None:
        """Check |v|, which is convex on an arc, against v_max plus what is left of the start's excess, which is linear
        up to its end: at both ends of each arc, where it is ``speed`` (K + 1,) [m/s], and at that end, and therefore
        everywhere.
        """
        if float(speed.max()) <= self.speed_max:
            return None
        excess = max(0.0, float(speed[0]) - self.speed_max)
        duration = max(self.speed_max, _FALL * excess) / self.acceleration_max
        allowed = self.speed_max + excess * np.maximum(0.0, 1.0 - (plan.t - plan.t_start) / duration)
        if excess > _BOUND and plan.t_start + duration < plan.t_end:
            then = state_at(plan, plan.t_start + duration)
            speed, allowed = np.append(speed, np.linalg.norm(then[3:])), np.append(allowed, self.speed_max)
        worst = int((speed - allowed).argmax())
        if speed[worst] <= allowed[worst] + _BOUND:
            return None
        fast = f"|v| reaches {speed[worst]:.2f} m/s; allowed {allowed[worst]:.2f}"
        start = f", falling from {speed[0]:.2f} at the start to {self.speed_max:.2f} within {duration:.2f} s"
        return Refusal(FlightStatus.BOUNDS, fast + (start if excess > _BOUND else ""))

    def clearances(self, plan: Plan) -> Array:
        """Least clearance (K,) [m] of each arc of a plan; -inf off the map."""
        return self.terrain.path_clearance(plan.x[:-1, :3], plan.x[:-1, 3:], plan.u, np.diff(plan.t))

    def check_clearance(self, plan: Plan) -> Refusal | None:
        """Check the clearance and the distance to the edge of the map of a plan whose arcs are sound."""
        clearance = self.clearances(plan)
        worst = int(clearance.argmin())
        if clearance[worst] < self.clearance_min:
            phase = FlightPhase(int(plan.phase[worst]))
            if np.isneginf(clearance[worst]):
                return Refusal(FlightStatus.OFF_MAP, f"in the {phase.name.lower()} arc at {plan.t[worst]:.1f} s", phase)
            if over := self._over_filled(plan, worst):
                return Refusal(FlightStatus.LOW_CLEARANCE, over, phase)
            low = f"{clearance[worst]:.1f} m in the {phase.name.lower()} arc at {plan.t[worst]:.1f} s"
            return Refusal(FlightStatus.LOW_CLEARANCE, f"{low}; allowed {self.clearance_min:g}", phase)
        arcs = _writable(plan)
        for axis, edge in enumerate((self.terrain.width, self.terrain.depth)):
            least, greatest = _extent(*arcs, axis)
            room = min(least, edge - greatest)
            if room < self.border:
                return Refusal(
                    FlightStatus.OFF_MAP, f"{room:.2f} m from the edge of the map; allowed {self.border:.2f}"
                )
        return None

    def _over_filled(self, plan: Plan, arc: int) -> str:
        """Return the reason against an arc below a wall, which stands where no height is known; empty for others."""
        way = state_at(plan, np.linspace(plan.t[arc], plan.t[arc + 1], _LOOKS))[:, :2]
        walled = way[self.terrain.walled(*way.T)]
        if not len(walled):
            return ""
        cells = len(np.unique((walled / self.terrain.spacing).astype(int), axis=0))
        (x, y), name = walled[0], FlightPhase(int(plan.phase[arc])).name.lower()
        return (
            f"rests on {cells} filled cells at ({x:.0f}, {y:.0f}) m, in the {name} arc at {plan.t[arc]:.1f} s; "
            "allowed: ground that was surveyed, or whose error is stated (terrain import --void-error)"
        )


def _by_beacons(mission: FlightMission) -> str:
    """Addition to a message about noise in a mission with beacons, whose places decide on it."""
    if mission.beacons is None:
        return ""
    return (
        f"; by its beacons the position is declared to {math.sqrt(float(mission.quality.error[0, 0])):.3g} m, one "
        "sigma: nearer ones, more of them, or a smaller position_std_max of kalman help too"
    )


@lru_cache(maxsize=8)
def raised_ground(terrain: HeightField, across: float, rise: float) -> HeightField:
    """``terrain.inflated(across, rise)``, both [m]: one object for all that ask, for instance a mission's certificates
    and cost-to-go.
    """
    return terrain.inflated(across, rise)


@njit(cache=True, nogil=True)
def _extent(t: Array, x: Array, u: Array, axis: int) -> tuple[float, float]:
    """Least and greatest position [m] along an axis on all arcs: t (K + 1,) [s], x (K + 1, 6), u (K, 3)."""
    least, greatest = np.inf, -np.inf
    for k in range(len(u)):
        p, v, a, duration = x[k, axis], x[k, 3 + axis], u[k, axis], t[k + 1] - t[k]
        vertex = min(max(-v / a, 0.0), duration) if a != 0.0 else duration
        for s in (0.0, vertex, duration):
            met = p + s * v + 0.5 * s * s * a
            least, greatest = min(least, met), max(greatest, met)
    return least, greatest


@njit(cache=True, nogil=True)
def _along_arcs(t: Array, x: Array, u: Array) -> tuple[bool, bool, float, Array, float]:
    """Check of a plan's arcs: all finite, times increase, largest gap between arcs, speeds (K + 1,) [m/s], largest |u|.

    Arcs: t (K + 1,) [s], x (K + 1, 6) [m, m/s], u (K, 3) [m/s^2].
    """
    finite, increasing, gap, push = np.isfinite(t[0]), True, 0.0, 0.0
    speed = np.empty(len(t))
    for k in range(len(t)):
        for i in range(6):
            finite = finite and np.isfinite(x[k, i])
        speed[k] = math.sqrt(x[k, 3] * x[k, 3] + x[k, 4] * x[k, 4] + x[k, 5] * x[k, 5])
    for k in range(len(u)):
        h = t[k + 1] - t[k]
        finite, increasing = finite and np.isfinite(t[k + 1]), increasing and h > 0.0
        for i in range(3):
            finite = finite and np.isfinite(u[k, i])
            missed = abs(x[k, i] + h * x[k, 3 + i] + 0.5 * (h * h) * u[k, i] - x[k + 1, i])
            missed_speed = abs(x[k, 3 + i] + h * u[k, i] - x[k + 1, 3 + i])
            if not (missed <= gap and missed_speed <= gap) and not np.isnan(gap):  # NaN stays
                gap = missed + missed_speed if np.isnan(missed + missed_speed) else max(missed, missed_speed)
        push = max(push, math.sqrt(u[k, 0] * u[k, 0] + u[k, 1] * u[k, 1] + u[k, 2] * u[k, 2]))
    return finite, increasing, gap, speed, push


def _writable(plan: Plan) -> tuple[Array, Array, Array]:
    """Copies of t, x and u: of one type, whether the plan is read-only or not, so that a kernel is compiled once."""
    t, x, u = (np.array(values, dtype=np.float64, order="C") for values in (plan.t, plan.x, plan.u))
    return t, x, u


def _misfit(plan: Plan) -> Refusal | None:
    """Reason why the arrays of a plan do not fit together; None if they do."""
    arcs = len(plan.t) - 1
    if arcs < 1 or plan.x.shape != (arcs + 1, 6) or plan.u.shape != (arcs, 3) or plan.phase.shape != (arcs,):
        shapes = f"t {plan.t.shape}, x {plan.x.shape}, u {plan.u.shape}, phase {plan.phase.shape}"
        return Refusal(Status.MALFORMED, f"{shapes}; allowed (K + 1,), (K + 1, 6), (K, 3), (K,) with K >= 1")
    return None


def pass_time(plan: Plan, target: Array, after: float) -> float:
    """First breakpoint [s] later than ``after`` [s] at which the plan is at the target (3,) [m]; inf if none."""
    first, place = int(plan.t.searchsorted(after + TIME_TOLERANCE, side="right")), target.tolist()
    for t, position in zip(plan.t[first:].tolist(), plan.x[first:, :3].tolist(), strict=True):
        if math.dist(position, place) <= _PASS:
            return float(t)
    return math.inf


def remainder(plan: Plan, t: float) -> Plan:
    """Remainder of a plan from ``t`` [s] on, itself a plan: of one that has come to its end, a second of rest."""
    if t >= plan.t_end - TIME_TOLERANCE:
        x = np.vstack([plan.x[-1], plan.x[-1]])
        rest = np.array([t, t + 1.0]), x, np.zeros((1, x.shape[1] // 2)), np.array([FlightPhase.HOVER], np.int64)
        return Plan(*rest, cost=plan.cost)
    k = max(0, int(np.searchsorted(plan.t, t + TIME_TOLERANCE, side="right")) - 1)
    left, x = plan.t[k:].copy(), plan.x[k:].copy()
    left[0], x[0] = t, state_at(plan, t)
    return dataclasses.replace(plan, t=left, x=x, u=plan.u[k:], phase=plan.phase[k:], solve_ms=np.nan, notes=())
