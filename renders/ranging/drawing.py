"""How robots that find themselves are drawn (``mathnavi.renders.drawing``)."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from mathnavi.renders.painter import Painter, painting
from mathnavi.renders.ranging.caption import words
from mathnavi.renders.ranging.run_data import RangingRun, load_run
from mathnavi.renders.ranging.storyboard import CAMERAS, highlight, notices, storyboard

if TYPE_CHECKING:
    from mathnavi.renders.page import Markup

__all__ = ["cameras", "highlight", "load_run", "notices", "painter", "report", "still_camera", "storyboard"]

cameras, still_camera = CAMERAS, "top"


def painter(run: RangingRun, width: int, height: int, samples: int) -> AbstractContextManager[Painter]:
    """What draws the frames of a run; OpenGL's backend must have been chosen."""
    from mathnavi.renders.ranging.scene import Scene  # imports mujoco

    return painting(Scene, words, run, width, height, samples)


def report(run: RangingRun) -> Markup:
    """The run on one page."""
    from mathnavi.renders.ranging.report import report  # imports matplotlib

    return report(run)
