"""Which moment of a textbook system's run each frame of its video shows."""

from __future__ import annotations

from mathnavi.renders.drawing import TOUR, checked_camera
from mathnavi.renders.film import Frame, Shot, frames_of
from mathnavi.renders.textbook.run_data import TextbookRun

CAMERAS = ("board",)
LENGTH, LAST_LOOK = 11.0, 2.0  # [s] of video: the run, and for how long its end stays


def highlight(run: TextbookRun) -> tuple[float, float]:
    """Between which times [s] there is most to see: all of it is seen at the end."""
    return run.duration, run.duration


def notices(run: TextbookRun) -> list[tuple[float, str]]:
    """(time [s], text) of what a viewer should be told, in order of time."""
    words = {"escaped": "the solution escapes", "estimate-unusable": "no usable estimate"}
    told = [(event.t, words[event.kind]) for event in run.log.events if event.kind in words]
    lost = [e.t for e in run.log.events if e.kind == "estimator-status" and e.message.startswith("lost")]
    return sorted([*told, *((t, "the estimate is lost") for t in lost)])


def storyboard(run: TextbookRun, direction: str = TOUR, fps: int = 24) -> list[Frame]:
    """The frames of the video of a run, 1/fps seconds apart."""
    camera = CAMERAS[0] if direction == TOUR else checked_camera(direction, CAMERAS)
    shots = [Shot(camera, 0.0, run.duration, LENGTH), Shot(camera, run.duration, run.duration, LAST_LOOK)]
    return frames_of(shots, notices(run), fps, 0.0)
