"""Shot list of the video of a flight, and the annotations over it.

A whole flight lasts four minutes or more, its video twenty seconds. The tour gives half of them to the flight's
highlight, such as the way around a radar that pops up, and follows the vehicle: at
the start, in the middle of its highlight and at the arrival; the overview and the top view cover the long ways between.
"""

from __future__ import annotations

import numpy as np

from mathnavi.renders.film import TOUR, Annotation, Shot, consecutive
from mathnavi.renders.flight.run_data import FlightRun

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
    "deadline-lost": "deadline lost",
    "plan-endangered": "the plan is not safe any more",
    "arrival-lost": "no plan to where the target is now",
    "ground-contact": "ground contact",
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
