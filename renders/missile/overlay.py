"""Overlay of the pictures of a missile."""

from __future__ import annotations

import math

from mathnavi.renders.film import Frame
from mathnavi.renders.missile.run_data import MissileRun
from mathnavi.renders.missile.shot_list import TO_SCALE, verdict
from mathnavi.renders.overlay import Overlay, pace
from mathnavi.renders.palette import SceneElement

LEGEND = (SceneElement.FLOWN, SceneElement.PLAN, SceneElement.TARGET, SceneElement.FORCE)


def overlay(run: MissileRun, frame: Frame) -> Overlay:
    """Return the overlay of a frame."""
    i = run.index(frame.t)
    x = run.coordinates.in_space(run.x[i])
    case, config = run.log.config["mission"]["case"]["name"], run.log.config
    title = [f"mathnavi · {config['scenario']} · {case} · seed {config['seed']}"]
    if frame.camera == "side" or (frame.camera == "target" and run.distance(frame.t) > TO_SCALE):
        title.append("missile and target not to scale")
    moves = any(any(leg.velocity) for leg in run.target.legs)
    return Overlay(
        title=title,
        numbers=(
            ("TIME", f"{frame.t:.2f} s", pace(frame, run.duration)),
            ("HEIGHT", f"{max(run.path[i, 2], 0.0):.1f} m", f"attack {math.degrees(run.attack[i]):.1f}°"),
            ("SPEED", f"{run.speed[i]:.0f} m/s", f"nose {round(math.degrees(x[5])):+d}°"),
        ),
        state=_state(run, frame.t),
        legend=[*LEGEND, *((SceneElement.TARGET_PATH, SceneElement.VELOCITY) if moves else ())],
    )


def _state(run: MissileRun, t: float) -> str:
    if t >= run.approach.t:
        return verdict(run)
    plan = run.plan(t)
    if plan is None:
        return "no plan yet"
    return f"{max(plan.t_end - t, 0.0):.1f} s to the target"
