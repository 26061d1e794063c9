"""Shot list of the video of a textbook system's run, and the annotations over it."""

from __future__ import annotations

from mathnavi.renders.film import TOUR, Annotation, Shot, consecutive
from mathnavi.renders.textbook.run_data import TextbookRun

CAMERAS = ("board",)
LENGTH, LAST_MOMENT = 11.0, 2.0  # [s] of video: the run, and for how long its end stays


def highlight(run: TextbookRun) -> tuple[float, float]:
    """Return the times [s] between which there is most to see: the whole is seen at the end."""
    return run.duration, run.duration


def annotations_of(run: TextbookRun) -> list[Annotation]:
    """Return the annotations of a video, in order of time."""
    named = {"escaped": "the solution escapes", "estimate-unusable": "no usable estimate"}
    shown = [(event.t, named[event.kind]) for event in run.log.events if event.kind in named]
    lost = [e.t for e in run.log.events if e.kind == "estimator-status" and e.message.startswith("lost")]
    return sorted([*shown, *((t, "the estimate is lost") for t in lost)])


def shot_list(run: TextbookRun, direction: str = TOUR) -> list[Shot]:
    """Return the shots of a video, in order: the whole run by the one camera there is."""
    end = run.duration
    return consecutive((0.0, end, end), ((CAMERAS[0], LENGTH), (CAMERAS[0], LAST_MOMENT)))
