"""Report of a search on one page and in one picture: history and place of the best value, the worst missions."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.interfaces.signals import Array
from mathnavi.interfaces.writing import write_together
from mathnavi.renders import page
from mathnavi.renders.figures import BOUND, STYLE, canvas, lay_out
from mathnavi.renders.page import Markup
from mathnavi.renders.statistics_figures import SERIES, WIDTH
from mathnavi.sim.records.figure_names import SHORTFALL, label
from mathnavi.sim.records.sweep_data import is_number

HEIGHT = 3.4  # [inches]
MOST_UNFLOWN = 200  # in a list; the rest is counted


@dataclass(frozen=True)
class Point:
    """An evaluation of a search."""

    number: int
    values: Mapping[str, Any]  # of the fields, by name
    ending: str  # "flown", "refused" or "failed"
    figure: float  # NaN unless flown
    violated: bool  # it was flown, and did not succeed


@dataclass(frozen=True, eq=False)
class SearchPage:
    """Contents of the page of a search."""

    title: str
    key: str  # of the figure
    largest: bool  # True where the figure is to become large
    until: float | None  # value of the figure at which the search ends
    verdict: str  # a sentence: how the missions ended
    finding: str  # a sentence: what was found
    points: Sequence[Point]
    importances: Mapping[str, float]  # share of each field, the largest first
    curves: Sequence[tuple[Sequence[float], Sequence[float]]]  # of each repetition: levels, and their probabilities
    varied: Sequence[str]  # fields, those that matter most first
    worst: Sequence[Sequence[str]]  # mission, linked to its report, figure, fields, shortfall, command
    unflown: Sequence[Sequence[str]]  # mission, ending, fields, reason
    command: str


def write_search_report(store: Path, search: SearchPage) -> list[Path]:
    """Write the page and the picture next to a store, as .html and .png, both or none; return their paths."""
    figure = search_figure(search)
    picture = io.BytesIO()
    lay_out(figure)
    figure.savefig(picture, format="png", dpi=150, facecolor="white")
    pages = {
        store.with_suffix(".html"): report(search, figure).encode(),
        store.with_suffix(".png"): picture.getvalue(),
    }
    write_together(pages)
    return list(pages)


def report(search: SearchPage, figure: Figure) -> Markup:
    """Return the page's HTML."""
    violated = sum(point.violated for point in search.points)
    counts = {
        "missions": len(search.points),
        "unsuccessful": violated,
        "refused": sum(point.ending == "refused" for point in search.points),
        "failed": sum(point.ending == "failed" for point in search.points),
    }
    named = page.term(search.key, unit=True)
    blocks = [
        page.heading(search.title, f"{search.verdict}.", None if violated else True),
        page.tiles(counts),
        page.paragraph(f"{search.finding}."),
        page.section("Landscape", page.figure_block(figure, "landscape", _caption(search))),
    ]
    if search.worst:
        columns = ("mission", named, *search.varied, SHORTFALL, "fly it again")
        rows = [(*row[:-1], page.preformatted(row[-1])) for row in search.worst]
        blocks.append(page.section("The worst missions", page.card(page.table(columns, rows))))
    if search.importances:
        shares = [(field, f"{100.0 * share:.1f} %") for field, share in search.importances.items()]
        words = "Shares of the fields in what sets the extreme tenth apart from the rest (PED-ANOVA)."
        blocks.append(page.section("What matters", page.card(page.table((), shares, words))))
    if search.unflown:
        table = page.table(("mission", "ending", "fields", "reason"), search.unflown[:MOST_UNFLOWN])
        rest = len(search.unflown) - MOST_UNFLOWN
        more = [page.paragraph(f"{rest} more are in the store.")] if rest > 0 else []
        blocks.append(page.section(f"Refused and failed ({len(search.unflown)})", page.card(table), *more))
    return page.document(
        search.title, *blocks, page.section("Do it again", page.card(page.preformatted(search.command)))
    )


def _caption(search: SearchPage) -> str:
    if search.curves:
        return "The figure of every mission in order, and how probable it is to reach a level, by repetition."
    return (
        "The figure of every mission and the best so far; the missions over the fields that matter most, a star at the "
        "worst, crosses where a mission was refused or failed."
    )


def search_figure(search: SearchPage) -> Figure:
    """Two panels: figures in the order of evaluation, and the landscape, or the probabilities of levels."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(WIDTH, HEIGHT)
        left, right = figure.subplots(1, 2)
        values = _finite(np.array([point.figure for point in search.points], dtype=float))
        _draw_order(left, search, values)
        if search.curves:
            _draw_probabilities(right, search)
        else:
            _draw_landscape(figure, right, search, values)
    return figure


def _draw_order(axes: Axes, search: SearchPage, values: Array) -> None:
    name, unit = label(search.key)
    order = np.arange(1, len(values) + 1)
    violated = np.array([point.violated for point in search.points], dtype=bool)
    axes.plot(order[~violated], values[~violated], ".", ms=4.0, color=SERIES[5], alpha=0.6, rasterized=True)
    axes.plot(order[violated], values[violated], ".", ms=5.0, color=SERIES[3], label="unsuccessful")
    if not search.curves and len(values):
        best = np.fmax.accumulate(values) if search.largest else np.fmin.accumulate(values)
        axes.step(order, best, where="post", color=SERIES[0], lw=1.6, label="best so far")
    if search.until is not None:
        axes.axhline(search.until, color=BOUND, ls="--", lw=1.0)
    axes.set(xlabel="mission", ylabel=f"{name} [{unit}]" if unit else name, title="In the order of the search")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8.0, frameon=True, framealpha=0.9, edgecolor="none")


def _draw_probabilities(axes: Axes, search: SearchPage) -> None:
    name, unit = label(search.key)
    for k, (levels, probabilities) in enumerate(search.curves):
        known = [(level, p) for level, p in zip(levels, probabilities, strict=True) if math.isfinite(level) and p > 0.0]
        sign = -1.0 if search.largest else 1.0
        axes.step(
            [sign * level for level, _ in known],
            [p for _, p in known],
            where="post",
            color=SERIES[k % len(SERIES)],
            lw=1.2,
        )
    if search.until is not None:
        axes.axvline(search.until, color=BOUND, ls="--", lw=1.0)
    relation = "at least" if search.largest else "at most"
    axes.set(yscale="log", xlabel=f"{name} [{unit}]" if unit else name, ylabel="probability")
    axes.set_title(f"Probability of {relation} so much")


def _draw_landscape(figure: Figure, axes: Axes, search: SearchPage, values: Array) -> None:
    fields = [name for name in search.varied if all(is_number(point.values[name]) for point in search.points)][:2]
    if not fields:
        axes.set_axis_off()
        return
    name, unit = label(search.key)
    named = f"{name} [{unit}]" if unit else name
    x = np.array([float(point.values[fields[0]]) for point in search.points])
    flown = np.isfinite(values)
    if len(fields) == 1:
        axes.plot(x[flown], values[flown], ".", ms=4.0, color=SERIES[0], alpha=0.6)
        axes.set(xlabel=fields[0], ylabel=named)
    else:
        y = np.array([float(point.values[fields[1]]) for point in search.points])
        axes.plot(x[~flown], y[~flown], "x", ms=4.0, color=SERIES[5], alpha=0.6)
        drawn = axes.scatter(
            x[flown], y[flown], c=values[flown], s=14.0, cmap="viridis" if search.largest else "viridis_r"
        )
        if flown.any():
            k = int(np.nanargmax(values) if search.largest else np.nanargmin(values))
            axes.plot(x[k], y[k], "*", ms=12.0, color=SERIES[3])
            figure.colorbar(drawn, ax=axes, label=named)
        axes.set(xlabel=fields[0], ylabel=fields[1])
    axes.set_title("Over the fields that matter most")


def _finite(values: Array) -> Array:
    """Return the figures with infinite ones at the edge of the finite ones."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return np.where(np.isinf(values), np.sign(values), values)
    edged: Array = np.clip(values, finite.min(), finite.max())
    return edged
