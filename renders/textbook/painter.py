"""Draws the frames of a textbook system's run: the panel, up to the moment of the frame."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

import matplotlib
from matplotlib.text import Text

from mathnavi.renders.blitted import Blitted
from mathnavi.renders.figures import STYLE
from mathnavi.renders.film import Frame
from mathnavi.renders.overlay import pace
from mathnavi.renders.palette import Picture
from mathnavi.renders.textbook.panel import TextbookPanel
from mathnavi.renders.textbook.run_data import TextbookRun
from mathnavi.sim.plugin.registry import called

INCHES_HIGH, BRIEF_INCHES = 6.4, 3.3  # of a picture, whatever its pixels, and of one whose letters are large


@dataclass(frozen=True, eq=False)
class Sheet:
    """A panel with what is written over it: what stands still is drawn once, over it comes what a frame shows."""

    panel: TextbookPanel
    blitted: Blitted
    heading: Text
    annotation: Text

    def picture(self, t: float, heading: str, annotation: str) -> Picture:
        """Draw the picture (height, width, 3)."""
        self.panel.show(t)
        self.heading.set_text(heading)
        self.annotation.set_text(annotation)
        return self.blitted.picture()


@dataclass(frozen=True, eq=False)
class TextbookPainter:
    """Lays out what its frames need when the first one is drawn."""

    run: TextbookRun
    width: int
    height: int

    def paint(self, frame: Frame) -> Picture:
        """Draw the picture (height, width, 3)."""
        config = self.run.log.config
        if frame.brief:
            return self._brief.picture(frame.t, f"{frame.t:.1f} s", frame.annotation)
        estimator = called("estimators", str(config["estimator"]["name"])).rpartition(":")[2]
        time = f"{frame.t:.2f} s, {pace(frame, self.run.duration)}"
        heading = f"mathnavi · {config['scenario']} · {estimator} · seed {config['seed']} · {time}"
        return self._whole.picture(frame.t, heading, frame.annotation)

    @cached_property
    def _whole(self) -> Sheet:
        return self._sheet(brief=False)

    @cached_property
    def _brief(self) -> Sheet:
        return self._sheet(brief=True)

    def _sheet(self, *, brief: bool) -> Sheet:
        inches = BRIEF_INCHES if brief else INCHES_HIGH
        dpi = self.height / inches
        panel = TextbookPanel(self.run, self.width / dpi, inches, brief=brief)
        panel.figure.set_layout_engine("constrained", rect=(0.01, 0.01, 0.98, 0.93 if brief else 0.92))
        heading = panel.figure.text(0.02, 0.975, "", va="top", size=14.0 if brief else 10.5)
        annotation = panel.figure.text(0.98, 0.975, "", va="top", ha="right", size=11.5, weight="bold", color="#c2183b")
        return Sheet(panel, Blitted(panel.figure, (*panel.moving, heading, annotation), dpi), heading, annotation)


@contextmanager
def painting(run: TextbookRun, width: int, height: int, samples: int) -> Iterator[TextbookPainter]:
    """Return a painter of pictures of a size in pixels; curves are drawn smoothly for any ``samples``."""
    with matplotlib.rc_context({**STYLE, "figure.facecolor": "white"}):
        yield TextbookPainter(run, width, height)
