"""Parts of figures that several studies share: a styled figure, a table of numbers as colours, and paths on a map."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, TwoSlopeNorm, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.figures import STYLE, draw_map
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.studies.framework.study import VEHICLE, ends


@contextmanager
def styled_figure(size: tuple[float, float], layout: Any = "constrained") -> Iterator[Figure]:
    """Yield an empty figure of ``size`` [inch] to draw in, in the style of this project."""
    with matplotlib.rc_context(STYLE):
        yield Figure(figsize=size, layout=layout)


HALO = [patheffects.withStroke(linewidth=3.0, foreground="white")]
"""white edge of a text that is written over lines"""


def annotate(axes: Axes, text: str, at: tuple[float, float], offset: tuple[float, float], **style: Any) -> None:
    """Write a text at a point of the data, moved by ``offset`` [points]; ``style`` is that of ``Axes.annotate``."""
    axes.annotate(text, at, offset, textcoords="offset points", **style)


GOOD, EVEN, BAD = "#0d5fa8", "#f4f1ea", "#b3202f"
COLOURS = LinearSegmentedColormap.from_list("worth", (GOOD, "#6fb0dc", EVEN, "#f0a07c", BAD))
EMPTY = "#c9ced4"
DARK, LIGHT = "#16202a", "white"  # of a text, whichever has the better contrast


def heat_map(
    axes: Axes,
    values: Array,
    names: Sequence[str],
    columns: Sequence[str],
    texts: Sequence[Sequence[str]],
    *,
    decades: tuple[float, float],
    framed: Sequence[tuple[int, int]] = (),
    lacking: Mapping[str, str] | None = None,
) -> ScalarMappable:
    """Draw ``values`` (rows, columns) > 0 as colours on a log scale around 1, good below it.

    The colour of a NaN is that of its text in ``lacking``, "none" to leave the cell out, else grey. The scale covers
    ``decades`` below and above 1; values beyond have the colours of its ends. ``texts`` are written in the cells, and
    ``framed`` cells (row, column) have a frame. Returns the mappable of a colour bar.
    """
    norm = TwoSlopeNorm(0.0, -decades[0], decades[1])
    logarithms = np.clip(np.log10(values), -decades[0], decades[1])
    shown = ScalarMappable(norm, COLOURS)
    for i, row in enumerate(logarithms):
        for j, value in enumerate(row):
            known = bool(np.isfinite(value))
            fill = COLOURS(norm(value)) if known else (lacking or {}).get(texts[i][j], EMPTY)
            if fill == "none":
                continue
            colour = to_rgb(fill)
            axes.add_patch(Rectangle((j, i), 1.0, 1.0, facecolor=colour, edgecolor="white", lw=1.2))
            axes.text(
                j + 0.5, i + 0.5, texts[i][j], ha="center", va="center", fontsize=7.5, color=readable_on(colour)
            )  # fmt: skip
    for i, j in framed:
        axes.add_patch(Rectangle((j + 0.04, i + 0.05), 0.92, 0.9, fill=False, edgecolor="#16202a", lw=2.0, zorder=3))
    axes.set(xlim=(0, len(columns)), ylim=(len(names), 0))
    axes.set_xticks(np.arange(len(columns)) + 0.5, columns, rotation=28, ha="right", rotation_mode="anchor")
    axes.set_yticks(np.arange(len(names)) + 0.5, names)
    axes.tick_params(length=0)
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    return shown


def readable_on(colour: tuple[float, float, float]) -> str:
    """Return the text colour of the higher contrast, (L_light + 0.05) / (L_dark + 0.05), to a background (WCAG 2)."""
    ground, dark = _luminance(colour) + 0.05, _luminance(to_rgb(DARK)) + 0.05
    return LIGHT if 1.05 / ground > ground / dark else DARK


def _luminance(colour: tuple[float, float, float]) -> float:
    """The relative luminance L of red, green and blue in [0, 1]."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


RADAR = "#c2183b"
THINNEST, WIDER = 1.2, 1.3  # [points] the last path, and how much wider each before it is


def paths_on_map(axes: Axes, terrain: HeightField, flights: Mapping[str, tuple[RunData, str]], title: str) -> None:
    """The hill-shaded map with the path of each flight (its name: outcome and colour), radars, start and target.

    Each path is wider than the next, so that it is seen on both sides of those that run along it.
    """
    draw_map(axes, terrain)
    paths = {name: outcome.recording.truths[VEHICLE] / 1e3 for name, (outcome, _) in flights.items()}
    widths = [THINNEST + WIDER * k for k in reversed(range(len(flights)))]
    for p, width in zip(paths.values(), widths, strict=True):
        axes.plot(p[:, 0], p[:, 1], color="white", lw=width + WIDER, alpha=0.8)
    for (name, (_, colour)), width in zip(flights.items(), widths, strict=True):
        axes.plot(paths[name][:, 0], paths[name][:, 1], color=colour, lw=width, label=name)
    first = next(iter(flights.values()))[0]
    for radar in first.config["mission"]["radars"]:
        centre = (radar["x"] / 1e3, radar["y"] / 1e3)
        axes.add_patch(Circle(centre, radar["radius"] / 1e3, facecolor=RADAR, alpha=0.2, edgecolor=RADAR))
    for (name, place), face in zip(ends(first).items(), ("white", "#ffd90d"), strict=True):
        axes.plot(place[0] / 1e3, place[1] / 1e3, "o", ms=6, mfc=face, mec="#101824", zorder=4)
        annotate(axes, name, (place[0] / 1e3, place[1] / 1e3), (0, 7), ha="center", color="white", fontsize=7.5,
                 path_effects=[patheffects.withStroke(linewidth=2.0, foreground="#101824")])  # fmt: skip
    axes.set_title(title)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3 if len(flights) == 3 else 2, fontsize=8)
