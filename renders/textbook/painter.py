"""Draws the frames of a textbook system's run: the board, up to the moment of the frame."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import matplotlib
from matplotlib.text import Text

from renders.blitted import Blitted
from renders.caption import pace
from renders.figures import STYLE
from renders.film import Frame
from renders.palette import Picture
from renders.textbook.board import Board
from renders.textbook.run_data import TextbookRun
from sim.plugins import called

INCHES_HIGH = 6.4  # of a picture, whatever its pixels


@dataclass(frozen=True, eq=False)
class BoardPainter:
    """What stands still is drawn once; over it comes what a frame shows."""

    board: Board
    blitted: Blitted
    heading: Text
    notice: Text

    def paint(self, frame: Frame) -> Picture:
        """(height, width, 3)."""
        run = self.board.run
        self.board.show(frame.t)
        estimator = called("estimators", str(run.log.config["estimator"]["name"])).rpartition(":")[2]
        scenario, seed = run.log.config["scenario"], run.log.config["seed"]
        told = f"{frame.t:.2f} s, {pace(frame, run.duration)}"
        self.heading.set_text(f"mathnavi · {scenario} · {estimator} · seed {seed} · {told}")
        self.notice.set_text(frame.notice)
        return self.blitted.picture()


@contextmanager
def painting(run: TextbookRun, width: int, height: int, samples: int) -> Iterator[BoardPainter]:
    """A painter of pictures of a size in pixels; curves are drawn smoothly whatever ``samples`` says."""
    with matplotlib.rc_context({**STYLE, "figure.facecolor": "white"}):
        dpi = height / INCHES_HIGH
        board = Board(run, width / dpi, INCHES_HIGH)
        board.figure.set_layout_engine("constrained", rect=(0.01, 0.01, 0.98, 0.92))
        heading = board.figure.text(0.02, 0.975, "", va="top", size=10.5)
        notice = board.figure.text(0.98, 0.975, "", va="top", ha="right", size=11.5, weight="bold", color="#c2183b")
        yield BoardPainter(board, Blitted(board.figure, (*board.moving, heading, notice), dpi), heading, notice)
