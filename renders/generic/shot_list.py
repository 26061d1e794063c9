"""Shot list of the video of a run whose scenario has no drawing, and the annotations over it."""

from __future__ import annotations

import numpy as np

from mathnavi.renders.film import TOUR, Annotation, Shot, consecutive
from mathnavi.renders.generic.run_data import GenericRun
from mathnavi.sim.records.figure_names import SHORTFALL
from mathnavi.sim.records.run_folder import described

BOARD = "board"
SCENE_CAMERAS = ("fixed", "track", "top")
LENGTHS = (6.0, 14.0)  # [s of video] least and most of the whole run
LAST_MOMENT = 2.0  # [s of video] for which its end stays
MOST_ANNOTATED = 8
TURN = 1.5  # [degrees/s] at which the tracking camera turns
_CUTS = ((0.0, "fixed"), (0.35, "track"), (0.75, "fixed"))  # shares of the run at which the tour changes the camera


def camera_name(name: str) -> str:
    """Return the name of a camera of the model on the command line and in files: "skiff/bow" is "skiff-bow"."""
    return name.replace("/", "-")


def highlight(run: GenericRun) -> tuple[float, float]:
    """Return the times [s] between which there is most to see."""
    return 0.4 * run.duration, 0.7 * run.duration


def annotations_of(run: GenericRun) -> list[Annotation]:
    """Return the annotations of a video, in order of time: the first event of each kind, and how the run ended."""
    first: dict[str, float] = {}
    for event in run.events:
        first.setdefault(described(event)[0], event.t)
    shown = [(min(t, run.duration), kind) for kind, t in first.items()][:MOST_ANNOTATED]
    return sorted([*shown, (run.duration, verdict(run))])


def verdict(run: GenericRun) -> str:
    """Return the outcome of the run in a few words."""
    return "mission succeeded" if SHORTFALL not in run.summary else "mission failed"


def short_verdict(run: GenericRun) -> str:
    """Outcome of the run in a word or two, for the panel of numbers."""
    return "succeeded" if SHORTFALL not in run.summary else "failed"


def shot_list(run: GenericRun, direction: str = TOUR) -> list[Shot]:
    """Return the shots of a video by one of the cameras or of the tour, in order; they cover the whole run."""
    end, length = run.duration, float(np.clip(run.duration, *LENGTHS))
    if direction != TOUR or run.scene is None:
        camera = BOARD if direction == TOUR else direction
        return consecutive((0.0, end, end), ((camera, length), (camera, LAST_MOMENT)))
    begins = [share * end for share, _ in _CUTS]
    lengths = np.diff([*(share for share, _ in _CUTS), 1.0]) * length
    shots = [(camera, float(part)) for (_, camera), part in zip(_CUTS, lengths, strict=True)]
    return consecutive((*begins, end, end), (*shots, ("fixed", LAST_MOMENT)))
