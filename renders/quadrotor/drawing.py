"""How flights of quadrotors are drawn (``mathnavi.renders.drawing``)."""

from __future__ import annotations

from contextlib import AbstractContextManager

from mathnavi.renders.painter import Painter, painting
from mathnavi.renders.quadrotor.caption import words
from mathnavi.renders.quadrotor.report import report
from mathnavi.renders.quadrotor.run_data import QuadrotorRun, load_run
from mathnavi.renders.quadrotor.storyboard import CAMERAS, highlight, notices, storyboard

__all__ = ["cameras", "highlight", "load_run", "notices", "painter", "report", "still_camera", "storyboard"]

cameras, still_camera = CAMERAS, "chase"


def painter(run: QuadrotorRun, width: int, height: int, samples: int) -> AbstractContextManager[Painter]:
    """What draws the frames of a run; OpenGL's backend must have been chosen."""
    from mathnavi.renders.quadrotor.scene import Scene  # imports mujoco

    return painting(Scene, words, run, width, height, samples)
