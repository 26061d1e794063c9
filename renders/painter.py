"""Painter of the frames of a run: its scene, and the overlay on it."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Any

from mathnavi.renders.film import Annotation, Frame
from mathnavi.renders.overlay import Overlay, OverlayWriter
from mathnavi.renders.palette import Picture

MUJOCO = "mathnavi.renders.scene.mujoco:MujocoScene"  # draws what a function has described


@dataclass(frozen=True)
class ScenePainter:
    """Painter of any frame of one run."""

    run: Any
    scene: Any  # its draw() makes the picture of a frame, its labels() name what is in sight
    overlay: Callable[[Any, Frame], Overlay]
    marks: Sequence[float]  # shares of the run at which something happened
    whole: OverlayWriter
    brief: OverlayWriter  # of frames that have to be brief

    def paint(self, frame: Frame) -> Picture:
        """The picture (height, width, 3) of a frame."""
        picture = self.scene.draw(frame.t, frame.camera, frame.turn)
        labels = self.scene.labels(frame.t, frame.camera)
        writer = self.brief if frame.brief else self.whole
        overlay, progress = self.overlay(self.run, frame), frame.t / self.run.duration
        return writer.write(picture, overlay, frame.annotation, progress, self.marks, labels)


@dataclass(frozen=True)
class SceneDrawing:
    """Opens the scene of a run, with its overlay, as a painter."""

    # A class of pictures, or a function that describes a run as a Scene (``mathnavi.renders.scene.elements``); or
    # "package.module:name", which is imported where OpenGL's backend has been chosen.
    scene: Callable[..., Any] | str
    overlay: Callable[[Any, Frame], Overlay]
    annotations: Callable[[Any], Sequence[Annotation]]

    @contextmanager
    def _opened(self, run: Any, width: int, height: int, samples: int) -> Iterator[ScenePainter]:
        scene: Any = pkgutil.resolve_name(self.scene) if isinstance(self.scene, str) else self.scene
        marks = [t / run.duration for t, _ in self.annotations(run)]
        with (
            scene(run, width, height, samples)
            if isinstance(scene, type)
            else pkgutil.resolve_name(MUJOCO)(scene(run), width, height, samples)
        ) as opened:
            yield ScenePainter(
                run, opened, self.overlay, marks, OverlayWriter(width, height), OverlayWriter(width, height, brief=True)
            )

    def __call__(self, run: Any, width: int, height: int, samples: int) -> AbstractContextManager[ScenePainter]:
        """Return a painter of pictures of a size in pixels, for as long as its scene is open."""
        return self._opened(run, width, height, samples)
