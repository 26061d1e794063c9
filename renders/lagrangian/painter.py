"""Draws the frames of a run of Paper D: its scene, and beside that the panel of its velocity."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mathnavi.renders.film import Frame
from mathnavi.renders.lagrangian.board import Board
from mathnavi.renders.lagrangian.caption import words
from mathnavi.renders.lagrangian.panel import Panel
from mathnavi.renders.lagrangian.run_data import LagrangianRun
from mathnavi.renders.painter import Painter, painting
from mathnavi.renders.palette import Picture

PANEL = 0.375  # of the width of a picture


@dataclass(frozen=True, eq=False)
class ScenePainter:
    """Opens what a camera needs when its first frame is drawn."""

    run: LagrangianRun
    width: int
    height: int
    samples: int
    stack: ExitStack

    def paint(self, frame: Frame) -> Picture:
        """(height, width, 3)."""
        if frame.camera == "scene":
            return self._whole.paint(frame)
        return np.hstack([self._beside.paint(frame), self._panel.picture(frame.t)])

    @cached_property
    def _panel_width(self) -> int:
        return round(PANEL * self.width)

    @cached_property
    def _panel(self) -> Panel:
        return Panel(self.run, self._panel_width, self.height)

    @cached_property
    def _beside(self) -> Painter:
        return self._open(self.width - self._panel_width)

    @cached_property
    def _whole(self) -> Painter:
        return self._open(self.width)

    def _open(self, width: int) -> Painter:
        drawn: type[Any] = Board
        if self.run.mechanism is not None:
            from mathnavi.renders.lagrangian.scene import Scene  # opens what OpenGL there is

            drawn = Scene
        return self.stack.enter_context(painting(drawn, words, self.run, width, self.height, self.samples))


@contextmanager
def scene_painting(run: LagrangianRun, width: int, height: int, samples: int) -> Iterator[ScenePainter]:
    """A painter of pictures of a size in pixels; OpenGL's backend must have been chosen."""
    with ExitStack() as stack:
        yield ScenePainter(run, width, height, samples, stack)
