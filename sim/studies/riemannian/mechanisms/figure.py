"""The picture of the study ``mechanisms``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.renders.figures import INK, STYLE
from mathnavi.sim.studies.riemannian.mechanisms.runs import (
    BUTTERWORTH,
    DISTURBED,
    DISTURBED_TUNED,
    EKF,
    HIGH_GAIN,
    MOMENTUM,
    OBSERVER,
    TUNED,
    UKF,
    EstimatorComparison,
)

COLOURS = {
    OBSERVER: "#0d5fa8", TUNED: "#6aa5d8", DISTURBED: "#0f9472", DISTURBED_TUNED: "#7cc9b0",
    BUTTERWORTH: "#c2183b", HIGH_GAIN: "#e07b00", MOMENTUM: "#8a6d3b",
    EKF: "#7a4fb5", UKF: "#b79ad8",
}  # fmt: skip

Found = Mapping[str, Mapping[str, EstimatorComparison]]


@dataclass(frozen=True)
class MechanismFigureData:
    """Data of the figure."""

    own: Found
    loaded: Found
    suite: Found
    example: str  # the mechanism of ``own`` of which errors over time are drawn
    step: float  # [s] between them


def figure(shown: MechanismFigureData) -> Figure:
    """Draw the figure of the study."""
    with matplotlib.rc_context(STYLE):
        page = Figure(figsize=(13.0, 8.2), layout="constrained")
        axes = page.subplots(2, 2, width_ratios=(1.35, 1.0))
        _draw_bars(axes[0, 0], shown.own, "(a) exact model: error of the joint velocities")
        _draw_bars(axes[0, 1], shown.loaded, "(b) last link 30 % heavier than believed")
        _draw_series(axes[1, 0], shown.own[shown.example], shown.step)
        _draw_suite(axes[1, 1], shown.suite)
    return page


def _draw_bars(axes: Axes, found: Found, title: str) -> None:
    axes.set_title(title)
    names = list(next(iter(found.values())))
    width = 0.8 / len(names)
    for k, name in enumerate(names):
        x = np.arange(len(found)) + width * (k - 0.5 * (len(names) - 1))
        values = [comparisons[name].error for comparisons in found.values()]
        axes.bar(x, values, 0.92 * width, color=COLOURS[name], label=name)
    axes.set_xticks(range(len(found)), list(found))
    axes.set_yscale("log")
    axes.set_ylabel("[rad/s, m/s]")
    axes.grid(axis="x", visible=False)
    errors = [c.error for comparisons in found.values() for c in comparisons.values() if np.isfinite(c.error)]
    axes.set_ylim(0.3 * min(errors), max(errors) * 30.0)
    axes.legend(loc="upper left", ncols=3 if len(names) == 6 else 2, fontsize=8.0)


def _draw_series(axes: Axes, comparisons: Mapping[str, EstimatorComparison], step: float) -> None:
    axes.set_title("(c) two-link arm: error over time")
    for name in (BUTTERWORTH, OBSERVER):
        error = np.maximum(comparisons[name].over_time, 1e-6)
        t = step * np.arange(len(error))
        axes.plot(t, error, color=COLOURS[name], lw=1.2)
        axes.annotate(
            name, (t[len(t) // 2], float(np.median(error))), (0, 16), textcoords="offset points",
            color=COLOURS[name], weight="bold",
        )  # fmt: skip
        axes.set_xlim(0.0, t[-1])
    axes.set_yscale("log")
    axes.set_xlabel("time [s]")
    axes.set_ylabel("[rad/s]")


def _draw_ratio(axes: Axes, height: float, value: float, colour: str) -> None:
    axes.plot([1.0, value], [height, height], color=colour, lw=5.0, solid_capstyle="butt")
    side = 1 if value >= 1.0 else -1
    axes.annotate(
        f"{value:.0f}" if value >= 10.0 else f"{value:.2g}", (value, height), (6 * side, 0),
        textcoords="offset points", va="center", ha="left" if side > 0 else "right", color=colour, weight="bold",
        fontsize=8.5,
    )  # fmt: skip


def _draw_suite(axes: Axes, suite: Found) -> None:
    axes.set_title("(d) dm_control's suite: times below the best Butterworth")
    ratios, disturbed = (
        {
            name: comparisons[BUTTERWORTH].error / comparisons[by].error
            for name, comparisons in suite.items()
            if np.isfinite(comparisons[by].error)
        }
        for by in (OBSERVER, DISTURBED_TUNED)
    )
    order = sorted(set(ratios) & set(disturbed), key=lambda name: ratios[name])
    for k, name in enumerate(order):
        colour = COLOURS[OBSERVER] if ratios[name] >= 1.0 else COLOURS[BUTTERWORTH]
        _draw_ratio(axes, k + 0.17, ratios[name], colour)
        _draw_ratio(axes, k - 0.2, disturbed[name], COLOURS[DISTURBED_TUNED])
    axes.axvline(1.0, color=INK, lw=1.0)
    axes.set_yticks(range(len(order)), order)
    axes.set_xscale("log")
    every = (*ratios.values(), *disturbed.values(), 1.0)
    low, high = min(every), max(every)
    axes.set_xlim(low / 4.0, high * 4.0)
    axes.set_ylim(-0.6, len(order) - 0.4)
    axes.grid(axis="y", visible=False)
