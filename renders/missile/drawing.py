"""How missiles are drawn (``mathnavi.renders.drawing``)."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from mathnavi.renders.missile.caption import words
from mathnavi.renders.missile.run_data import MissileRun, load_run
from mathnavi.renders.missile.storyboard import CAMERAS, highlight, notices, storyboard
from mathnavi.renders.painter import Painter, painting

if TYPE_CHECKING:
    from mathnavi.renders.page import Markup

__all__ = ["cameras", "highlight", "load_run", "notices", "painter", "report", "still_camera", "storyboard"]

cameras, still_camera = CAMERAS, "side"


def painter(run: MissileRun, width: int, height: int, samples: int) -> AbstractContextManager[Painter]:
    """What draws the frames of a run; OpenGL's backend must have been chosen."""
    from mathnavi.renders.missile.scene import Scene  # imports mujoco

    return painting(Scene, words, run, width, height, samples)


def report(run: MissileRun) -> Markup:
    """The run on one page."""
    from mathnavi.renders.missile.report import report  # imports matplotlib

    return report(run)
