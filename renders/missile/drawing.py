"""How missiles are drawn (``renders.drawing``)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from renders.caption import Caption
from renders.film import Frame
from renders.missile.caption import words
from renders.missile.report import report
from renders.missile.run_data import MissileRun, load_run
from renders.missile.storyboard import CAMERAS, highlight, storyboard
from renders.palette import Picture

if TYPE_CHECKING:
    from renders.missile.scene import Scene

__all__ = ["cameras", "highlight", "load_run", "painter", "report", "still_camera", "storyboard"]

cameras, still_camera = CAMERAS, "side"


@dataclass(frozen=True)
class _Painter:
    run: MissileRun
    scene: Scene
    caption: Caption

    def paint(self, frame: Frame) -> Picture:
        picture = self.scene.draw(frame.t, frame.camera, frame.turn)
        return self.caption.write(picture, words(self.run, frame, self.scene.labels(frame.t, frame.camera)))


@contextmanager
def painter(run: MissileRun, width: int, height: int, samples: int) -> Iterator[_Painter]:
    """What draws the frames of a run; OpenGL's backend must have been chosen."""
    from renders.missile.scene import Scene  # imports mujoco

    with Scene(run, width, height, samples) as scene:
        yield _Painter(run, scene, Caption(width, height))
