"""Drawing of flights of quadrotors (``mathnavi.renders.drawing``): shots, annotations, overlay.

The vehicle is a metre wide and its way half a kilometre long: most of the video goes behind it, the overview and the
top view say where in the canyon that is.
"""

from __future__ import annotations

import numpy as np

from mathnavi.renders.drawing import Drawing
from mathnavi.renders.film import TOUR, Annotation, Frame, Shot, consecutive
from mathnavi.renders.flight import drawing as flights
from mathnavi.renders.flight.drawing import phase_name
from mathnavi.renders.overlay import Overlay, pace
from mathnavi.renders.painter import SceneDrawing
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.quadrotor.run_data import QuadrotorRun, load_run

CAMERAS = ("chase", "overview", "top")
TURN = 1.2  # [degrees/s of video] at which the overview turns
LAST_MOMENT = 1.6  # [s of video] for which the last moment stays
# Cameras, lengths [s of video] and ends [share of the flight] of the tour's shots.
SHOTS = (
    ("overview", 2.6, 0.05),
    ("chase", 7.6, 0.42),
    ("top", 2.4, 0.55),
    ("chase", 7.0, 0.90),
    ("overview", 1.8, 1.0),
)
FORCED_LENGTH = 20.0  # [s of video] before the last moment, where one camera films everything
LEGEND = (SceneElement.FLOWN, SceneElement.OPTIMISED, SceneElement.MANOEUVRE, SceneElement.COMPLETION)


def highlight(run: QuadrotorRun) -> tuple[float, float]:
    """Return the times [s] between which there is most to see: about the moment at which the ground is closest in
    mid-flight.
    """
    return flights.highlight(run.flight)


def annotations_of(run: QuadrotorRun) -> list[Annotation]:
    """Return the annotations of a video, in order of time."""
    return flights.annotations_of(run.flight)


def shot_list(run: QuadrotorRun, direction: str = TOUR) -> list[Shot]:
    """Return the shots of a video by one of the cameras or of the tour, in order; they cover the whole flight."""
    end = run.duration
    if direction != TOUR:
        return consecutive((0.0, end, end), ((direction, FORCED_LENGTH), (direction, LAST_MOMENT)))
    cuts = (0.0, *(share * end for _, _, share in SHOTS), end)
    return consecutive(cuts, (*((camera, length) for camera, length, _ in SHOTS), ("overview", LAST_MOMENT)))


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


drawing = Drawing(
    cameras=CAMERAS,
    still_camera="chase",
    load_run=load_run,
    shot_list=shot_list,
    highlight=highlight,
    annotations=annotations_of,
    painter=SceneDrawing("mathnavi.renders.quadrotor.inset:QuadrotorPictures", overlay, annotations_of),
    report="mathnavi.renders.quadrotor.report:report",
    web="mathnavi.renders.quadrotor.scene:quadrotor_scene",
    figure="mathnavi.renders.quadrotor.report:clearance_figure",
    turn=TURN,
)
