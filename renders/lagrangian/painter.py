"""Painter of the frames of a run of a Lagrangian system: its scene, and next to it the panel of its velocity."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mathnavi.renders.drawing import Painter
from mathnavi.renders.film import Frame
from mathnavi.renders.lagrangian.chart_scene import ChartScene
from mathnavi.renders.lagrangian.overlay import overlay
from mathnavi.renders.lagrangian.panel import VelocityPanel
from mathnavi.renders.lagrangian.run_data import LagrangianRun
from mathnavi.renders.lagrangian.shot_list import annotations_of
from mathnavi.renders.painter import SceneDrawing
from mathnavi.renders.palette import Picture

PANEL = 0.375  # of the width of a picture
MECHANISM = SceneDrawing("mathnavi.renders.lagrangian.scene:MechanismScene", overlay, annotations_of)
POINT = SceneDrawing(ChartScene, overlay, annotations_of)


@dataclass(frozen=True, eq=False)
class LagrangianPainter:
    """Opens what a camera needs when its first frame is drawn."""

    run: LagrangianRun
    width: int
    height: int
    samples: int
    stack: ExitStack

    def paint(self, frame: Frame) -> Picture:
        """Draw the picture (height, width, 3)."""
        if frame.camera == "scene":
            return self._whole.paint(frame)
        return np.hstack([self._beside.paint(frame), self._panel.picture(frame.t)])

    @cached_property
    def _panel_width(self) -> int:
        return round(PANEL * self.width)

    @cached_property
    def _panel(self) -> VelocityPanel:
        return VelocityPanel(self.run, self._panel_width, self.height)

    @cached_property
    def _beside(self) -> Painter:
        return self._open(self.width - self._panel_width)

    @cached_property
    def _whole(self) -> Painter:
        return self._open(self.width)

    def _open(self, width: int) -> Painter:
        scene = POINT if self.run.mechanism is None else MECHANISM
        return self.stack.enter_context(scene(self.run, width, self.height, self.samples))


@contextmanager
def painting(run: LagrangianRun, width: int, height: int, samples: int) -> Iterator[LagrangianPainter]:
    """Return a painter of pictures of a size in pixels; OpenGL's backend must have been chosen."""
    with ExitStack() as stack:
        yield LagrangianPainter(run, width, height, samples, stack)
