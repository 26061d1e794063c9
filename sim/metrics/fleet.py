"""Figures of a fleet's flight: arrival times, least separation, agreement."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.visibility import RadarTrack
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.metrics.flight import deadline_left, exposure, flown_clearance
from mathnavi.sim.metrics.planning import FAILURES, REJECTIONS, guarantee_losses, planner_share, solve_times

_PIECE = 64  # samples in a box
_ROUNDING = 1e-6  # [m] of a distance that is found in two ways


def arrival_times(recording: Recording, missions: Mapping[str, FlightMission]) -> dict[str, float]:
    """Times [s] at which each vehicle first came within its arrival radius, interpolated between samples; NaN if it did
    not.
    """
    return {
        name: arrival_time(recording.t, recording.truths[name], np.array(mission.target), mission.arrival_radius)
        for name, mission in missions.items()
    }


def arrival_time(t: Array, x: Array, target: Array, radius: float) -> float:
    """Time [s] at which states ``x`` (n, 6) at times (n,) first lie within ``radius`` [m] of a target (3,) [m]; NaN if
    never.

    Between two samples the distance is interpolated linearly.
    """
    distance = np.linalg.norm(x[:, :3] - target, axis=1)
    near = np.flatnonzero(distance <= radius)
    if not len(near) or near[0] == 0:
        return float(t[0]) if len(near) else np.nan
    k = int(near[0])
    far, close = float(distance[k - 1]), float(distance[k])
    return float(t[k - 1] + (t[k] - t[k - 1]) * (far - radius) / max(far - close, 1e-12))


def least_separation(recording: Recording, names: Sequence[str]) -> tuple[float, tuple[str, str]]:
    """Least distance [m] between any two vehicles at any time, and the names of these two.

    Between two samples the vehicles are assumed to move straight: an error of a_max h^2 / 4 at most, some millimetres.
    """
    nearest, pair = np.inf, ("", "")
    boxes = np.array([_boxes(recording.truths[name][:, :3]) for name in names])
    for k, one in enumerate(names):
        gaps = np.maximum(boxes[k, :, 0] - boxes[k + 1 :, :, 1], boxes[k + 1 :, :, 0] - boxes[k, :, 1])
        apart = np.sqrt((np.maximum(gaps, 0.0) ** 2).sum(axis=2).min(axis=1, initial=np.inf))
        for j in np.flatnonzero(apart <= nearest + _ROUNDING).tolist():
            if apart[j] > nearest + _ROUNDING:
                continue
            other = names[k + 1 + j]
            least = float(_least_of_segments(recording.truths[one][:, :3] - recording.truths[other][:, :3]))
            if least < nearest:
                nearest, pair = least, (one, other)
    return nearest, pair


def _boxes(points: Array) -> Array:
    """Corners (k, 2, 3), lowest and highest, of boxes around pieces of the polygon through points (n, 3)."""
    begins = np.arange(0, max(len(points) - 1, 1), _PIECE)
    ends = points[np.minimum(begins + _PIECE, len(points) - 1)]
    low, high = np.minimum.reduceat(points, begins), np.maximum.reduceat(points, begins)
    return np.stack([np.minimum(low, ends), np.maximum(high, ends)], axis=1)


def _least_of_segments(points: Array) -> float:
    """Least norm along the polygon through points (n, 3)."""
    if len(points) < 2:
        return float(np.linalg.norm(points[0]))
    along = np.diff(points, axis=0)
    square = np.einsum("ij,ij->i", along, along)
    share = -np.einsum("ij,ij->i", points[:-1], along) / np.where(square > 0.0, square, 1.0)
    nearest = points[:-1] + np.clip(share, 0.0, 1.0)[:, None] * along
    return float(np.linalg.norm(nearest, axis=1).min())


def fleet_summary(
    recording: Recording,
    missions: Mapping[str, FlightMission],
    radars: Sequence[RadarTrack],
    deadline: float,
    zone: float,
    seed: int,
    wall_seconds: float,
) -> dict[str, Any]:
    """Flat summary of a fleet; times in s, lengths in m, ``zone`` [m] is the distance that they keep."""
    arrivals = arrival_times(recording, missions)
    times = np.array(list(arrivals.values()))
    nearest, pair = least_separation(recording, list(missions))
    kinds = Counter(event.kind for event in recording.events)
    agents = [recording.agents[name] for name in missions]
    clearance = min(
        float(flown_clearance(recording.t, recording.truths[name], mission).min()) for name, mission in missions.items()
    )
    losses = guarantee_losses(recording.events, missions)
    begin, last = float(recording.t[0]), float(recording.t[-1])
    shares = [
        planner_share(begin, arrival if math.isfinite(arrival) else last, recording.agents[name].plans)
        for name, arrival in arrivals.items()
    ]
    everybody = bool(np.isfinite(times).all())
    end = float(times.max()) if everybody else last
    return {
        "vehicles": len(missions),
        "arrived": everybody,
        "arrived_vehicles": int(np.isfinite(times).sum()),
        "spread_s": float(times.max() - times.min()) if everybody else None,
        "first_arrival_s": float(np.nanmin(times)) if np.isfinite(times).any() else None,
        "arrival_time_s": float(times.max()) if everybody else None,
        "deadline_s": deadline,
        "deadline_left_s": deadline_left(everybody, end, deadline),
        "separation_min_m": nearest if len(missions) > 1 else None,
        "separation_allowed_m": zone,
        "separation_margin_m": nearest - zone if len(missions) > 1 else None,
        "nearest_pair": " and ".join(pair),
        "min_clearance_m": clearance,
        "clearance_margin_m": clearance - next(iter(missions.values())).clearance_min,
        "ground_contacts": kinds["ground-contact"],
        "radar_exposure_s": sum(
            exposure(recording.t, recording.truths[name], mission, radars) for name, mission in missions.items()
        ),
        "replans": sum(agent.requests for agent in agents),
        "plans_adopted": sum(len(agent.plans) for agent in agents),
        "planner_share": float(np.mean(shares)),
        "plans_rejected": sum(kinds[kind] for kind in REJECTIONS),
        "plans_not_admitted": kinds["not-admitted"],
        "proposals_refused": kinds["separation-refused"],
        "solver_failures": sum(kinds[kind] for kind in FAILURES),
        "guarantee_lost": None if losses is None else losses + kinds["separation-unguaranteed"],
        "deadlines_lost": kinds["deadline-lost"],
        "arrivals_deferred": kinds["arrival-deferred"],
        "arrivals_unkept": kinds["arrival-unkept"],
        "outliers": kinds["outlier"],
        "clocks_apart": kinds["clock-apart"],
        **solve_times([ms for agent in agents for ms in agent.solve_ms]),
        "real_time_factor": float(recording.t[-1]) / wall_seconds,
        "seed": seed,
    }
