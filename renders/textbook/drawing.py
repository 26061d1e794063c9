"""How textbook systems are drawn (``mathnavi.renders.drawing``)."""

from __future__ import annotations

from contextlib import AbstractContextManager

from mathnavi.renders.textbook.painter import BoardPainter, painting
from mathnavi.renders.textbook.report import report
from mathnavi.renders.textbook.run_data import TextbookRun, load_run
from mathnavi.renders.textbook.storyboard import CAMERAS, highlight, notices, storyboard

__all__ = ["cameras", "highlight", "load_run", "notices", "painter", "report", "still_camera", "storyboard"]

cameras, still_camera = CAMERAS, CAMERAS[0]


def painter(run: TextbookRun, width: int, height: int, samples: int) -> AbstractContextManager[BoardPainter]:
    """What draws the frames of a run."""
    return painting(run, width, height, samples)
