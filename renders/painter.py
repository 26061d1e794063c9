"""What draws the frames of a run: its scene, and the caption over it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from mathnavi.renders.caption import Caption
from mathnavi.renders.film import Frame
from mathnavi.renders.palette import Picture


@dataclass(frozen=True)
class Painter:
    """Draws any frame of one run."""

    run: Any
    scene: Any  # its draw() paints a frame, its labels() name what is in sight
    caption: Caption
    brief: Caption  # of frames that have to be brief
    words: Callable[[Any, Frame, Any], Any]  # what the caption says

    def paint(self, frame: Frame) -> Picture:
        picture = self.scene.draw(frame.t, frame.camera, frame.turn)
        labels = self.scene.labels(frame.t, frame.camera)
        caption = self.brief if frame.brief else self.caption
        return caption.write(picture, self.words(self.run, frame, labels))


@contextmanager
def painting(
    scene: type[Any], words: Callable[[Any, Frame, Any], Any], run: Any, width: int, height: int, samples: int
) -> Iterator[Painter]:
    """A painter, for as long as its scene is open."""
    with scene(run, width, height, samples) as opened:
        yield Painter(run, opened, Caption(width, height), Caption(width, height, brief=True), words)
