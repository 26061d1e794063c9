"""The picture of the study ``consensus``."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.renders.figures import INK, STYLE
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.studies.fleet.consensus.exchange import KINDS
from mathnavi.sim.studies.fleet.consensus.following import FAR, PLANNING, OutlierFound
from mathnavi.sim.studies.fleet.consensus.runs import (
    LOSS,
    DelayCase,
    DelayFound,
    LinkCase,
    LinkFound,
    RateCase,
    RateFound,
)

_KINDS = {
    "line": ("#0d5fa8", "o", 11.0),  # larger, for some rings have the same connectivity
    "ring": ("#e07b00", "s", 6.0),
    "complete": ("#0f9472", "D", 7.0),
    "random": ("#c2183b", "^", 7.0),
}
_BELOW, _ABOVE = "#0d5fa8", "#c2183b"
_LEAST = 1e-6  # disagreement that is drawn
_HALO = [patheffects.withStroke(linewidth=3.0, foreground="white")]


def figure(
    rates: Mapping[RateCase, RateFound],
    late: Mapping[DelayCase, DelayFound],
    over: Mapping[LinkCase, LinkFound],
    outlier: OutlierFound,
) -> Figure:
    """Draw the figure of the study."""
    with matplotlib.rc_context(STYLE):
        page = Figure(figsize=(12.0, 8.6), layout="constrained")
        axes = page.subplots(2, 2)
        _draw_rates(axes[0, 0], rates)
        _draw_delays(axes[0, 1], late)
        _draw_links(axes[1, 0], over)
        _draw_outlier(axes[1, 1], outlier)
    return page


def _draw_rates(axes: Axes, rates: Mapping[RateCase, RateFound]) -> None:
    axes.set_title("(a) the rate is the algebraic connectivity")
    ends = np.array([0.025, 25.0])
    axes.plot(ends, ends, color=INK, lw=1.0, ls=(0, (4, 3)))
    for kind in KINDS:
        found = [f for case, f in rates.items() if case.kind == kind]
        error = max((f.rate / f.connectivity - 1.0 for f in found), key=abs)
        colour, marker, size = _KINDS[kind]
        axes.plot(
            [f.connectivity for f in found], [f.rate for f in found], marker, ms=size, color=colour, mec="white",
            label=f"{kind}, off by at most {abs(error):.1%}",
        )  # fmt: skip
    numbers = sorted({case.n for case in rates})
    axes.set(xscale="log", yscale="log", xlabel=r"$\lambda_2$", ylabel="measured rate of decay over $s$")
    axes.legend(loc="upper left", title=f"{', '.join(map(str, numbers))} vehicles", alignment="left")


def _draw_delays(axes: Axes, late: Mapping[DelayCase, DelayFound]) -> None:
    axes.set_title(r"(b) delays $\tau$ around the bound $\pi / (2 s \lambda_n)$")
    by: dict[tuple[float, str], DelayFound] = {(case.fraction, case.own): found for case, found in late.items()}
    shown = [fraction for fraction in (0.9, 1.1, 1.5) if (fraction, "then") in by]
    colours = dict(zip(shown, (_BELOW, "#e07b00", _ABOVE), strict=True))
    for own, style in (("then", "-"), ("now", (0, (5, 2)))):
        for fraction, colour in colours.items():
            found = by[fraction, own]
            axes.plot(found.t, found.size, color=colour, lw=1.4 if own == "then" else 1.8, ls=style)
    for fraction, colour in colours.items():
        found = by[fraction, "then"]
        tail = found.t > 0.8 * found.t[-1]
        axes.annotate(
            f"{fraction:g} of it", (found.t[-1], float(found.size[tail].max())), (5, 0), va="center",
            textcoords="offset points", color=colour, weight="bold", path_effects=_HALO,
        )  # fmt: skip
    axes.set(yscale="log", xlabel="time over the bound", ylabel="disagreement over the first")
    axes.plot([], [], color=INK, ls="-", label="own value when it was sent")
    axes.plot([], [], color=INK, ls=(0, (5, 2)), lw=1.8, label="own value now: agrees for any delay")
    axes.set(xlim=(0.0, 35.0), ylim=(1e-4, 3e4))
    axes.legend(loc="upper left", title="compared with", alignment="left")


def _draw_links(axes: Axes, over: Mapping[LinkCase, LinkFound]) -> None:
    axes.set_title("(c) links that change or lose messages")
    named = (
        ("switching", _KINDS["complete"][0], "line, ring, complete in turn; dashed: line"),
        ("matchings", _KINDS["line"][0], "two halves of a ring in turn; dashed: their mean"),
        ("loss", _KINDS["random"][0], rf"ring that loses {LOSS:.0%}; dashed: without loss"),
    )
    first: dict[str, LinkFound] = {case.name: found for case, found in over.items() if case.seed == 0}
    for name, colour, label in named:
        found = first[name]
        kept = found.size >= _LEAST
        axes.plot(found.t[kept], found.size[kept], color=colour, lw=1.8, label=label)
        t = np.array([0.0, 30.0])
        axes.plot(t, np.exp(-found.reference * t), color=colour, lw=1.0, ls=(0, (4, 3)))
    axes.set(yscale="log", xlabel="time $s t$", ylabel="disagreement over the first", xlim=(0.0, 28.0))
    axes.set_ylim(_LEAST, 20.0)
    axes.legend(loc="upper right")


def _draw_outlier(axes: Axes, found: OutlierFound) -> None:
    axes.set_title("(d) an outlier follows and comes back")
    steps = len(found.others)
    per = len(found.t) // steps
    for step in range(steps):
        block = slice(step * per, (step + 1) * per)
        t, values = found.t[block], found.values[block]
        if found.follows[step]:
            axes.axvspan(PLANNING * step, PLANNING * (step + 1), color="#f3e3d0", lw=0.0)
        axes.plot(t, np.delete(values, FAR, axis=1), color=_BELOW, lw=1.0)
        axes.plot(t, _shown(values[:, FAR], bool(found.follows[step])), color=_ABOVE, lw=1.8)
        ends = [PLANNING * step, PLANNING * (step + 1)]
        axes.plot(ends, [found.others[step]] * 2, color=INK, lw=1.2, ls=":", zorder=4)
    axes.plot([], [], color=_BELOW, label="seven vehicles")
    axes.plot([], [], color=_ABOVE, label="the eighth; shaded: it only follows")
    axes.plot([], [], color=INK, ls=":", label="average of the seven's own numbers")
    top = float(found.others[0]) + 40.0
    axes.annotate(f"from {found.values[0, FAR]:.0f} s", (0.0, top), (4, -10), textcoords="offset points",
                  color=_ABOVE, weight="bold")  # fmt: skip
    axes.set(xlabel="time [s], planning periods of 5/3 s", ylabel="arrival time $\\eta$ [s]", ylim=(None, top))
    axes.set_xticks(PLANNING * np.arange(steps + 1), [f"{PLANNING * k:.1f}" for k in range(steps + 1)])
    axes.grid(visible=False)
    axes.legend(loc="upper right")


def _shown(values: Array, follows: bool) -> Array:
    """Values that an outlier sends; NaN in its first round, in which it has nothing to send."""
    shown = values.copy()
    if follows:
        shown[0] = np.nan
    return shown
