"""A point on a curved space, drawn by matplotlib: what ``scene`` is for a mechanism."""

from __future__ import annotations

from types import TracebackType

import matplotlib
from matplotlib.figure import Figure

from mathnavi.renders.blitted import Blitted
from mathnavi.renders.figures import STYLE
from mathnavi.renders.lagrangian.path_drawing import PathDrawing
from mathnavi.renders.lagrangian.run_data import LagrangianRun
from mathnavi.renders.lagrangian.views import INCHES_HIGH, chart_of
from mathnavi.renders.overlay import Label
from mathnavi.renders.palette import Picture

GROUND = "#dfe6ee"
MARGIN = 0.06  # of the height, above and below the drawing


class ChartScene:
    """Scene as a context manager; curves are drawn smoothly for any ``samples``."""

    def __init__(self, run: LagrangianRun, width: int, height: int, samples: int) -> None:
        dpi = height / INCHES_HIGH
        with matplotlib.rc_context(STYLE):
            figure = Figure(figsize=(width / dpi, INCHES_HIGH), dpi=dpi, facecolor=GROUND)
            axes = figure.add_axes((0.0, MARGIN, 1.0, 1.0 - 2.0 * MARGIN))
            chart = chart_of(run)
            assert chart is not None
            self._drawing = PathDrawing(run, axes, chart, 1.7)
            self._blitted = Blitted(figure, self._drawing.moving, dpi)

    def __enter__(self) -> ChartScene:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None

    def draw(self, t: float, camera: str, turn: float = 0.0) -> Picture:
        """Draw the picture at time ``t`` [s]."""
        self._drawing.show(t)
        return self._blitted.picture()

    def labels(self, t: float, camera: str) -> list[Label]:
        """Return no labels: the legend names all elements."""
        return []
