"""A made-up run in the format of a real one: a flight around a radar that pops up, a plan to rest behind every step."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.plan_status import FlightPhase
from mathnavi.models.terrain.height_field import HeightField

TICK = 1.0 / 300.0
PERIOD = 5.0 / 3.0
SPEED, CLIMB_SPEED, BRAKING = 270.0, 40.0, 33.0
SUMMARY_NUMBERS = {
    "path_length_m": 0.0,
    "straight_line_m": 0.0,
    "control_effort": 1234.5,
    "min_clearance_m": 61.25,
    "ground_contacts": 0,
    "replans": 0,
    "plans_rejected": 3,
    "manoeuvres_rejected": 1,
    "late_plans": 0,
    "fallback_steps": 4,
    "solver_failures": 2,
    "tracking_breaches": 0,
    "radar_exposure_s": 1.5,
    "solve_ms_mean": 0.31,
    "solve_ms_p50": 0.27,
    "solve_ms_p99": 0.88,
    "solve_ms_max": 1.9,
    "real_time_factor": 5.2,
}


def ridges(nodes: int = 65, spacing: float = 200.0) -> HeightField:
    """A smooth mountain terrain."""
    x, y = np.meshgrid(np.arange(nodes) * spacing, np.arange(nodes) * spacing)
    z = 1500.0 + 500.0 * np.sin(x / 1700.0) * np.cos(y / 2300.0) + 700.0 * np.exp(-(((x - 7000) / 2500) ** 2))
    return HeightField(z, spacing, "ridges", "made up for a test", "none needed")


def write_synthetic_run(folder: Path, terrain: HeightField, terrain_path: str | None, seed: int = 7) -> Path:
    """Write the run into ``folder``; ``terrain_path`` None means that the terrain's name is enough to load it."""
    folder.mkdir(parents=True, exist_ok=True)
    t, x, u, target = _flight(terrain)
    plans = _plans(t, x, terrain, target)
    arrays: dict[str, Array] = {
        "t": t,
        "truth.x": x,
        "estimate.t": t[::30],
        "estimate.x": x[::30],
        "command.u": u,
        "measurement.full_state": x,
        **plans,
    }
    np.savez_compressed(folder / "log.npz", allow_pickle=False, **arrays)
    shapes = {name: {"shape": list(value.shape), "dtype": str(value.dtype)} for name, value in arrays.items()}
    _json(folder / "log.json", {"arrays": shapes, "states": {"vehicle": ["x", "y", "z", "vx", "vy", "vz"]}})
    radar = {"x": 0.47 * terrain.width, "y": 0.47 * terrain.depth, "radius": 0.12 * terrain.width, "weight": 5.0}
    mission = {
        "start": x[0, :3].tolist(),
        "target": target.tolist(),
        "clearance_min": 50.0,
        "speed_max": 300.0,
        "acceleration_max": 40.0,
        "deadline_factor": 1.3,
        "arrival_radius": 30.0,
        "radars": [radar | {"time": round(0.3 * float(t[-1]), 2)}],
    }
    fields = {"noise.position": 0.0, "planner.nodes": 13, "faults.solver_failure_rate": 0.1, "terrain": terrain.name}
    place = {"name": terrain.name, "path": terrain_path, "digest": terrain.digest}
    config = {"scenario": "safe-flight", "seed": seed, "fields": fields, "terrain": place}
    _json(folder / "config.json", config | {"versions": {"mathnavi": "0.1.0", "mujoco": "3.17"}, "mission": mission})
    summary = SUMMARY_NUMBERS | {
        "arrived": True,
        "arrival_time_s": float(t[-1]),
        "deadline_s": 1.3 * float(t[-1]),
        "path_length_m": float(np.linalg.norm(np.diff(x[:, :3], axis=0), axis=1).sum()),
        "straight_line_m": float(np.linalg.norm(x[-1, :3] - x[0, :3])),
        "replans": len(plans["plan.adopted"]),
        "seed": seed,
    }
    _json(folder / "summary.json", summary)
    events = [
        (0.3 * t[-1], "radar", "radar 1 <on> & seen"),
        (0.5 * t[-1], "plan-rejected", "low_clearance: the plan comes closer to the ground than allowed"),
        (t[-1], "arrived", ""),
    ]
    lines = [json.dumps({"t": float(when), "agent": "vehicle", "kind": k, "message": m}) for when, k, m in events]
    (folder / "events.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


def _json(path: Path, value: dict[str, Any]) -> None:
    path.write_text(json.dumps(value, indent=2), encoding="utf-8")


def _flight(terrain: HeightField) -> tuple[Array, Array, Array, Array]:
    """Times, states, inputs and target of a flight from rest to rest, south-west to north-east, low over the ground."""
    a = np.array([0.08 * terrain.width, 0.13 * terrain.depth])
    b = np.array([0.91 * terrain.width, 0.88 * terrain.depth])
    s = np.linspace(0.0, 1.0, 2001)
    chord = b - a
    normal = np.array([chord[1], -chord[0]]) / np.linalg.norm(chord)
    ground_track = (
        a + s[:, None] * chord + (0.13 * terrain.width * np.exp(-(((s - 0.5) / 0.16) ** 2)))[:, None] * normal
    )
    ground = terrain.height(ground_track[:, 0], ground_track[:, 1])
    height = gaussian_filter1d(maximum_filter1d(ground, 21) + 110.0, 8.0, mode="nearest")
    curve = np.column_stack([ground_track, np.maximum(height, ground + 70.0)])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    ramp = SPEED / 30.0  # [s] at 30 m/s^2
    duration = along[-1] / SPEED + ramp
    t = np.arange(0.0, duration, TICK)
    speed = np.minimum(1.0, np.minimum(t / ramp, (duration - t) / ramp)) * SPEED
    distance = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * TICK)])
    p = np.column_stack([np.interp(distance, along, curve[:, k]) for k in range(3)])
    p = gaussian_filter1d(p, 150.0, axis=0, mode="nearest")
    v = np.gradient(p, TICK, axis=0)
    v[0] = v[-1] = 0.0
    u = gaussian_filter1d(np.gradient(v, TICK, axis=0), 60.0, axis=0)
    return t, np.hstack([p, v]), u, p[-1]


def _plans(t: Array, x: Array, terrain: HeightField, target: Array) -> dict[str, Array]:
    ceiling = float(terrain.z.max()) + 200.0
    rows: list[tuple[Array, Array, Array, Array]] = []
    adopted = np.arange(0.0, t[-1] - PERIOD, PERIOD)
    for begin in adopted:
        knots = np.minimum(begin + PERIOD * np.arange(13), t[-1])
        knots = np.unique(knots)
        states = [x[min(round(k / TICK), len(t) - 1)] for k in knots]
        inputs = [(after[3:] - before[3:]) / PERIOD for before, after in pairwise(states)]
        phases = [int(FlightPhase.OPTIMISED)] * len(inputs)
        times = knots.tolist()

        def arc(velocity_end: Array, duration: float, phase: FlightPhase) -> None:
            before = states[-1]  # noqa: B023
            a = (velocity_end - before[3:]) / duration
            after = np.concatenate([before[:3] + 0.5 * (before[3:] + velocity_end) * duration, velocity_end])
            states.append(after)  # noqa: B023
            inputs.append(a)  # noqa: B023
            phases.append(int(phase))  # noqa: B023
            times.append(times[-1] + duration)  # noqa: B023

        def leg(displacement: Array, phase: FlightPhase) -> None:
            length = float(np.linalg.norm(displacement))
            if length > 1.0:
                top = displacement / length * min(CLIMB_SPEED if phase is not FlightPhase.CRUISE else SPEED, length)
                arc(top, 8.0, phase)
                rest = length - float(np.linalg.norm(top)) * 8.0
                if rest > 0.0:
                    arc(top, rest / float(np.linalg.norm(top)), phase)
                arc(np.zeros(3), 8.0, phase)

        for share in (0.8, 0.6, 0.4, 0.2, 0.0):
            arc(share * states[12 if len(knots) == 13 else len(knots) - 1][3:], PERIOD, FlightPhase.MANOEUVRE)
        arc(np.zeros(3), PERIOD, FlightPhase.HOVER)
        leg(np.array([0.0, 0.0, ceiling - states[-1][2]]), FlightPhase.CLIMB)
        leg(np.array([*(target[:2] - states[-1][:2]), 0.0]), FlightPhase.CRUISE)
        leg(np.array([0.0, 0.0, target[2] - states[-1][2]]), FlightPhase.DESCENT)
        rows.append(
            (np.array(times), np.array(states), np.array([*inputs, np.full(3, np.nan)]), np.array([*phases, -1]))
        )
    remaining = np.linalg.norm(x[np.searchsorted(t, adopted), :3] - target, axis=1)
    return {
        "plan.offsets": np.concatenate([[0], np.cumsum([len(row[0]) for row in rows])]),
        "plan.t": np.concatenate([row[0] for row in rows]),
        "plan.x": np.vstack([row[1] for row in rows]),
        "plan.u": np.vstack([row[2] for row in rows]),
        "plan.phase": np.concatenate([row[3] for row in rows]),
        "plan.adopted": adopted,
        "plan.cost": remaining / 150.0 + 40.0,
    }
