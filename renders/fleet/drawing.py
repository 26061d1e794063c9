"""How fleets of aerial vehicles are drawn (``mathnavi.renders.drawing``)."""

from __future__ import annotations

from contextlib import AbstractContextManager

from mathnavi.renders.fleet.caption import words
from mathnavi.renders.fleet.report import report
from mathnavi.renders.fleet.run_data import FleetRun, load_run
from mathnavi.renders.fleet.storyboard import CAMERAS, highlight, notices, storyboard
from mathnavi.renders.painter import Painter, painting

__all__ = ["cameras", "highlight", "load_run", "notices", "painter", "report", "still_camera", "storyboard"]

cameras, still_camera = CAMERAS, "overview"


def painter(run: FleetRun, width: int, height: int, samples: int) -> AbstractContextManager[Painter]:
    """What draws the frames of a run; OpenGL's backend must have been chosen."""
    from mathnavi.renders.fleet.scene import Scene  # imports mujoco

    return painting(Scene, words, run, width, height, samples)
