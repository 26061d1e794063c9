"""Truth and estimate of a textbook system on one panel, up to any moment: what videos and reports show.

On the left the plane of the first two states, or that of the flags; on the right every state and the error over time.
Truths are blue and dashed, estimates red, as the thesis draws them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from mathnavi.interfaces.signals import Array
from mathnavi.models.textbook.library import DISTANCE
from mathnavi.renders.figures import BOUND, INK, canvas
from mathnavi.renders.textbook.run_data import TextbookRun

TRUTH, ESTIMATE = "#1b7fbd", "#d1372c"
READ = "#8a97a5"
GREEK = {"phi": r"\phi"}
_SMALLEST = 1e-12  # error that is drawn
_MARGIN = 0.08  # of the span of an axis
_LATE = 0.9  # of the time to an escape, up to which the axes reach
_HEADING = 0.5  # [m] long


class TextbookPanel:
    """A figure, and its parts that grow with time."""

    def __init__(self, run: TextbookRun, width: float, height: float, *, brief: bool = False) -> None:
        """``width`` and ``height`` in inches; a ``brief`` one leaves out the states over time, and its title."""
        self.run = run
        self.figure: Figure = canvas(width, height)
        n = 0 if brief else len(run.states)
        grid = self.figure.add_gridspec(n + 1, 2, width_ratios=(1.0, 0.9 if brief else 1.15))
        self._plane = self.figure.add_subplot(grid[:, 0])
        self._error = self.figure.add_subplot(grid[n, 1])
        self._states = [self.figure.add_subplot(grid[k, 1], sharex=self._error) for k in range(n)]
        if not brief:
            self._plane.set_title(run.title)
        self._lines = {"plane": self._draw_plane(), "error": self._draw_error()}
        self._lines |= {f"state {k}": self._draw_state(axes, k) for k, axes in enumerate(self._states)}
        for axes in self._states:
            axes.tick_params(labelbottom=False)
        if run.escape_time is not None:
            for axes in (*self._states, self._error):
                axes.axvline(run.escape_time, color=BOUND, ls=":", lw=1.3)
            (self._states or [self._error])[0].annotate(
                f"escapes at {run.escape_time:.3f} s", (run.escape_time, 0.0), (-4, 4), textcoords="offset points",
                xycoords=("data", "axes fraction"), ha="right", va="bottom", color=BOUND,
            )  # fmt: skip

    @property
    def moving(self) -> list[Artist]:
        """Artists that change with time."""
        return [artist for lines in self._lines.values() for artist in lines.values()]

    def show(self, t: float) -> None:
        """Show everything up to ``t`` [s]."""
        run = self.run
        i, k = max(run.sample_count(t), 1), max(run.estimate_count(t), 1)
        x, estimate = run.log.x[:i], run.estimate[:k]
        plane = self._lines["plane"]
        for name, line, path in (("truth", "truth", x), ("estimate", "estimate", estimate)):
            plane[line].set_data(path[:, 0], path[:, 1])
            plane[f"{name} now"].set_data(path[-1:, 0], path[-1:, 1])
            if run.has_flags:
                self._show_robot(name, path[-1])
        for state in range(len(self._states)):
            lines = self._lines[f"state {state}"]
            lines["truth"].set_data(run.log.t[:i], x[:, state])
            lines["estimate"].set_data(run.t_estimate[:k], estimate[:, state])
        error = np.maximum(np.linalg.norm(run.error[:k], axis=1), _SMALLEST)
        self._lines["error"]["error"].set_data(run.t_estimate[:k], error)

    def _show_robot(self, name: str, state: Array) -> None:
        """Its nose, and its lines of sight to where the flags are, or are believed to be."""
        x, y, phi = state[:3]
        lines = self._lines["plane"]
        lines[f"{name} nose"].set_data([x, x + _HEADING * math.cos(phi)], [y, y + _HEADING * math.sin(phi)])
        distance = state[3] if len(state) > 3 else DISTANCE
        lines[f"{name} sight"].set_data([0.0, x, distance], [0.0, y, 0.0])

    def _draw_plane(self) -> dict[str, Line2D]:
        run, axes = self.run, self._plane
        axes.set(xlabel=shown(run.states[0]), ylabel=shown(run.states[1]))
        _limit(axes, "x", *self._span(0))
        _limit(axes, "y", *self._span(1))
        if run.has_flags:
            low, high = min(self._span(1)[0], 0.0), max(self._span(1)[1], 0.0)
            _limit(axes, "y", low, high + 0.2)
            low, high = min(self._span(0)[0], 0.0), max(self._span(0)[1], DISTANCE)
            _limit(axes, "x", low, high)
            axes.set_aspect("equal")
            for name, place in (("goal flag", 0.0), ("start flag", DISTANCE)):
                axes.plot([place, place], [0.0, 0.45], color=INK, lw=1.6)
                axes.plot(place + 0.11, 0.38, ">", color=INK, ms=8)
                axes.annotate(name, (place, 0.0), (0, -12), textcoords="offset points", ha="center")
        lines = {}
        for name, colour, style, size in (("estimate", ESTIMATE, "-", 6.5), ("truth", TRUTH, "--", 3.5)):
            (lines[name],) = axes.plot([], [], style, color=colour, lw=1.8, label=name)
            (lines[f"{name} now"],) = axes.plot([], [], "o", color=colour, ms=size)
            if run.has_flags:
                (lines[f"{name} sight"],) = axes.plot([], [], color=colour, lw=0.7, alpha=0.6)
                (lines[f"{name} nose"],) = axes.plot([], [], color=colour, lw=2.6)
        (self._states or [self._error])[0].legend(
            handles=[lines["truth"], lines["estimate"]], loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2,
            borderaxespad=0.1,
        )  # fmt: skip
        return lines

    def _draw_state(self, axes: Axes, k: int) -> dict[str, Line2D]:
        axes.set(ylabel=shown(self.run.states[k]))
        _limit(axes, "y", *self._span(k))
        (estimate,) = axes.plot([], [], color=ESTIMATE, lw=1.8)
        (truth,) = axes.plot([], [], "--", color=TRUTH, lw=1.8)
        return {"estimate": estimate, "truth": truth}

    def _draw_error(self) -> dict[str, Line2D]:
        error = np.maximum(np.linalg.norm(self.run.error, axis=1), _SMALLEST)
        self._error.set(xlabel="time [s]", ylabel="|x̂ − x|", yscale="log", xlim=(0.0, self.run.duration))
        self._error.yaxis.set_minor_formatter(NullFormatter())
        # Whole decades, so that there are always two numbers to read it by.
        self._error.set_ylim(10.0 ** math.floor(math.log10(error.min())), 10.0 ** math.ceil(math.log10(error.max())))
        (line,) = self._error.plot([], [], color=ESTIMATE, lw=1.4)
        return {"error": line}

    def _span(self, k: int) -> tuple[float, float]:
        """Least and largest of a state, true or estimated, while it has not begun to escape."""
        run = self.run
        end = math.inf if run.escape_time is None else _LATE * run.escape_time
        shown = np.concatenate([run.log.x[run.log.t <= end, k], run.estimate[run.t_estimate <= end, k]])
        return float(shown.min()), float(shown.max())


def shown(name: str) -> str:
    """Return a state, an input or an output in the notation of the thesis: "$x_1$", "$u_2$ [rad/s]"."""
    symbol, _, unit = name.partition(" ")
    return f"${GREEK.get(symbol, symbol)}$" + (f" {unit}" if unit not in ("", "[-]") else "")


def _limit(axes: Axes, which: str, low: float, high: float) -> None:
    margin = _MARGIN * max(high - low, 1e-3)
    limits: Mapping[str, tuple[float, float]] = {f"{which}lim": (low - margin, high + margin)}
    axes.set(**limits)
