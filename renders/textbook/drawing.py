"""Drawing of textbook systems (``mathnavi.renders.drawing``): shots, annotations, overlay."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

import matplotlib
from matplotlib.text import Text

from mathnavi.renders.blitted import Blitted
from mathnavi.renders.drawing import Drawing
from mathnavi.renders.figures import STYLE
from mathnavi.renders.film import TOUR, Annotation, Frame, Shot, consecutive
from mathnavi.renders.overlay import pace
from mathnavi.renders.palette import Picture
from mathnavi.renders.textbook.panel import TextbookPanel
from mathnavi.renders.textbook.run_data import TextbookRun, load_run
from mathnavi.sim.plugin.registry import called

CAMERAS = ("board",)
LENGTH, LAST_MOMENT = 11.0, 2.0  # [s] of video: the run, and for how long its end stays
INCHES_HIGH, BRIEF_INCHES = 6.4, 3.3  # of a picture, whatever its pixels, and of one whose letters are large


def highlight(run: TextbookRun) -> tuple[float, float]:
    """Return the times [s] between which there is most to see: the whole is seen at the end."""
    return run.duration, run.duration


def annotations_of(run: TextbookRun) -> list[Annotation]:
    """Return the annotations of a video, in order of time."""
    named = {"escaped": "the solution escapes", "estimate-unusable": "no usable estimate"}
    shown = [(event.t, named[event.kind]) for event in run.log.events if event.kind in named]
    lost = [e.t for e in run.log.events if e.kind == "estimator-status" and e.message.startswith("lost")]
    return sorted([*shown, *((t, "the estimate is lost") for t in lost)])


def shot_list(run: TextbookRun, direction: str = TOUR) -> list[Shot]:
    """Return the shots of a video, in order: the whole run by the one camera there is."""
    end = run.duration
    return consecutive((0.0, end, end), ((CAMERAS[0], LENGTH), (CAMERAS[0], LAST_MOMENT)))


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


drawing = Drawing(
    cameras=CAMERAS,
    still_camera=CAMERAS[0],
    load_run=load_run,
    shot_list=shot_list,
    highlight=highlight,
    annotations=annotations_of,
    painter=painting,
    report="mathnavi.renders.textbook.report:report",
    figure="mathnavi.renders.textbook.report:panel_figure",
)
