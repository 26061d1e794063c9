"""Figures of samples: rates with their exact limits, medians with their bootstrap bands, distributions.

They have the style of ``mathnavi.renders.figures``, so a report replaces ink and grid by the reader's theme. Infinite
values are at the edge, just beyond all finite ones.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from mathnavi.interfaces.signals import Array
from mathnavi.renders.figures import BOUND, STYLE, canvas
from mathnavi.renders.figures import SERIES as SERIES
from mathnavi.sim.records.statistics import Band, Proportion

WIDTH = 9.4  # [inches] of a figure
ROW, PANEL = 0.24, 2.6  # [inches] of a row of a forest plot, of a panel of curves
FORESTS, CURVES = 3, 2  # panels side by side
MOST_STEPS = 400  # of a distribution
BEYOND = 0.05  # of the range of what is finite: how far beyond it stands what is infinite
FAR_OUT = 3.0  # quartile ranges above the upper quartile, from which on a distribution is cut off
WHOLE = 0.35  # an axis of rates that would show more than this share of 0 to 100 % shows all of it


def rates_figure(names: Sequence[str], panels: Mapping[str, Sequence[Proportion]]) -> Figure:
    """Forest plots: one panel for each kind of event, one row for each name."""
    with matplotlib.rc_context(STYLE):
        figure, cells = _forest_grid(len(names), len(panels))
        for axes, (title, rates) in zip(cells, panels.items(), strict=True):
            limits = [_limits(rate) for rate in rates]
            _forest(axes, names, [100.0 * rate.value for rate in rates], 100.0 * np.array(limits))
            axes.set(title=title, xlabel="share [%]", xlim=_percent_limits(limits))
    return figure


def rates_figure_on(axes: Axes, names: Sequence[str], rates: Sequence[Proportion]) -> None:
    """A forest plot in ``axes`` that also says in words what it shows."""
    limits = [_limits(rate) for rate in rates]
    _forest(axes, names, [100.0 * rate.value for rate in rates], 100.0 * np.array(limits))
    for row, rate in enumerate(rates):
        axes.annotate(rate.text(), (0.0, row), (3, 5), xycoords=("axes fraction", "data"),
                      textcoords="offset points", fontsize=8.0)  # fmt: skip
    axes.set(xlabel="share [%]", xlim=_percent_limits(limits), ylim=(len(names) - 0.5, -0.75))


def medians_figure(names: Sequence[str], panels: Mapping[str, Sequence[Band | None]]) -> Figure:
    """Forest plots of medians: one panel for each figure (its name with the unit), one row for each name.

    None where there is no value; a band of a single value has no limits and no bar.
    """
    with matplotlib.rc_context(STYLE):
        figure, cells = _forest_grid(len(names), len(panels))
        for axes, (xlabel, bands) in zip(cells, panels.items(), strict=True):
            low, median, high = _within_reach(_ends(bands))
            _forest(axes, names, median, np.column_stack([low, high]))
            axes.set_xlabel(xlabel)
    return figure


def bands_figure(
    x: Sequence[float], panels: Mapping[str, Mapping[str, Sequence[Band | None]]], xlabel: str, log: bool = False
) -> Figure:
    """Medians over x with their bands: a panel for each figure, in all of them the same curves (no name: no legend)."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(WIDTH, PANEL * math.ceil(len(panels) / CURVES))
        for axes, (ylabel, curves) in zip(_grid(figure, len(panels), CURVES), panels.items(), strict=True):
            ends = _within_reach(np.array([_ends(bands) for bands in curves.values()]))
            for colour, name, (low, median, high) in zip(SERIES, curves, ends, strict=False):
                axes.fill_between(x, low, high, color=colour, alpha=0.22, lw=0.0)
                axes.plot(x, median, "o-", ms=4.0, color=colour, label=name)
            axes.set(xlabel=xlabel, ylabel=ylabel, xscale="log" if log else "linear")
        if any(curves):
            figure.legend(*axes.get_legend_handles_labels(), loc="outside upper left", ncols=len(SERIES))
    return figure


def distribution_figure(samples: Mapping[str, Array], xlabel: str, bound: float | None, bound_name: str) -> Figure:
    """Share of each sample at or below a value, on a log scale, so that the rare low ones can be seen, and a bound.

    What is far above the others is beyond the right edge, and counted there.
    """
    with matplotlib.rc_context(STYLE):
        figure = canvas(WIDTH, 3.2)
        axes = figure.add_subplot()
        everything = np.concatenate([*samples.values(), [] if bound is None else [bound]])
        for colour, (name, sample) in zip(SERIES, samples.items(), strict=False):
            values = np.sort(_within_reach(sample, everything))
            n = len(values)
            chosen = np.unique(np.geomspace(1, n, min(n, MOST_STEPS)).round().astype(int))
            axes.step(values[chosen - 1], 100.0 * chosen / n, where="post", color=colour, label=name)
        if bound is not None:
            axes.axvline(bound, color=BOUND, ls=":", lw=1.4)
            axes.annotate(
                bound_name, (bound, 1.0), (4, -2), xycoords=("data", "axes fraction"), textcoords="offset points",
                va="top", color=BOUND,
            )  # fmt: skip
        axes.set(xlabel=xlabel, ylabel="trials at or below [%]", yscale="log", ylim=(None, 100.0))
        if np.isneginf(everything).any():
            axes.set_xlim(left=float(_within_reach(everything).min()))
        if samples:
            _cut_off(axes, np.concatenate(list(samples.values())), bound)
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
        if any(samples):
            figure.legend(loc="outside upper left", ncols=CURVES + 1)
    return figure


def _cut_off(axes: Axes, values: Array, bound: float | None) -> None:
    """End the axis where the bulk of the values does; a note says how much lies beyond."""
    finite = values[np.isfinite(values)]
    lower, upper = np.quantile(finite, [0.25, 0.75]) if finite.size else (0.0, 0.0)
    end = float(upper + FAR_OUT * (upper - lower))
    beyond = finite[finite > end]
    if upper == lower or not beyond.size:
        return
    axes.set_xlim(right=end)
    if not np.isneginf(values).any():
        least = float(finite.min()) if bound is None else min(float(finite.min()), bound)
        axes.set_xlim(left=least - BEYOND * (end - least))
    axes.annotate(
        f"{len(beyond)} of {len(values)} beyond, up to {beyond.max():.4g} →", (1.0, 0.0), (-4, 4),
        xycoords="axes fraction", textcoords="offset points", ha="right", fontsize=8.0,
    )  # fmt: skip


def scatter_figure(
    x: Array,
    panels: Mapping[str, tuple[Array, Sequence[Band | None]]],
    edges: Sequence[float],
    xlabel: str,
    log: bool = False,
) -> Figure:
    """Every trial's value over x, and medians of bins with their bands.

    A panel has its values (n,), NaN where missing, and the band of each bin, None where missing; ``edges`` are the ends
    of the bins on x, one more than bins.
    """
    with matplotlib.rc_context(STYLE):
        rows = math.ceil(len(panels) / CURVES)
        figure = canvas(WIDTH, PANEL * rows)
        for axes, (ylabel, (values, bands)) in zip(_grid(figure, len(panels), CURVES), panels.items(), strict=True):
            ends = _ends(bands)
            everything = np.append(values, ends)
            axes.plot(
                x,
                _within_reach(values, everything),
                ".",
                ms=float(np.clip(60.0 / math.sqrt(len(x)), 1.2, 5.0)),
                alpha=0.5,
                color=SERIES[5],
                rasterized=True,
            )
            low, median, high = _within_reach(ends, everything)
            axes.fill_between(
                edges, [*low, low[-1]], [*high, high[-1]], color=SERIES[0], alpha=0.25, lw=0.0, step="post"
            )
            axes.hlines(median, edges[:-1], edges[1:], color=SERIES[0], lw=2.0)
            axes.set(xlabel=xlabel, ylabel=ylabel, xscale="log" if log else "linear")
    return figure


def _ends(bands: Sequence[Band | None]) -> Array:
    """(3, n) Low limits, medians and high limits; NaN where there is no band."""
    known = [band or Band(math.nan, math.nan, math.nan, 0) for band in bands]
    return np.array([(band.low, band.median, band.high) for band in known]).reshape(-1, 3).T


def _within_reach(values: Array, everything: Array | None = None) -> Array:
    """``values`` with what is infinite just beyond the finite ones of ``everything``, or of themselves."""
    everything = values if everything is None else everything
    if not np.isinf(everything).any():
        return values
    finite = everything[np.isfinite(everything)]
    low, high = (finite.min(), finite.max()) if finite.size else (0.0, 0.0)
    beyond = BEYOND * (high - low) or 1.0
    reached: Array = np.clip(values, low - beyond, high + beyond)
    return reached


def _grid(figure: Figure, count: int, across: int, sharey: bool = False) -> list[Axes]:
    """Make ``count`` panels, at most ``across`` of them in a row."""
    cells = list(figure.subplots(math.ceil(count / across), min(count, across), sharey=sharey, squeeze=False).ravel())
    for unused in cells[count:]:
        unused.remove()
    return cells[:count]


def _forest_grid(rows: int, count: int) -> tuple[Figure, list[Axes]]:
    figure = canvas(WIDTH, math.ceil(count / FORESTS) * (0.8 + ROW * rows))
    figure.set_layout_engine("constrained", wspace=0.06)  # or the numbers of one axis would touch those of the next
    return figure, _grid(figure, count, FORESTS, sharey=True)


def _forest(axes: Axes, names: Sequence[str], values: Sequence[float], limits: Array) -> None:
    """A dot for each value, a bar between its limits (n, 2), the first name on top."""
    rows = np.arange(len(names))
    axes.hlines(rows, limits[:, 0], limits[:, 1], color=SERIES[0], lw=4.0, alpha=0.5)
    axes.plot(values, rows, "o", ms=5.0, color=SERIES[0], clip_on=False, zorder=3)
    axes.set_yticks(rows, names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(axis="y", visible=False)


def _limits(rate: Proportion) -> tuple[float, float]:
    """Ends of a rate's bar: without an event up to the one-sided bound, as in its text."""
    return (0.0, rate.upper) if rate.events == 0 else (rate.low, rate.high)


def _percent_limits(limits: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """An axis [%] that shows all the limits: near 0, near 100 or all of it."""
    low, high = min(low for low, _ in limits), max(high for _, high in limits)
    if high <= WHOLE:
        return 0.0, 108.0 * high
    if low >= 1.0 - WHOLE:
        return 100.0 - 108.0 * (1.0 - low), 100.0
    return 0.0, 100.0
