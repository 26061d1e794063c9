"""Overlay of the pictures of a flight."""

from __future__ import annotations

import numpy as np

from mathnavi.models.aerial.plan_status import FlightPhase
from mathnavi.renders.film import Frame
from mathnavi.renders.flight.run_data import FlightRun
from mathnavi.renders.overlay import Overlay, pace
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.relief import EXAGGERATION
from mathnavi.sim.records.run_folder import last_at

LEGEND = (
    SceneElement.FLOWN,
    SceneElement.OPTIMISED,
    SceneElement.MANOEUVRE,
    SceneElement.COMPLETION,
    SceneElement.RADAR,
)
PHASES = {
    FlightPhase.OPTIMISED: "flying the optimised plan",
    FlightPhase.MANOEUVRE: "flying the safety manoeuvre",
    FlightPhase.HOVER: "hovering",
    FlightPhase.CLIMB: "completion path: climb",
    FlightPhase.CRUISE: "completion path: cruise",
    FlightPhase.DESCENT: "completion path: descent",
}


def phase_name(run: FlightRun, t: float) -> str:
    """FlightPhase of the plan being flown at ``t`` [s], in words."""
    plan = run.plan(t)
    if t >= run.duration:
        return "arrived" if run.summary.get("arrived") else "the flight is over"
    if plan is None:
        return "no plan yet"
    if t >= plan.t_end:
        return "at rest"
    k = int(np.clip(last_at(plan.t, t), 0, len(plan.phase) - 1))
    return PHASES[FlightPhase(int(plan.phase[k]))]


def overlay(run: FlightRun, frame: Frame) -> Overlay:
    """Return the overlay of a frame."""
    i = run.index(frame.t)
    ground, speed = run.above_ground[i], float(np.linalg.norm(run.x[i, 3:]))
    title = [f"mathnavi · {run.config['scenario']} · {run.terrain.name} · seed {run.config['seed']}"]
    if frame.camera != "chase":
        title.append(f"vehicle and heights not to scale: heights × {EXAGGERATION}")
    if run.mission.radars:
        title.append("radars weigh on the optimised plan, not on the completion path")
    return Overlay(
        title=title,
        numbers=(
            ("TIME", f"{frame.t:.1f} s", pace(frame, run.duration)),
            (
                "ABOVE GROUND",
                f"{ground:.0f} m" if np.isfinite(ground) else "off the map",
                f"at least {run.mission.clearance_min:.0f} m",
            ),
            ("SPEED", f"{speed:.0f} m/s", f"bound {run.mission.speed_max:.0f} m/s"),
        ),
        state=phase_name(run, frame.t),
        legend=[part for part in LEGEND if part is not SceneElement.RADAR or run.mission.radars],
    )
