"""Figures of a run from its charts (``mathnavi.renders.scene.charts``): states, estimates, errors, readings, inputs,
under the names and units of the log.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase

from mathnavi.interfaces.signals import Array
from mathnavi.renders.figures import STYLE, canvas
from mathnavi.renders.generic.log_plan import MovingPlan, log_plan
from mathnavi.renders.generic.run_data import REFERENCE_WORD, TRUTH_WORD, GenericRun
from mathnavi.renders.palette import hexadecimal
from mathnavi.renders.scene.charts import (
    LEFT_OUT_TITLE,
    estimate_charts,
    figure_charts,
    input_charts,
    reading_charts,
    state_charts,
)
from mathnavi.renders.scene.elements import PATTERNS, Chart, Series

MOST_ROWS = 12  # of charts in a figure; of more the first ones are drawn
MOST_NAMED = 8  # lines of a chart that are named beside it
WIDTH, ROW, PLAN_HIGH = 9.4, 1.25, 4.0  # [inches]; least height of a plan
BAND = 0.18  # opacity
SMALL = 8.0  # [points] of the titles of charts beside a plan, which are less high
TRUTHS = (TRUTH_WORD, REFERENCE_WORD)


def states_figure(run: GenericRun, most: int = MOST_ROWS) -> Figure:
    """Estimated quantities, then the states, over time with their estimates, then further figures of the estimate."""
    figure = charts_figure(_charts(run), run.duration, most)
    assert figure is not None  # no vehicle is without a state, and no log without readings
    return figure


def _charts(run: GenericRun) -> list[Chart]:
    """Charts of a run, first of what was left out; of a log with neither reference nor estimate, of its readings."""
    further = figure_charts(run)
    left_out = [chart for chart in further if chart.title == LEFT_OUT_TITLE]
    charts = [*left_out, *estimate_charts(run), *state_charts(run), *further[len(left_out) :]]
    return charts or [*input_charts(run), *reading_charts(run)]


def board_figure(run: GenericRun, most: int, *, brief: bool = False) -> tuple[Figure, MovingPlan | None]:
    """The figure of states with ``most`` charts; of a log that has a plan, beside it with what moves on it.

    A ``brief`` plan is for large letters in a small picture.
    """
    plan = log_plan(run)
    if plan is None:
        return states_figure(run, most), None
    with matplotlib.rc_context(STYLE):
        charts = _charts(run)[:most]
        figure = canvas(1.5 * WIDTH, max(0.5 + ROW * len(charts), PLAN_HIGH))
        grid = figure.add_gridspec(1, 2, width_ratios=(1.0, 1.1))
        left, right = figure.add_subfigure(grid[0]), figure.add_subfigure(grid[1])
        moving = MovingPlan(left.add_subplot(), plan, brief=brief)
        _draw_charts(right, charts, run.duration)
        for axes in right.axes:
            axes.yaxis.label.set_fontsize(SMALL)
    return figure, moving


def charts_figure(charts: Sequence[Chart], duration: float, most: int = MOST_ROWS) -> Figure | None:
    """Draw the first charts of a run of a duration [s] below each other; None without any."""
    if not charts:
        return None
    with matplotlib.rc_context(STYLE):
        shown = charts[:most]
        figure = canvas(WIDTH, 0.5 + ROW * len(shown))
        _draw_charts(figure, shown, duration)
    return figure


def _draw_charts(figure: FigureBase, charts: Sequence[Chart], duration: float) -> None:
    panels = list(np.atleast_1d(figure.subplots(len(charts), 1, sharex=True)))
    before: tuple[str, ...] = ()
    for axes, chart in zip(panels, charts, strict=True):
        for series in chart.series:
            _draw(axes, series, wide=series.name in TRUTHS and len(chart.series) > 1)
        names = tuple(series.name for series in chart.series if series.name)
        if names and names != before and len(names) <= MOST_NAMED:  # once where it stays the same
            axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=MOST_NAMED, borderaxespad=0.1)
        before = names
        axes.set_ylabel(_label(chart))
        if chart.title == LEFT_OUT_TITLE:
            axes.set_yticks([])  # the heights of its lines are no numbers
        if (limits := _within(chart.series)) is not None:
            axes.set_ylim(*limits)
    panels[-1].set(xlabel="time [s]", xlim=(0.0, duration))


def _draw(axes: Axes, series: Series, *, wide: bool) -> None:
    colour = hexadecimal(series.colour)
    if series.band is not None:
        axes.fill_between(series.t, series.y - series.band, series.y + series.band, color=colour, alpha=BAND, lw=0.0)
    axes.plot(
        series.t, series.y, color=colour, lw=2.2 if wide else 1.2, label=series.name,
        ls=PATTERNS[series.pattern], drawstyle="steps-post" if series.step else "default",
    )  # fmt: skip


def _label(chart: Chart) -> str:
    """Title and unit, in lines that are short enough for a panel."""
    words, lines = chart.title.split(" "), [""]
    for word in words:
        if lines[-1] and len(lines[-1]) + len(word) >= 16:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "\n".join([*lines, *([f"[{chart.unit}]"] if chart.unit else [])])


def _within(series: Sequence[Series]) -> tuple[float, float] | None:
    """Limits of an axis, which hold the curves and what is usual of their bands, but not the hundredth of an estimate
    that is farthest off; None where there is no finite value.
    """
    ends: list[float] = []
    for each in series:
        finite: Array = each.y[np.isfinite(each.y)]
        if len(finite):
            share = (0.0, 100.0) if each.name in ("", *TRUTHS) or not _is_estimate(each) else (1.0, 99.0)
            half = 0.0 if each.band is None else _usual(each.band)
            low, high = np.percentile(finite, share).tolist()
            ends += [low - half, high + half]
    if not ends:
        return None
    low, high = min(ends), max(ends)
    margin = 0.08 * (high - low) or 0.5 * max(abs(high), 1e-6)
    return low - margin, high + margin


def _usual(band: Array) -> float:
    """Half the height of three quarters of a band: wider it is at the start, where an estimator knows little."""
    finite = band[np.isfinite(band)]
    return float(np.percentile(finite, 75.0)) if len(finite) else 0.0


def _is_estimate(series: Series) -> bool:
    return series.name.endswith("estimate")
