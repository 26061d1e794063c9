"""Board with all charts of the states up to the present time; the only camera of a run without bodies."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property

import matplotlib

from mathnavi.renders.blitted import Blitted
from mathnavi.renders.figures import BOUND, STYLE
from mathnavi.renders.film import Frame
from mathnavi.renders.generic.figures import states_figure
from mathnavi.renders.generic.overlay import overlay
from mathnavi.renders.generic.run_data import GenericRun
from mathnavi.renders.generic.shot_list import BOARD, annotations_of
from mathnavi.renders.overlay import pace
from mathnavi.renders.painter import SceneDrawing, ScenePainter
from mathnavi.renders.palette import Picture

INCHES_HIGH, BRIEF_INCHES = 6.4, 3.3  # of a picture, whatever its pixels, and of one whose letters are large
MOST_ROWS, BRIEF_ROWS = 6, 2
SCENE = SceneDrawing("mathnavi.renders.generic.scene:GenericScene", overlay, annotations_of)


class Board:
    """The charts of one size, with a line at the time of the picture."""

    def __init__(self, run: GenericRun, width: int, height: int, *, brief: bool) -> None:
        inches = BRIEF_INCHES if brief else INCHES_HIGH
        dpi = height / inches
        figure = states_figure(run, BRIEF_ROWS if brief else MOST_ROWS)
        figure.set_size_inches(width / dpi, inches)
        figure.set_layout_engine("constrained", rect=(0.01, 0.01, 0.98, 0.92))
        figure.set_facecolor("white")
        self._cursors = [axes.axvline(0.0, color=BOUND, lw=1.2) for axes in figure.axes]
        self._heading = figure.text(0.02, 0.975, "", va="top", size=10.5)
        self._annotation = figure.text(0.98, 0.975, "", va="top", ha="right", size=11.5, weight="bold", color=BOUND)
        self._blitted = Blitted(figure, (*self._cursors, self._heading, self._annotation), dpi)

    def picture(self, t: float, heading: str, annotation: str) -> Picture:
        """Draw the picture (height, width, 3)."""
        for cursor in self._cursors:
            cursor.set_xdata([t, t])
        self._heading.set_text(heading)
        self._annotation.set_text(annotation)
        return self._blitted.picture()


class GenericPainter:
    """Draws frames of the board, and of the scene where there is one."""

    def __init__(self, run: GenericRun, scene: ScenePainter | None, width: int, height: int) -> None:
        self._run, self._scene, self._size = run, scene, (width, height)

    def paint(self, frame: Frame) -> Picture:
        """Draw the picture (height, width, 3)."""
        if frame.camera != BOARD and self._scene is not None:
            return self._scene.paint(frame)
        if frame.brief:
            return self._brief.picture(frame.t, f"{frame.t:.1f} s", frame.annotation)
        heading = f"mathnavi · {self._run.title} · {frame.t:.2f} s, {pace(frame, self._run.duration)}"
        return self._whole.picture(frame.t, heading, frame.annotation)

    @cached_property
    def _whole(self) -> Board:
        return Board(self._run, *self._size, brief=False)

    @cached_property
    def _brief(self) -> Board:
        return Board(self._run, *self._size, brief=True)


@contextmanager
def painting(run: GenericRun, width: int, height: int, samples: int) -> Iterator[GenericPainter]:
    """Return a painter of pictures of a size in pixels."""
    with matplotlib.rc_context(STYLE):
        if run.scene is None:
            yield GenericPainter(run, None, width, height)
            return
        with SCENE(run, width, height, samples) as scene:
            yield GenericPainter(run, scene, width, height)
