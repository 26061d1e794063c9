"""Overlay of the pictures of a quadrotor's flight."""

from __future__ import annotations

import numpy as np

from mathnavi.renders.film import Frame
from mathnavi.renders.flight.overlay import phase_name
from mathnavi.renders.overlay import Overlay, pace
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.quadrotor.run_data import QuadrotorRun

LEGEND = (SceneElement.FLOWN, SceneElement.OPTIMISED, SceneElement.MANOEUVRE, SceneElement.COMPLETION)


def overlay(run: QuadrotorRun, frame: Frame) -> Overlay:
    """Return the overlay of a frame."""
    flight = run.flight
    i, mission = flight.index(frame.t), flight.mission
    speed, clearance, tilt = float(np.linalg.norm(flight.x[i, 3:])), float(run.clearance[i]), float(run.tilt[i])
    title = [f"mathnavi · {flight.config['scenario']} · {flight.terrain.name} · seed {flight.config['seed']}"]
    if frame.camera != "chase":
        title.append("vehicle not to scale")
    return Overlay(
        title=title,
        numbers=(
            ("TIME", f"{frame.t:.1f} s", pace(frame, run.duration)),
            (
                "CLEARANCE",
                f"{clearance:.1f} m" if np.isfinite(clearance) else "off the map",
                f"at least {mission.clearance_min:g} m",
            ),
            ("SPEED", f"{speed:.1f} m/s", f"bound {mission.speed_max:g} m/s"),
            ("TILT", f"{tilt:.0f}°", f"thrust {run.thrusts[i].mean() / run.thrust_max:.0%} of all"),
        ),
        state=phase_name(flight, frame.t),
        legend=LEGEND,
    )
