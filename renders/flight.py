"""How flights of aerial vehicles are drawn (``renders.drawing``)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from renders.caption import Caption
from renders.film import Frame
from renders.flight_caption import words
from renders.flight_report import report
from renders.palette import Picture
from renders.run_data import RunData, load_run
from renders.storyboard import CAMERAS, highlight, storyboard

if TYPE_CHECKING:
    from renders.scene import Scene

__all__ = ["cameras", "highlight", "load_run", "painter", "report", "still_camera", "storyboard"]

cameras, still_camera = CAMERAS, "overview"


@dataclass(frozen=True)
class _Painter:
    run: RunData
    scene: Scene
    caption: Caption

    def paint(self, frame: Frame) -> Picture:
        picture = self.scene.draw(frame.t, frame.camera, frame.turn)
        return self.caption.write(picture, words(self.run, frame, self.scene.labels(frame.t, frame.camera)))


@contextmanager
def painter(run: RunData, width: int, height: int, samples: int) -> Iterator[_Painter]:
    """What draws the frames of a run; OpenGL's backend must have been chosen."""
    from renders.scene import Scene  # imports mujoco

    with Scene(run, width, height, samples) as scene:
        yield _Painter(run, scene, Caption(width, height))
