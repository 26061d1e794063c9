"""Drawing of missiles (``mathnavi.renders.drawing``): shots, annotations, overlay.

A flight lasts a few seconds, its video fifteen: it slows down towards the end, and the last metres are seen next to
the target.
"""

from __future__ import annotations

import math
from itertools import accumulate

import numpy as np

from mathnavi.renders.drawing import Drawing
from mathnavi.renders.film import TOUR, Annotation, Frame, Shot, consecutive
from mathnavi.renders.missile.run_data import TO_WORLD, MissileRun, load_run
from mathnavi.renders.overlay import Overlay, pace
from mathnavi.renders.painter import SceneDrawing
from mathnavi.renders.palette import SceneElement

CAMERAS = ("chase", "side", "target")
TURN = 0.5  # [degrees/s] at which the chase camera turns
CLOSE = 70.0  # [m] from the target where the last shot begins
TO_SCALE = 24.0  # [m] likewise, within which the camera beside it shows the missile as large as it is
LAST_MOMENT = 2.0  # [s] of video for which the last moment stays
# Shares of the time before the last shot, cameras and lengths [s of video].
TOUR_SHOTS = ((0.26, "side", 2.8), (0.36, "chase", 4.0), (0.18, "side", 1.8), (0.20, "chase", 2.6))
CLOSING_LENGTH = 3.2  # [s of video] of the last shot
FORCED_LENGTH = 11.0  # [s of video] before the last shot, where one camera films everything
LEGEND = (SceneElement.FLOWN, SceneElement.PLAN, SceneElement.TARGET, SceneElement.FORCE)


def highlight(run: MissileRun) -> tuple[float, float]:
    """Return the times [s] between which there is most to see: the dive, the last third of the flight."""
    return 0.7 * run.duration, 0.94 * run.duration


def closing(run: MissileRun) -> float:
    """Time [s] at which the last shot begins."""
    distance = np.linalg.norm(run.path - run.target.at(run.t) * TO_WORLD, axis=1)
    near = run.t[(distance < CLOSE) & (run.t > 0.5 * run.duration)]
    return float(near[0]) if len(near) else 0.92 * run.duration


def verdict(run: MissileRun) -> str:
    """Return the outcome of the run in a few words."""
    miss = run.approach.miss
    distance = "under 1 mm" if miss < 1e-3 else f"{100.0 * miss:.1f} cm" if miss < 1.0 else f"{miss:.1f} m"
    return f"hit, {distance} off" if miss <= run.miss_allowed else f"missed by {distance}"


def annotations_of(run: MissileRun) -> list[Annotation]:
    """Return the annotations of a video, in order of time."""
    found = {verdict(run): run.approach.t}
    for event in run.log.events:
        if event.kind == "input-clipped":
            found.setdefault("thrusters at their limit", event.t)
    turns = [(leg.t, "the target changes its course") for leg in run.target.legs[1:] if leg.t < run.duration]
    updates = [e.t for e in run.log.events if e.kind == "message" and e.message.startswith("target")]
    late = [(t, "the planner is updated") for t in updates if all(abs(t - turn) > 1e-3 for turn, _ in turns)]
    return sorted([*turns, *late, *((t, text) for text, t in found.items())])


def shot_list(run: MissileRun, direction: str = TOUR) -> list[Shot]:
    """Return the shots of a video by one of the cameras or of the tour, in order; they cover the whole flight."""
    end, close = run.duration, closing(run)
    if direction != TOUR:
        lengths = (FORCED_LENGTH, CLOSING_LENGTH, LAST_MOMENT)
        return consecutive((0.0, close, end, end), [(direction, length) for length in lengths])
    cuts = accumulate((share * close for share, _, _ in TOUR_SHOTS), initial=0.0)
    way = ((camera, length) for _, camera, length in TOUR_SHOTS)
    return consecutive((*cuts, end, end), (*way, ("target", CLOSING_LENGTH), ("side", LAST_MOMENT)))


def overlay(run: MissileRun, frame: Frame) -> Overlay:
    """Return the overlay of a frame."""
    i = run.index(frame.t)
    x = run.coordinates.in_space(run.x[i])
    config = run.log.config
    parts = ("mathnavi", config["scenario"], run.case.removeprefix("case "), f"seed {config['seed']}")
    title = [" · ".join(filter(None, parts))]
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


drawing = Drawing(
    cameras=CAMERAS,
    still_camera="side",
    load_run=load_run,
    shot_list=shot_list,
    highlight=highlight,
    annotations=annotations_of,
    painter=SceneDrawing("mathnavi.renders.missile.scene:MissileScene", overlay, annotations_of),
    report="mathnavi.renders.missile.report:report",
    web="mathnavi.renders.missile.web:web_scene",
    figure="mathnavi.renders.missile.report:path_figure",
    turn=TURN,
)
