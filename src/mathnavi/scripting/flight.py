"""Planner and certificate of aerial vehicles, each usable alone: without scenario, loop and plug-in.

Map frame: x [m] east and y [m] north of the terrain's south-west corner, z [m] above sea level. A state is
(p, v), (6,) [m, m/s]; an input is the acceleration (3,) [m/s^2], held over an arc, so that on each arc

    p(t) = p_k + v_k (t - t_k) + a_k (t - t_k)^2 / 2.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mathnavi.controllers.flight.certificate import Certificate, TrackingBound, pass_time
from mathnavi.controllers.flight.certified import Certified
from mathnavi.interfaces.errors import MissionError, TerrainError
from mathnavi.interfaces.failures import raising
from mathnavi.interfaces.protocols import Planner
from mathnavi.interfaces.short_tables import Row, html_table, short_table, vector_text
from mathnavi.interfaces.signals import OPTIMISED, Array, Estimate, Plan, PlanRequest, Status
from mathnavi.models.aerial.dynamics import HULL_RADIUS, flow, input_at, state_at
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain
from mathnavi.models.terrain.visibility import Radar
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.scripting.requests import plugin
from mathnavi.sim.plugin.registry import PluginSpec, checked_controller
from mathnavi.sim.scenarios.flight_parts import check_above_ground

Terrain = HeightField | str | Path
_REPLANS = 100_000


@dataclass(frozen=True, eq=False, repr=False)
class FlightPlan:
    """Trajectory of arcs with constant acceleration, stamped in absolute time: your own, or the planner's."""

    plan: Plan
    arrival: float = math.nan  # [s] when it first is at its target; NaN for a user-defined plan

    @staticmethod
    def from_inputs(t: ArrayLike, start: ArrayLike, u: ArrayLike) -> FlightPlan:
        """Return the plan from the state start (6,) with accelerations u (K, 3) [m/s^2] between times t (K + 1,) [s].

        Raises MissionError for arrays that do not fit together, that are not finite, or times that do not increase.
        """
        times, x, inputs = (np.array(values, dtype=np.float64) for values in (t, start, u))
        if times.ndim != 1 or len(times) < 2 or x.shape != (6,) or inputs.shape != (len(times) - 1, 3):
            raise MissionError(
                f"t {times.shape}, start {x.shape}, u {inputs.shape}; allowed: (K + 1,), (6,), (K, 3) with K >= 1"
            )
        if not all(np.isfinite(values).all() for values in (times, x, inputs)) or (np.diff(times) <= 0.0).any():
            raise MissionError("t, start, u: allowed: finite numbers, and times that increase")
        states = [x]
        for duration, held in zip(np.diff(times), inputs, strict=True):
            states.append(flow(states[-1], held, float(duration)))
        phase = np.full(len(inputs), OPTIMISED, dtype=np.int64)
        return FlightPlan(Plan(times, np.array(states), inputs, phase))

    @property
    def t(self) -> Array:
        """Ends (K + 1,) [s] of the arcs."""
        return self.plan.t

    @property
    def x(self) -> Array:
        """States (K + 1, 6) [m, m/s] at ``t``."""
        return self.plan.x

    @property
    def u(self) -> Array:
        """Accelerations (K, 3) [m/s^2] of the arcs."""
        return self.plan.u

    @property
    def duration(self) -> float:
        """Time [s] from the first state to the last."""
        return self.plan.t_end - self.plan.t_start

    def state(self, t: ArrayLike) -> Array:
        """Return the state (6,) at a time t [s], or (n, 6) at times (n,); outside the plan its first or last state."""
        return state_at(self.plan, float(t) if np.ndim(t) == 0 else np.asarray(t, dtype=np.float64))  # type: ignore[arg-type]

    def input(self, t: float) -> Array:
        """Return the acceleration (3,) [m/s^2] from a time t [s] on; zero before the plan and after it."""
        return input_at(self.plan, t)

    def clearance(self, terrain: Terrain) -> float:
        """Return least height above the ground [m] over the whole plan, exact for every instant; -inf off the map."""
        return float(self.clearances(terrain).min())

    def clearances(self, terrain: Terrain) -> Array:
        """Return the clearance (K,) [m] of each arc."""
        ground = ground_of(terrain)
        return ground.path_clearance(self.x[:-1, :3], self.x[:-1, 3:], self.u, np.diff(self.t))

    def _table(self) -> tuple[str, list[Row]]:
        begin, end = self.x[0, :3], self.x[-1, :3]
        speed, push = (float(np.linalg.norm(values, axis=1).max()) for values in (self.x[:, 3:], self.u))
        points = self.state(np.linspace(self.t[0], self.t[-1], 2001))[:, :3]
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        return f"plan of {len(self.u)} arcs", [
            ("from", vector_text(begin, 6), "m"),
            ("to", vector_text(end, 6), "m"),
            *([] if math.isnan(self.arrival) else [("at the target after", f"{self.arrival:.2f}", "s")]),
            ("duration, to rest", f"{self.duration:.2f}", "s"),
            ("length", f"{length / 1e3:.2f}", "km"),
            ("highest speed", f"{speed:.1f}", "m/s"),
            ("highest acceleration", f"{push:.1f}", "m/s^2"),
        ]

    def __repr__(self) -> str:
        return short_table(*self._table())

    def _repr_html_(self) -> str:
        return html_table(*self._table())


@dataclass(frozen=True, repr=False)
class Verdict:
    """Result of a certificate: certified or not, which is its truth value, and the first reason why not."""

    certified: bool
    reason: str  # "" if it is certified
    status: Enum  # Status.OK, or a Status or FlightStatus that says why not
    clearance: float  # [m] least height above the highest that the ground can be, -inf off the map, NaN if malformed

    def __bool__(self) -> bool:
        return self.certified

    def __repr__(self) -> str:
        title = "certified" if self.certified else f"not certified: {self.reason}"
        return short_table(title, [("least clearance", f"{self.clearance:.2f}", "m")])


def certify(
    plan: FlightPlan | Plan,
    terrain: Terrain,
    *,
    target: Sequence[float] | None = None,
    clearance_min: float = 50.0,
    speed_max: float = 300.0,
    acceleration_max: float = 40.0,
    arrival_radius: float = 50.0,
    tracking: tuple[float, float] = (0.0, 0.0),
    reach: float = HULL_RADIUS,
) -> Verdict:
    """Evaluate the certificate C(pi) of any plan over a terrain: for every instant of it, and exactly,

        clearance >= clearance_min [m],   |v| <= speed_max [m/s],   |a| <= acceleration_max [m/s^2],

    its arcs join, it stays on the map, and it comes to rest within ``arrival_radius`` [m] of ``target`` (3,) [m], its
    end if not given. A plan is the path of the centre of a ball of radius ``reach`` [m], and ``tracking`` is
    the distance, horizontal and vertical [m], that the centre may have from it; both enter the clearance and the
    distance to the edge of the map. (Thesis, A.4; ``mathnavi.controllers.flight.certificate``.)

    Raises TerrainError for an unknown terrain, MissionError for a target that is not three finite numbers and for a
    ``clearance_min`` below ``reach``.
    """
    pi = plan.plan if isinstance(plan, FlightPlan) else plan
    ground = ground_of(terrain)
    if not clearance_min >= reach:
        raise MissionError(f"clearance_min = {clearance_min!r}; allowed: >= reach = {reach!r} m, the body's radius")
    if not min(tracking) >= 0.0:
        raise MissionError(f"tracking = {tracking!r}; allowed: two numbers >= 0 [m]")
    across, up = float(tracking[0]) + reach, float(tracking[1])
    with raising(MissionError):
        raised = ground.inflated(across, up)
    place = np.array(pi.x[-1, :3] if target is None and len(pi.x) else point_of("target", target), dtype=np.float64)
    certificate = Certificate(
        raised, clearance_min, speed_max, acceleration_max, place, arrival_radius, across, across, up
    )
    refusal = certificate.check(pi)
    malformed = refusal is not None and refusal.status in (Status.MALFORMED, Status.NOT_FINITE)
    clearance = math.nan if malformed else FlightPlan(pi).clearance(ground.highest)
    if refusal is None:
        return Verdict(True, "", Status.OK, clearance)
    return Verdict(False, f"{refusal.status.value}: {refusal.message}", refusal.status, clearance)


def plan_flight(
    terrain: Terrain,
    start: Sequence[float],
    target: Sequence[float],
    *,
    controller: PluginSpec | str = "flight",
    clearance_min: float = 50.0,
    speed_max: float = 300.0,
    acceleration_max: float = 40.0,
    arrival_radius: float = 50.0,
    radars: Sequence[Radar] = (),
    replan: bool = True,
) -> FlightPlan:
    """Return a certified plan from ``start`` to rest at ``target``, over a terrain (thesis, A.3 to A.5).

    The planner optimises over a receding horizon; behind every plan stand a safety manoeuvre and a way to rest at the
    target, and each is certified before it is adopted. With ``replan`` the planner runs again every period along its
    own plan, as in flight, and the whole trajectory is returned; without, only the first plan. The trajectory may pass
    the target at speed, at ``plan.arrival`` [s], before it comes to rest there.

    ``start`` is a position (3,) [m] at rest or a state (6,) [m, m/s], ``target`` a position (3,) [m], both in the map
    frame. ``clearance_min`` [m], ``speed_max`` [m/s] and ``acceleration_max`` [m/s^2] are kept at every instant;
    ``radars`` are avoided where that reduces the cost. ``controller`` is a plug-in for aerial vehicles, for example
    ``plugin("flight", nodes=7)``.

    Raises TerrainError for an unknown terrain, MissionError for a start or a target that is too low or off the
    map, and if no certified plan is found.
    """
    ground = ground_of(terrain)
    begin = np.array(start, dtype=np.float64)
    if begin.shape not in ((3,), (6,)) or not np.isfinite(begin).all():
        raise MissionError(f"start = {start!r}; allowed: three finite numbers [m], or six [m, m/s]")
    x = begin if len(begin) == 6 else np.concatenate([begin, np.zeros(3)])
    with raising(MissionError):
        mission = FlightMission(
            ground, tuple(x[:3].tolist()), point_of("target", target), clearance_min, speed_max, acceleration_max,
            arrival_radius=arrival_radius, radars=tuple(radars),
        )  # fmt: skip
        check_above_ground("start", mission.start, mission)
        check_above_ground("target", mission.target, mission)
        spec = plugin(controller) if isinstance(controller, str) else controller
        maker, tracker = checked_controller(spec, mission, TrackingBound)
        planner = Certified.for_mission(maker, mission, tracker)
    first = planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, x), None))
    if not first.ok:
        raise MissionError(f"no certified plan: {first.status.value}: {first.message}")
    place = np.array(mission.target)
    whole = _replanned(planner, first, place) if replan else first
    return FlightPlan(whole, min(pass_time(whole, place, -math.inf), whole.t_end))


def _replanned(planner: Planner, first: Plan, target: Array) -> Plan:
    """Return the trajectory that a receding horizon flies along its own plans until it is at the target (3,) [m]."""
    flown: list[Plan] = []
    plan, t = first, first.t_start + planner.period  # the first is flown for a period before another is computed
    for _ in range(_REPLANS):
        later = t + planner.period
        if later >= min(plan.t_end, pass_time(plan, target, t)) - TIME_TOLERANCE:
            break
        answer = planner.plan(PlanRequest(t, later, Estimate(t, state_at(plan, t)), plan))
        if answer.ok:
            flown.append(_until(plan, later))
            plan = answer
        t = later
    return _joined([*flown, plan])


def _until(plan: Plan, t: float) -> Plan:
    """Return the part of a plan before a time t [s], which ends with its state then."""
    k = int(np.searchsorted(plan.t, t - TIME_TOLERANCE))
    times, x = plan.t[: k + 1].copy(), plan.x[: k + 1].copy()
    times[k], x[k] = t, state_at(plan, t)
    return dataclasses.replace(plan, t=times, x=x, u=plan.u[:k], phase=plan.phase[:k])


def _joined(parts: Sequence[Plan]) -> Plan:
    """Join consecutive plans into one."""
    last = parts[-1]
    return dataclasses.replace(
        last,
        t=np.concatenate([*(part.t[:-1] for part in parts[:-1]), last.t]),
        x=np.concatenate([*(part.x[:-1] for part in parts[:-1]), last.x]),
        u=np.concatenate([part.u for part in parts]),
        phase=np.concatenate([part.phase for part in parts]),
        notes=(),
    )


def ground_of(terrain: Terrain) -> HeightField:
    """Return the heights of a terrain; TerrainError for an unknown one."""
    if isinstance(terrain, HeightField):
        return terrain
    if not isinstance(terrain, str | Path):
        kind = type(terrain).__name__
        raise TerrainError(f"terrain = a {kind}; allowed: HeightField(z, spacing), a terrain's name or its .npz file")
    try:
        return load_terrain(terrain)
    except (OSError, ValueError) as error:
        raise TerrainError(str(error)) from error


def point_of(name: str, point: Sequence[float] | None) -> tuple[float, float, float]:
    """Return the coordinates (x, y, z) [m] of a point; MissionError for other than three finite numbers."""
    values = np.array(point if point is not None else (), dtype=np.float64)
    if values.shape != (3,) or not np.isfinite(values).all():
        raise MissionError(f"{name} = {point!r}; allowed: three finite numbers [m]")
    x, y, z = values.tolist()
    return x, y, z
