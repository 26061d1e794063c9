"""What a flight was worth, from its log and the truth."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sim.log import Recording
from sim.signals import Array, Plan

if TYPE_CHECKING:  # the compiled kernels take a while to import, and most that import this only read names
    from models.aerial.mission import FlightMission
    from models.terrain.visibility import RadarTrack

# The summary's figures as they are read, for every table that shows them.
SUMMARY_GROUPS: dict[str, tuple[str, ...]] = {
    "impact": ("hit", "miss_m", "aspect_error_deg", "path_angle_error_deg", "impact_speed_m_s", "impact_time_s"),
    "estimate": (
        "converged", "position_rms_m", "heading_rms_deg", "convergence_time_s", "position_error_max_m",
        "heading_error_max_deg", "nees_mean", "observable", "lost_ranges", "initialising_s", "lost_s",
        "velocity_rms", "position_rms", "velocity_rms_last_quarter", "velocity_error_start", "velocity_error_end",
        "found_from_s", "error_start", "error_rms", "error_end", "error_max", "decay_rate_per_s", "escaped",
        "escape_time_s",
    ),
    "mission": (
        "vehicles", "arrived", "arrived_vehicles", "spread_s", "first_arrival_s", "arrival_time_s", "deadline_s",
        "planned_time_s", "flight_time_s", "run_time_s", "speed_max",
    ),
    "path": (
        "path_length_m", "straight_line_m", "mean_height_m", "apex_m", "attack_angle_max_deg",
        "cost", "planned_cost", "control_effort", "radar_exposure_s",
    ),
    "safety": (
        "min_clearance_m", "separation_min_m", "separation_allowed_m", "nearest_pair", "wall_clearance_min_m",
        "ground_contacts", "touched_wall", "speed_max_m_s",
        "missed_passes", "guarantee_lost",
    ),
    "tracking": (
        "attitude_rms_rad", "settled_at_s",
        "tracking_breaches", "tracking_error_max_m", "tracking_error_rms_m", "tracking_bound_m",
        "tracking_bound_horizontal_m", "tracking_bound_vertical_m", "rebased_plans",
        "tilt_max_deg", "thrust_mean_share", "thrust_max_share", "saturated_share", "saturated_s", "inputs_clipped",
    ),
    "planning": (
        "replans", "plans_adopted", "plans_rejected", "plans_not_admitted", "proposals_refused",
        "outliers", "clocks_apart", "manoeuvres_rejected", "late_plans", "fallback_steps",
    ),
    "solver": ("solver_failures", "iteration_limits", "solve_ms_mean", "solve_ms_p50", "solve_ms_p99", "solve_ms_max"),
}  # fmt: skip
# By the end of a name; the longer first.
UNITS = {"_per_s": "1/s", "_m_s": "m/s", "_deg": "deg", "_rad": "rad", "_ms": "ms", "_s": "s", "_m": "m"}
# What a name alone does not say; |v| is a length in the metric of what moves.
LABELS = {
    "velocity_rms": ("velocity error, rms", "in units of v"),
    "position_rms": ("distance of position, rms", "in the metric"),
    "velocity_rms_last_quarter": ("|Δv| of the last quarter", "in the metric"),
    "velocity_error_start": ("|Δv| at the start", "in the metric"),
    "velocity_error_end": ("|Δv| at the end", "in the metric"),
    "found_from_s": ("velocity found after", "s"),
    "speed_max": ("highest |v|", "in the metric"),
    "attitude_rms_rad": ("angle to reference, rms", "rad"),
    "settled_at_s": ("on the reference after", "s"),
}
SHORTFALL = "shortfall"  # the summary's key of what a run did not do; without it the mission did what it should
FAILURES = ("solver-failed", "infeasible", "raised", "not-finite", "malformed")
REJECTIONS = ("low-clearance", "off-map", "bounds", "deadline", "no-arrival", "wrong-start")

_SIMULTANEOUS = 1e-9  # [s]


class Bound(Protocol):
    """What a tracker says it keeps."""

    horizontal: float  # [m]
    vertical: float  # [m]


def label(key: str) -> tuple[str, str]:
    """The readable name and the unit ("" for none) of a key of the summary."""
    if key.startswith("solve_ms_"):
        return f"solve time {key.removeprefix('solve_ms_')}", "ms"
    if key in LABELS:
        return LABELS[key]
    end = next((end for end in UNITS if key.endswith(end)), "")
    return key.removesuffix(end).replace("_", " "), UNITS.get(end, "")


def is_wall_clock(key: str) -> bool:
    """Whether a key of a summary tells how long something took: such figures differ from run to run."""
    return key.startswith("solve_ms") or key.endswith("_wall_s") or key == "real_time_factor"


def solve_times(solve_ms: Sequence[float]) -> dict[str, float]:
    """The summary's figures of how long the optimisations took [ms]; NaN without any."""
    times = np.array(solve_ms) if solve_ms else np.array([np.nan])
    return {
        "solve_ms_mean": float(times.mean()),
        "solve_ms_p50": float(np.percentile(times, 50)),
        "solve_ms_p99": float(np.percentile(times, 99)),
        "solve_ms_max": float(times.max()),
    }


def references(t: Array, plans: Sequence[tuple[float, Plan]]) -> Array:
    """The state (n, 6) that the tracker was asked for at each time, of (adopted at [s], plan); NaN before the first.

    Where a plan takes over it is still that of the plan before, so that the deviation which ends a plan counts.
    """
    from models.aerial.dynamics import state_at

    out = np.full((len(t), 6), np.nan)
    ends = [*(start for start, _ in plans), math.inf][1:]  # none without a plan
    for k, ((adopted, plan), following) in enumerate(zip(plans, ends, strict=True)):
        begun = t > adopted + _SIMULTANEOUS if k else t > adopted - _SIMULTANEOUS
        flown = begun & (t <= following + _SIMULTANEOUS)
        out[flown] = state_at(plan, t[flown])
    return out


def episodes(flags: NDArray[np.bool_]) -> int:
    """How often a sequence of booleans becomes true."""
    return int(np.count_nonzero(np.diff(np.concatenate([[False], flags]).astype(np.int8)) == 1))


def height_above_ground(x: Array, mission: FlightMission) -> Array:
    """(n,) [m] of states (n, 6)."""
    above: Array = x[:, 2] - mission.terrain.height(x[:, 0], x[:, 1])
    return above


def flown_clearance(t: Array, x: Array, mission: FlightMission) -> Array:
    """Least height above ground [m] from each look of the loop to the next (n - 1,); -inf off the map.

    The force is constant in between, so the path is one arc and its clearance exact. The arc is the one that ends in
    the next state: a displacement at the beginning of a step is part of it. Where the vehicle touches something the
    path is no arc, and what counts beside it are the states.
    """
    dt, v = np.diff(t)[:, None], x[:, 3:]
    begin = x[1:, :3] - 0.5 * dt * (v[:-1] + v[1:])
    arcs = mission.terrain.path_clearance(begin, v[:-1], np.diff(v, axis=0) / dt, dt[:, 0])
    states = np.nan_to_num(height_above_ground(x, mission), nan=-np.inf)
    least: Array = np.minimum(arcs, np.minimum(states[:-1], states[1:]))
    return least


def exposure(t: Array, x: Array, mission: FlightMission, radars: Sequence[RadarTrack]) -> float:
    """Time [s] spent in sight of at least one radar that is on."""
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
    """The flat summary of one vehicle's flight, SI units in the names."""
    t, x, agent = recording.t, recording.truths[name], recording.agents[name]
    kinds = Counter(event.kind for event in recording.events if event.agent == name)
    distance = np.linalg.norm(x[:, :3] - np.array(mission.target), axis=1)
    arrived = bool(distance[-1] <= mission.arrival_radius)
    error = x - references(t, agent.plans)
    broken = (np.hypot(error[:, 0], error[:, 1]) > bound.horizontal) | (np.abs(error[:, 2]) > bound.vertical)
    clearance = flown_clearance(t, x, mission)
    command = agent.commands[: recording.length - 1]
    return {
        "arrived": arrived,
        "arrival_time_s": float(t[-1]) if arrived else None,
        "deadline_s": deadline,
        "flight_time_s": float(t[-1]),
        "path_length_m": float(np.linalg.norm(np.diff(x[:, :3], axis=0), axis=1).sum()),
        "straight_line_m": float(np.linalg.norm(np.subtract(mission.target, mission.start))),
        "mean_height_m": float(np.average(height_above_ground(x, mission)[1:], weights=np.diff(t))),
        "control_effort": float((np.square(command).sum(axis=1) * np.diff(t)).sum()),
        "min_clearance_m": float(clearance.min()),
        "speed_max_m_s": float(np.linalg.norm(x[:, 3:], axis=1).max()),
        "ground_contacts": kinds["ground-contact"],
        "replans": agent.requests,
        "plans_adopted": len(agent.plans),
        "plans_rejected": sum(kinds[kind] for kind in REJECTIONS),
        "manoeuvres_rejected": kinds["manoeuvre-rejected"],
        "late_plans": kinds["late"],
        "fallback_steps": sum(kinds[kind] for kind in (*FAILURES, *REJECTIONS, "late")),
        "solver_failures": sum(kinds[kind] for kind in FAILURES),
        "iteration_limits": kinds["iteration-limit"],
        "tracking_breaches": episodes(broken),
        "tracking_error_max_m": float(np.nanmax(np.linalg.norm(error[:, :3], axis=1), initial=0.0)),
        "tracking_bound_m": float(math.hypot(bound.horizontal, bound.vertical)),
        "rebased_plans": kinds["rebased"],
        "missed_passes": kinds["missed-pass"],
        "guarantee_lost": kinds["guarantee-lost"] + kinds["deadline-lost"],
        "radar_exposure_s": exposure(t, x, mission, radars),
        **solve_times(agent.solve_ms),
        "real_time_factor": float(t[-1]) / wall_seconds,
        "seed": seed,
    }
