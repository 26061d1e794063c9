"""Figures of a flight, from its log and the truth.

The posterior Cramér-Rao bound of a flight by position fixes, as recorded.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Array, Plan
from mathnavi.interfaces.stretches import stretches
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.metrics.convergence import last_quarter
from mathnavi.sim.metrics.flight_beacons import beacon_bound, beacon_figures
from mathnavi.sim.metrics.planning import FAILURES, REJECTIONS, guarantee_losses, planner_share, solve_times
from mathnavi.sim.metrics.posterior_bound import BoundRecursion, PosteriorBound, estimates_at, judged_bound

if TYPE_CHECKING:
    from mathnavi.models.aerial.mission import FlightMission
    from mathnavi.models.terrain.visibility import RadarTrack


def flight_bound(recording: Recording, name: str, mission: FlightMission) -> PosteriorBound:
    """Bound of position and velocity (6,) of a point mass under gusts from fixes, judged by the position.

    The model is linear, so the bound is the covariance of a Kalman filter without floors, equal on all axes; that of a
    flight among beacons is ``beacon_bound``.
    """
    if mission.beacons is not None:
        return beacon_bound(recording, name, mission, mission.beacons)
    n, fixes = recording.length, recording.agents[name].readings.get("position")
    if fixes is None:
        return PosteriorBound.none("the estimator reads no position fixes", n)
    if not mission.position_noise > 0.0:
        return PosteriorBound.none("the fixes are declared exact", n)
    from mathnavi.estimators.flight_model import AxisModel, clipped_rms  # takes a while to import

    rms = clipped_rms(mission.gust)
    if not rms > 0.0:
        return PosteriorBound.none("the start is exact, no gusts are declared, and so the bound is zero", n)
    axis = AxisModel(rms, mission.gust.time_constant, mission.position_noise)
    recursion = BoundRecursion(covariance=np.diag([0.0, 0.0, rms**2]))
    W = np.array([[1.0 / mission.position_noise, 0.0, 0.0]])
    variance, discrete = np.zeros((n, 2)), dict[float, tuple[Array, Array, Array]]()
    intervals = [0.0, *(round(each, 10) for each in np.diff(recording.t[:n]).tolist())]
    fixed = np.all(np.isfinite(fixes[:n]), axis=1).tolist()
    for k, h in enumerate(intervals):
        if k:
            F, _, Q = discrete.get(h) or discrete.setdefault(h, axis.discretised(h))
            recursion.predict(F, Q)
        if fixed[k]:
            recursion.observe(W)
        now = recursion.variance
        assert now is not None
        variance[k] = now[:2]
    deviation = np.repeat(np.sqrt(np.maximum(variance, 0.0)), 3, axis=1)
    return judged_bound(deviation, (0, 1, 2), "the position")


class Bound(Protocol):
    """The tracking bound that a tracker declares."""

    horizontal: float  # [m]
    vertical: float  # [m]


def references(t: Array, plans: Sequence[tuple[float, Plan]]) -> Array:
    """Reference states (n, 6) of the tracker at times t (n,) [s], from ``plans`` (adopted at [s], plan); NaN before the
    first.

    At the instant of a change of plans it is still that of the plan before, so that the deviation that ends a plan
    counts.
    """
    from mathnavi.models.aerial.dynamics import state_at

    out = np.full((len(t), 6), np.nan)
    ends = [*(start for start, _ in plans), math.inf][1:]  # none without a plan
    for k, ((adopted, plan), following) in enumerate(zip(plans, ends, strict=True)):
        begun = adopted + TIME_TOLERANCE if k else adopted - TIME_TOLERANCE
        flown = slice(*t.searchsorted((begun, following + TIME_TOLERANCE), side="right"))
        out[flown] = state_at(plan, t[flown])
    return out


def episodes(flags: NDArray[np.bool_]) -> int:
    """Number of times that a sequence (n,) of booleans becomes true."""
    return len(stretches(flags))


def height_above_ground(x: Array, mission: FlightMission) -> Array:
    """Heights above ground (n,) [m] of states x (n, 6)."""
    above: Array = x[:, 2] - mission.terrain.height(x[:, 0], x[:, 1])
    return above


def flown_clearance(t: Array, x: Array, mission: FlightMission) -> Array:
    """Least height above ground [m] from each sample to the next (n - 1,); -inf off the map.

    The force is constant in between, so the path is one arc and its clearance exact. The arc is the one that ends in
    the next state: a displacement at the beginning of a step is part of it. If the vehicle touches something the path
    is not an arc, and the heights of the states count too.
    """
    dt, v = np.diff(t)[:, None], x[:, 3:]
    begin = x[1:, :3] - 0.5 * dt * (v[:-1] + v[1:])
    arcs = mission.terrain.path_clearance(begin, v[:-1], np.diff(v, axis=0) / dt, dt[:, 0])
    states = np.nan_to_num(height_above_ground(x, mission), nan=-np.inf)
    least: Array = np.minimum(arcs, np.minimum(states[:-1], states[1:]))
    return least


def deadline_left(arrived: bool, t: float, deadline: float) -> float | None:
    """Time [s] left to the deadline when the flight ended at ``t`` [s]; None if it ended early without arriving."""
    return deadline - t if arrived or t > deadline else None


def exposure(t: Array, x: Array, mission: FlightMission, radars: Sequence[RadarTrack]) -> float:
    """Time [s] in sight of at least one radar that is on, of states x (n, 6) at times t (n,) [s]."""
    seen = np.zeros(len(t), dtype=bool)
    for radar in radars:
        seen |= radar.exposed(mission.terrain, t, x[:, :3])
    return float(np.sum(np.diff(t)[seen[:-1]]))


def flight_summary(
    recording: Recording,
    name: str,
    mission: FlightMission,
    radars: Sequence[RadarTrack],
    bound: Bound,
    deadline: float,
    seed: int,
    wall_seconds: float,
) -> dict[str, Any]:
    """Flat summary of one vehicle's flight, with SI units in the names."""
    t, x, agent = recording.t, recording.truths[name], recording.agents[name]
    kinds = Counter(event.kind for event in recording.events if event.agent == name)
    distance = np.linalg.norm(x[:, :3] - np.array(mission.target), axis=1)
    arrived = bool(distance[-1] <= mission.arrival_radius)
    error = x - references(t, agent.plans)
    share = np.maximum(np.hypot(error[:, 0], error[:, 1]) / bound.horizontal, np.abs(error[:, 2]) / bound.vertical)
    clearance = flown_clearance(t, x, mission)
    command = agent.commands[: recording.length - 1]
    least = flight_bound(recording, name, mission)
    recording.cramer_rao[name] = least.deviation
    estimated = estimates_at(recording, name, 6) - x
    return {
        "arrived": arrived,
        "arrival_time_s": float(t[-1]) if arrived else None,
        "deadline_s": deadline,
        "deadline_left_s": deadline_left(arrived, float(t[-1]), deadline),
        "flight_time_s": float(t[-1]),
        "path_length_m": float(np.linalg.norm(np.diff(x[:, :3], axis=0), axis=1).sum()),
        "straight_line_m": float(np.linalg.norm(np.subtract(mission.target, mission.start))),
        "mean_height_m": float(np.average(height_above_ground(x, mission)[1:], weights=np.diff(t))),
        "control_effort": float((np.square(command).sum(axis=1) * np.diff(t)).sum()),
        "min_clearance_m": float(clearance.min()),
        "clearance_margin_m": float(clearance.min()) - mission.clearance_min,
        "speed_max_m_s": float(np.linalg.norm(x[:, 3:], axis=1).max()),
        "ground_contacts": kinds["ground-contact"],
        "replans": agent.requests,
        "plans_adopted": len(agent.plans),
        "planner_share": planner_share(float(t[0]), float(t[-1]), agent.plans),
        "plans_rejected": sum(kinds[kind] for kind in REJECTIONS),
        "manoeuvres_rejected": kinds["manoeuvre-rejected"],
        "late_plans": kinds["late"],
        "fallback_steps": sum(kinds[kind] for kind in (*FAILURES, *REJECTIONS, "late")),
        "solver_failures": sum(kinds[kind] for kind in FAILURES),
        "iteration_limits": kinds["iteration-limit"],
        "tracking_breaches": episodes(share > 1.0),
        "tracking_bound_share": float(np.nanmax(share, initial=0.0)),
        "tracking_error_max_m": float(np.nanmax(np.linalg.norm(error[:, :3], axis=1), initial=0.0)),
        "tracking_bound_m": float(math.hypot(bound.horizontal, bound.vertical)),
        "rebased_plans": kinds["rebased"],
        "missed_passes": kinds["missed-pass"],
        "guarantee_lost": guarantee_losses(recording.events, (name,)),
        "deadlines_lost": kinds["deadline-lost"],
        "radar_exposure_s": exposure(t, x, mission, radars),
        **({} if mission.beacons is None else beacon_figures(recording, name, mission.beacons)),
        **least.figures(estimated[:, list(least.judged)], last_quarter(t), "the last quarter"),
        **solve_times(agent.solve_ms),
        "real_time_factor": float(t[-1]) / wall_seconds,
        "seed": seed,
    }
