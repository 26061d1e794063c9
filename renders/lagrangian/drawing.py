"""How systems of Paper D are drawn (``mathnavi.renders.drawing``)."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from mathnavi.renders.lagrangian.painter import ScenePainter, scene_painting
from mathnavi.renders.lagrangian.run_data import LagrangianRun, load_run
from mathnavi.renders.lagrangian.storyboard import CAMERAS, highlight, notices, storyboard

if TYPE_CHECKING:
    from mathnavi.renders.page import Markup

__all__ = ["cameras", "highlight", "load_run", "notices", "painter", "report", "still_camera", "storyboard"]

cameras, still_camera = CAMERAS, CAMERAS[0]


def painter(run: LagrangianRun, width: int, height: int, samples: int) -> AbstractContextManager[ScenePainter]:
    """What draws the frames of a run; OpenGL's backend must have been chosen."""
    return scene_painting(run, width, height, samples)


def report(run: LagrangianRun) -> Markup:
    """The run on one page."""
    from mathnavi.renders.lagrangian.report import report  # imports matplotlib

    return report(run)
