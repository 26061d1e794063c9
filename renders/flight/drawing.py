"""Drawing of flights of aerial vehicles (``mathnavi.renders.drawing``): shots, annotations, overlay.

A whole flight lasts four minutes or more, its video twenty seconds. The tour gives half of them to the flight's
highlight, such as the way around a radar that pops up, and follows the vehicle: at the start, in the middle of its
highlight and at the arrival; the overview and the top view cover the long ways between.
"""

from __future__ import annotations

import numpy as np

from mathnavi.models.aerial.plan_status import FlightPhase
from mathnavi.renders.drawing import Drawing
from mathnavi.renders.film import TOUR, Annotation, Frame, Shot, consecutive
from mathnavi.renders.flight.run_data import FlightRun, load_run
from mathnavi.renders.overlay import Overlay, pace
from mathnavi.renders.painter import SceneDrawing
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.relief import EXAGGERATION
from mathnavi.sim.records.run_folder import last_at

CAMERAS = ("chase", "overview", "top")

TURN = 0.8  # [degrees/s] at which the overview turns around the map
LAST_MOMENT = 1.6  # [s] of video for which the last moment stays
# Cameras and lengths [s of video] of the tour's shots before the last moment; the third to the fifth are the highlight.
TOUR_SHOTS: tuple[tuple[str, float], ...] = (
    ("overview", 1.5),
    ("chase", 2.4),
    ("top", 4.4),
    ("chase", 3.6),
    ("overview", 3.4),
    ("top", 2.2),
    ("chase", 3.0),
)
FORCED_LENGTH = 18.4  # [s] of video before the last moment, where one camera films everything
ANNOTATED = {  # kinds of events that a video shows; the rest is for the report
    "position-jump": "position jump",
    "tracking-breach": "tracking bound exceeded",
    "guarantee-lost": "guarantee lost",
    "guarantee-endangered": "guarantee endangered",
    "deadline-lost": "deadline lost",
    "plan-endangered": "the plan is not safe any more",
    "arrival-lost": "no plan to where the target is now",
    "ground-contact": "ground contact",
}
LEGEND = (
    SceneElement.FLOWN,
    SceneElement.OPTIMISED,
    SceneElement.MANOEUVRE,
    SceneElement.COMPLETION,
    SceneElement.RADAR,
    SceneElement.BEACON,
)
PHASES = {
    FlightPhase.OPTIMISED: "flying the optimised plan",
    FlightPhase.MANOEUVRE: "flying the safety manoeuvre",
    FlightPhase.HOVER: "hovering",
    FlightPhase.CLIMB: "completion path: climb",
    FlightPhase.CRUISE: "completion path: cruise",
    FlightPhase.DESCENT: "completion path: descent",
}


def highlight(run: FlightRun) -> tuple[float, float]:
    """Return the times [s] between which there is most to see: from where a radar pops up until it is passed.

    Without such a radar it is a stretch about the moment at which the ground is closest in mid-flight.
    """
    late_radars = [radar for radar in run.mission.radars if 0.0 < radar.time < run.duration]
    if late_radars:
        radar = min(late_radars, key=lambda radar: radar.time)
        places = [radar.at(float(t), run.terrain) for t in run.t]
        distance = [
            np.inf if place is None else np.hypot(x[0] - place.x, x[1] - place.y)
            for x, place in zip(run.x, places, strict=True)
        ]
        passed = float(run.t[np.argmin(distance)])
        begin, end = radar.time - 0.01 * run.duration, passed + 0.05 * run.duration
    else:
        middle = (run.t >= 0.25 * run.duration) & (run.t <= 0.75 * run.duration)
        heights = np.where(middle & np.isfinite(run.above_ground), run.above_ground, np.inf)
        closest = float(run.t[np.argmin(heights)])
        begin, end = closest - 0.06 * run.duration, closest + 0.06 * run.duration
    begin = float(np.clip(begin, 0.06 * run.duration, 0.7 * run.duration))
    return begin, float(np.clip(end, begin + 0.12 * run.duration, 0.88 * run.duration))


def annotations_of(run: FlightRun) -> list[Annotation]:
    """Return the annotations of a video, in order of time; of each kind of event only the first."""
    found = {"arrived" if run.summary.get("arrived") else "did not arrive": run.duration}
    for event in run.events:
        if event.kind in ANNOTATED:
            found.setdefault(ANNOTATED[event.kind], event.t)
    return sorted(_changes(run) + [(t, text) for text, t in found.items()])


def _changes(run: FlightRun) -> list[tuple[float, str]]:
    """Changes of the mission on the way."""
    mission = run.mission
    changes = [(radar.time, "radar on") for radar in mission.radars]
    changes += [(radar.until, "radar off") for radar in mission.radars]
    if len(mission.target_path):
        path = np.vstack([[0.0, *mission.target], mission.target_path])
        moved = np.linalg.norm(np.diff(path[:, 1:], axis=0), axis=1) > 0.0
        starts = moved & ~np.append(False, moved[:-1])
        changes += [(float(t), "the target moves") for t in path[:-1, 0][starts]]
    if mission.hills:
        changes.append((mission.charted_at, "ground higher than on the map"))
    return [(t, text) for t, text in changes if 0.0 < t < run.duration]


def shot_list(run: FlightRun, direction: str = TOUR) -> list[Shot]:
    """Return the shots of a video by one of the cameras or of the tour, in order; they cover the whole flight."""
    end = run.duration
    if direction != TOUR:
        return consecutive((0.0, end, end), ((direction, FORCED_LENGTH), (direction, LAST_MOMENT)))
    a, b = highlight(run)
    cuts = (0.0, 0.03 * end, a, a + 0.4 * (b - a), a + 0.65 * (b - a), b, 0.94 * end, end, end)
    return consecutive(cuts, (*TOUR_SHOTS, ("overview", LAST_MOMENT)))


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
    absent = [] if run.mission.radars else [SceneElement.RADAR]
    absent += [] if len(run.mission.beacons) else [SceneElement.BEACON]
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
        legend=[part for part in LEGEND if part not in absent],
    )


drawing = Drawing(
    cameras=CAMERAS,
    still_camera="overview",
    load_run=load_run,
    shot_list=shot_list,
    highlight=highlight,
    annotations=annotations_of,
    painter=SceneDrawing("mathnavi.renders.flight.scene:flight_scene", overlay, annotations_of),
    report="mathnavi.renders.flight.report:report",
    figure="mathnavi.renders.flight.report:map_figure",
    web="mathnavi.renders.flight.scene:flight_scene",
    turn=TURN,
)
