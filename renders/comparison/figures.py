"""Figures of two runs drawn over each other: their paths on a common map, their states and errors over time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import matplotlib
import numpy as np
from matplotlib import patheffects
from matplotlib.figure import Figure

from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain
from mathnavi.renders.comparison.comparison import LEFT, RIGHT
from mathnavi.renders.comparison.run_data import ComparedRun, StateHistory
from mathnavi.renders.figures import STYLE, canvas, draw_map, thinned
from mathnavi.renders.page import Drawn
from mathnavi.renders.statistics_figures import SERIES

COLOURS, STYLES = SERIES[:2], ("-", "--")  # of the left run and the right one
WIDTHS = (1.8, 1.2)  # the right one is drawn over the left one
ACROSS, HEIGHT, WIDTH = 3, 1.9, 9.4  # panels in a row; [inches] of a row and of a figure
MOST_PANELS = 18

Curve = Callable[[StateHistory], tuple[Array, Array]]  # times (n,) [s] and values (n, nx)


def run_figures(left: ComparedRun, right: ComparedRun) -> list[Drawn]:
    """Figures of both runs in one: paths, states and errors."""
    drawn: list[Drawn] = []
    ground = _ground(left, right)
    if ground is not None:
        drawn.append(("map", _map(ground, left, right), "The paths over the terrain."))
    if left.states != right.states or not left.states:
        return drawn
    names = left.states[:MOST_PANELS]
    more = len(left.states) - len(names)
    rest = f" The first {len(names)} of {len(left.states)} are shown." if more else ""
    states = _panels(left, right, names, lambda history: (history.t, history.x))
    drawn.append(("states", states, f"The true state over time, component by component.{rest}"))
    if any(
        history.error.any() for run in (left, right) for history in run.histories.values()
    ):  # not of a reading of the truth
        errors = _panels(left, right, names, lambda history: (history.t_estimate, _wrapped(history.error, left.states)))
        drawn.append(("errors", errors, f"The error of the estimate, component by component.{rest}"))
    return drawn


def _ground(left: ComparedRun, right: ComparedRun) -> HeightField | None:
    """Return the terrain of both runs, if it is the same and still exists."""
    one, other = (run.config.get("terrain", {}) for run in (left, right))
    if not {"path", "digest"} <= one.keys() or one["digest"] != other.get("digest"):
        return None
    try:
        ground = load_terrain(one["path"])
    except (OSError, ValueError):
        return None
    return ground if ground.digest == one["digest"] else None


def _map(ground: HeightField, left: ComparedRun, right: ComparedRun) -> Figure:
    with matplotlib.rc_context(STYLE):
        figure = canvas(7.6, 7.2)
        axes = figure.add_subplot()
        draw_map(axes, ground)
        outline = [patheffects.withStroke(linewidth=3.6, foreground="white", alpha=0.85)]
        for run, side, colour in zip((left, right), (LEFT, RIGHT), COLOURS, strict=True):
            for k, history in enumerate(run.histories.values()):
                i = thinned(len(history.t), 0)
                x, y = history.x[i, :2].T / 1e3
                axes.plot(x, y, color=colour, lw=2.0, label="" if k else side, path_effects=outline)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.07), ncols=2)
    return figure


def _panels(left: ComparedRun, right: ComparedRun, names: Sequence[str], curve: Curve) -> Figure:
    """Draw a panel for each component of the state, with the curves of both runs and of every vehicle."""
    rows = math.ceil(len(names) / ACROSS)
    with matplotlib.rc_context(STYLE):
        figure = canvas(WIDTH, 0.4 + HEIGHT * rows)
        cells = figure.subplots(rows, min(len(names), ACROSS), sharex=True, squeeze=False)
        for cell in cells.ravel()[len(names) :]:
            cell.remove()
        for run, side, colour, style, width in zip((left, right), (LEFT, RIGHT), COLOURS, STYLES, WIDTHS, strict=True):
            for number, history in enumerate(run.histories.values()):
                t, values = curve(history)
                i = thinned(len(t), 0) if len(t) else np.empty(0, dtype=np.int64)
                for k, axes in enumerate(cells.ravel()[: len(names)]):
                    axes.plot(t[i], values[i, k], style, color=colour, lw=width, label="" if number else side)
        for k, (axes, name) in enumerate(zip(cells.ravel(), names, strict=False)):
            axes.set_title(_readable(name), fontsize=9.0, weight="normal")
            if k + ACROSS >= len(names):
                axes.set_xlabel("time [s]")
                axes.tick_params(labelbottom=True)
        figure.legend(*cells[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return figure


def _wrapped(error: Array, states: Sequence[str]) -> Array:
    """Errors with angles between -pi and pi."""
    angles = [name.endswith("[rad]") for name in states]
    wrapped: Array = np.where(angles, np.mod(error + math.pi, 2.0 * math.pi) - math.pi, error)
    return wrapped


def _readable(name: str) -> str:
    return name.replace("_", " ")
