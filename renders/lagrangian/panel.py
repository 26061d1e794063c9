"""Panel next to the scene with true and estimated velocity of the last seconds, and the error so far."""

from __future__ import annotations

import re

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from mathnavi.renders.blitted import Blitted
from mathnavi.renders.figures import BOUND, GRID, INK, STYLE
from mathnavi.renders.lagrangian.path_drawing import ESTIMATE, TRUTH, PathDrawing
from mathnavi.renders.lagrangian.run_data import LagrangianRun
from mathnavi.renders.lagrangian.views import INCHES_HIGH, chart_of
from mathnavi.renders.palette import Picture
from mathnavi.sim.records.run_folder import last_at

_BODY = re.compile(r"(?:body_rate|attitude|torque)_([wxyz])$")
_NUMBERED = re.compile(r"(?:velocity|position|force)_(\d)$")
_LETTER = {"body_rate": r"\omega", "attitude": "q", "torque": r"\tau", "velocity": "v", "position": "p", "force": "F"}
WINDOW, LEAST_WINDOW, AFTERWARDS = 2.0, 0.5, 1.5  # [s] of velocity in sight; times as long as until it is found
MOST_POINTS = 700  # of a curve
SMALLEST = 1e-9  # that is drawn
MARGIN = 0.12
GROUND = "#f6f8fa"
TOP_FREE = (0.0, 0.0, 1.0, 0.985)  # of the figure: what its parts may take


def symbol(name: str) -> tuple[str, str]:
    """ "body_rate_x [rad/s]" as "$\\omega_x$" and "rad/s"; a joint by its own name."""
    bare, _, unit = name.partition(" [")
    stem, _, index = bare.rpartition("_")
    if _BODY.match(bare) or _NUMBERED.match(bare):
        return f"${_LETTER[stem]}_{{{index}}}$", unit.rstrip("]")
    return bare.removeprefix("velocity_").removeprefix("position_").replace("_", " "), unit.rstrip("]")


def with_unit(name: str) -> str:
    """Return the symbol with its unit in brackets, if it has one."""
    letters, unit = symbol(name)
    return letters if unit in ("", "-") else f"{letters} [{unit}]"


class VelocityPanel:
    """A figure, and its parts that grow with time."""

    def __init__(self, run: LagrangianRun, width: int, height: int) -> None:
        """``width`` and ``height`` in pixels."""
        self._run = run
        found = run.found_from if run.has_begun_wrong else None
        self._window = WINDOW if found is None else min(max(AFTERWARDS * found, LEAST_WINDOW), WINDOW)
        dpi = height / INCHES_HIGH
        with matplotlib.rc_context({**STYLE, "figure.facecolor": GROUND, "font.size": 8.6}):
            layout = ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.05, rect=TOP_FREE)
            self._figure = Figure(figsize=(width / dpi, INCHES_HIGH), dpi=dpi, layout=layout)
            self._path = None
            names, has_path = run.velocity_names, run.space == "body"
            rows = len(names)
            heights = [*([2.9] if has_path else []), *[1.0] * rows, 1.25 if has_path else 1.0 + 0.12 * rows]
            drawn = self._figure.subplots(len(heights), 1, height_ratios=heights)
            chart = chart_of(run) if has_path else None
            if chart is not None:
                drawn[0].set_title("Where its nose points")
                self._path = PathDrawing(run, drawn[0], chart, 0.9)
            first = len(heights) - rows - 1
            self._rows = [self._velocity(axes, k) for k, axes in enumerate(drawn[first:-1])]
            drawn[first].set_title("Velocity")
            drawn[first].legend(
                handles=list(self._rows[0]), loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1
            )
            drawn[-2].set_xlabel("seconds ago", labelpad=1.0)
            drawn[-2].tick_params(labelbottom=True)
            self._figure.align_ylabels(drawn[first:])
            self._error = self._errors(drawn[-1])
            self._blitted = Blitted(self._figure, self._moving, dpi)

    @property
    def _moving(self) -> list[Artist]:
        path = [] if self._path is None else self._path.moving
        return [*path, *(line for pair in self._rows for line in pair), self._error]

    def picture(self, t: float) -> Picture:
        """Draw the panel at ``t`` [s]."""
        run = self._run
        if self._path is not None:
            self._path.show(t)
        last = max(last_at(run.t_estimate, t), 0)
        first = max(last_at(run.t_estimate, t - self._window), 0)
        i = np.unique(np.linspace(first, last, min(last - first + 1, MOST_POINTS)).astype(int))
        true, found = run.velocity
        known = np.where(run.errors.found[i, None] > 0.0, found[i], np.nan)
        for k, (truth, estimate) in enumerate(self._rows):
            truth.set_data(run.t_estimate[i] - t, true[i, k])
            estimate.set_data(run.t_estimate[i] - t, known[:, k])
        j = np.unique(np.linspace(0, last, min(last + 1, MOST_POINTS)).astype(int))
        self._error.set_data(run.t_estimate[j], np.maximum(run.velocity_error[j], SMALLEST))
        return self._blitted.picture()

    def _velocity(self, axes: Axes, k: int) -> tuple[Line2D, Line2D]:
        values = np.concatenate([rows[:, k] for rows in self._run.velocity])
        low, high = np.quantile(values[np.isfinite(values)], (0.0, 1.0))
        margin = MARGIN * max(high - low, 1e-6)
        axes.axhline(0.0, color=GRID, lw=0.8)
        (truth,) = axes.plot([], [], color=TRUTH, lw=2.8, label="true")
        (estimate,) = axes.plot([], [], color=ESTIMATE, lw=1.3, label="estimated")
        axes.set(xlim=(-self._window, 0.0), ylim=(low - margin, high + margin))
        axes.set_ylabel(with_unit(self._run.velocity_names[k]).replace(" [", "\n["), size=7.8)
        axes.yaxis.set_major_locator(MaxNLocator(3))
        axes.xaxis.set_major_locator(MaxNLocator(4))
        axes.tick_params(labelbottom=False, labelsize=7.4)
        return truth, estimate

    def _errors(self, axes: Axes) -> Line2D:
        run = self._run
        sizes = np.maximum(run.velocity_error[np.isfinite(run.velocity_error)], SMALLEST)
        (line,) = axes.plot([], [], color=INK, lw=1.2)
        axes.axhline(run.tolerance, color=BOUND, ls=":", lw=1.1)
        axes.set(xlim=(0.0, run.duration), xlabel="time [s]", ylabel=f"off by\n[{run.unit}]")
        low = min(0.5 * float(np.quantile(sizes, 0.02)), 0.5 * run.tolerance)
        axes.set_ylim(low, 2.0 * max(float(sizes.max()), run.tolerance))
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(numticks=4))
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.set_title("Error of the velocity")
        axes.annotate("allowed", (1.0, run.tolerance), (-2, 2), ha="right", color=BOUND, size=7.4,
                      xycoords=("axes fraction", "data"), textcoords="offset points")  # fmt: skip
        axes.tick_params(labelsize=7.4)
        return line
