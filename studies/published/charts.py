"""A chart of many problems: a line for each, its figures as points next to each other, on log scales with limits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mathnavi.renders.figures import BOUND, GRID, INK, STYLE, canvas

MOST_LINES = 52  # of a block; more stand in a second one beside it


@dataclass(frozen=True)
class Panel:
    """A figure of every problem, on a log scale."""

    title: str
    limits: Mapping[float, str]  # value and line style
    span: tuple[float, float]  # of the axis; what is beyond is drawn at its end


@dataclass(frozen=True)
class Line:
    """A problem, its figures in the order of the panels, how it is marked, and what is written where it has none."""

    name: str
    values: tuple[float, ...]
    mark: str
    text: str = ""


@dataclass(frozen=True)
class Mark:
    """Colour and shape of a point, and what it means."""

    colour: str
    shape: str
    meaning: str


def chart(title: str, lines: Sequence[Line], panels: Sequence[Panel], marks: Mapping[str, Mark]) -> Figure:
    """Draw the lines from top to bottom, in one block or, if they are many, in two."""
    count = 1 if len(lines) <= MOST_LINES else 2
    most = math.ceil(len(lines) / count)
    blocks = [lines[k * most : (k + 1) * most] for k in range(count)]
    with matplotlib.rc_context(STYLE):
        figure = canvas(7.2 * count, 1.7 + 0.17 * most)
        every = figure.subplots(1, count * len(panels), squeeze=False)[0]
        for k, block in enumerate(blocks):
            for j, panel in enumerate(panels):
                _draw(every[k * len(panels) + j], block, j, panel, marks, most)
        figure.suptitle(title)
        shown = [mark for name, mark in marks.items() if any(line.mark == name for line in lines)]
        key = [Line2D([], [], color=m.colour, marker=m.shape, ls="", ms=5, label=m.meaning) for m in shown]
        figure.legend(handles=key, loc="outside lower center", ncols=max(1, len(key)), fontsize=8)
    return figure


def _draw(axes: Axes, lines: Sequence[Line], column: int, panel: Panel, marks: Mapping[str, Mark], places: int) -> None:
    low, high = panel.span
    axes.set_xscale("log")
    axes.set(xlim=(low / 1.6, high * 1.6), ylim=(places - 0.3, -0.7))
    axes.set_title(panel.title, fontsize=9)
    axes.grid(visible=True, axis="x", color=GRID, lw=0.5)
    axes.hlines(range(len(lines)), low / 1.6, high * 1.6, color=GRID, lw=0.4)
    for value, style in panel.limits.items():
        axes.axvline(value, color=BOUND, lw=1.1, ls=style)
    for k, line in enumerate(lines):
        value, mark = line.values[column], marks[line.mark]
        if math.isfinite(value):
            axes.plot(min(max(value, low), high), k, mark.shape, color=mark.colour, ms=4.5, clip_on=False)
        elif column == 0:
            axes.text(low, k, line.text, color=mark.colour, fontsize=6, va="center")
    names = [line.name for line in lines] if column == 0 else []
    axes.set_yticks(range(len(names)), labels=names, fontsize=6.5, color=INK)
    axes.tick_params(axis="y", length=0)
    axes.tick_params(axis="x", labelsize=7)
