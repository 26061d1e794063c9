"""Style of all figures, and common figures: maps, costs, times and events.

Every function returns a matplotlib figure with a transparent background, text in the one colour ``INK`` and reference
lines in ``GRID``: a report replaces these by the colours of the reader's light or dark theme.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from mathnavi.interfaces.figure_style import BOUND as BOUND
from mathnavi.interfaces.figure_style import GRID as GRID
from mathnavi.interfaces.figure_style import INK as INK
from mathnavi.interfaces.figure_style import SERIES as SERIES
from mathnavi.interfaces.figure_style import STYLE as STYLE
from mathnavi.interfaces.signals import Array, Event, Integers, Plan
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.palette import COLOURS, SceneElement, hexadecimal
from mathnavi.renders.relief import relief, tints
from mathnavi.sim.records.run_folder import described

GROUND = "#9a8468"
MAP_PIXELS = 769  # along the longer side of a map's picture
LEAST_RANGE = 0.5  # [m] or [degrees] of a histogram, to either side
MAP_MARGIN, LEAST_PART = 0.15, 0.1  # about a part of a map, in its size; the smallest part, in sizes of the map
LOWEST_DRAWN = 1.0  # [m] of clearance, on a log scale
MOST_POINTS = 1500  # of a curve
_PARTS = 100  # of a run, over each of which squares are averaged


def canvas(width: float, height: float) -> Figure:
    """Return an empty figure; sizes in inches."""
    return Figure(figsize=(width, height), layout="constrained")


def lay_out(figure: Figure) -> None:
    """Lay out a figure once: later drawing does not lay it out again."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine(None)


def colour_of(part: SceneElement) -> str:
    """Colour of an element as matplotlib takes it."""
    return hexadecimal(COLOURS[part])


def thinned(n: int, keep: int) -> Integers:
    """Return at most about ``MOST_POINTS`` of n indices, evenly spread, including the last one and ``keep``."""
    chosen: Integers = np.unique(np.append(np.linspace(0, n - 1, min(n, MOST_POINTS)).astype(np.int64), keep))
    return chosen


def name_place(axes: Axes, text: str, place: tuple[float, float], offset: tuple[float, float], side: str) -> None:
    """Write a name ``offset`` [points] from a place of a map [km], aligned to a ``side``."""
    axes.annotate(
        text, place, offset, textcoords="offset points", ha=side, va="center", color="white", weight="bold",
        path_effects=[patheffects.withStroke(linewidth=2.4, foreground="#101824")],
    )  # fmt: skip


def name_to_the_left(axes: Axes, x: float) -> bool:
    """True where a name to the right of a place at ``x`` might leave the map."""
    west, east = axes.get_xlim()
    return x > west + 0.8 * (east - west)


def draw_map(axes: Axes, terrain: HeightField, within: Array | None = None) -> None:
    """The hill-shaded map in ``axes`` [km], with a bar of a round length.

    ``within`` (n, 2) [m] are places about which a part of the map is shown, with a margin; all of it by default.
    """
    east, north = terrain.width / 1e3, terrain.depth / 1e3
    pixels = MAP_PIXELS
    (west, east_end), (south, north_end) = (0.0, east), (0.0, north)
    if within is not None and len(within):
        (west, east_end), (south, north_end) = _part(within / 1e3, east, north)
        pixels = min(int(MAP_PIXELS * min(east / (east_end - west), north / (north_end - south))), 4 * MAP_PIXELS)
    axes.imshow(relief(terrain, pixels), extent=(0.0, east, 0.0, north), origin="upper")
    axes.set(xlabel="east [km]", ylabel="north [km]", xlim=(west, east_end), ylim=(south, north_end), aspect="equal")
    axes.grid(False)
    wide, tall = east_end - west, north_end - south
    long = _round_length(0.25 * wide)
    x, y = west + 0.04 * wide, south + 0.035 * tall
    dark = [patheffects.withStroke(linewidth=4.5, foreground="#101824")]
    axes.plot([x, x + long], [y, y], color="white", lw=3.0, solid_capstyle="butt", path_effects=dark)
    name_place(axes, f"{long:g} km", (x + long / 2, y), (0, 9), "center")


def _part(places: Array, east: float, north: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Limits from west to east and from south to north [km] of a square about places (n, 2), as far as the map goes."""
    low, high = np.clip(places.min(axis=0), 0.0, (east, north)), np.clip(places.max(axis=0), 0.0, (east, north))
    side = max(float((high - low).max()) * (1.0 + 2.0 * MAP_MARGIN), LEAST_PART * max(east, north))
    limits = []
    for middle, most in zip(0.5 * (low + high), (east, north), strict=True):
        size = min(side, most)
        begin = float(np.clip(middle - 0.5 * size, 0.0, most - size))
        limits.append((begin, begin + size))
    return limits[0], limits[1]


def _round_length(length: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is no longer."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= length))


def log_lengths(axes: Axes, least: float) -> None:
    """A log scale of lengths from ``least`` on, with 1, 2 and 5 times the powers of ten at its side."""
    axes.set_yscale("log")
    axes.set_ylim(least)
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def cost_figure(plans: Sequence[Plan], adopted: Array, duration: float) -> Figure:
    """Composite cost of each adopted plan, from its adoption ``adopted`` (n,) [s] on."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 2.6)
        axes = figure.add_subplot()
        cost = np.array([plan.cost for plan in plans])
        axes.step(adopted, cost, where="post", color=colour_of(SceneElement.OPTIMISED))
        axes.set(xlabel="time [s]", ylabel="cost", xlim=(0.0, duration), title="Composite cost of the plan being flown")
    return figure


def innovations_figure(t: Array, nu: Array, deviation: Array, duration: float) -> Figure:
    """Mean squares of innovations nu (n, m) at t (n,) [s] over their standard deviations, in equal parts of a run."""
    parts = np.clip(t / max(duration, 1e-9) * _PARTS, 0, _PARTS - 1).astype(np.int64)
    e, known = nu / deviation, np.isfinite(nu)
    count = np.bincount(parts, known.sum(axis=1), _PARTS)
    square = np.bincount(parts, np.where(known, np.square(e), 0.0).sum(axis=1), _PARTS)
    read = count > 0.0
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 2.6)
        axes = figure.add_subplot()
        middles = (np.arange(_PARTS) + 0.5) * duration / _PARTS
        axes.plot(middles[read], square[read] / count[read], color=colour_of(SceneElement.RAY), lw=1.1)
        axes.axhline(1.0, color=BOUND, ls=":", lw=1.2)
        axes.set(xlabel="time [s]", ylabel="mean square [-]", xlim=(0.0, duration), title="Normalised innovations")
        axes.set_ylim(0.0, 1.15 * max(2.0, axes.get_ylim()[1]))
    return figure


def solve_figure(summary: Mapping[str, Any]) -> Figure:
    """Times of the optimisation of a plan: mean, median, 99th percentile and the longest."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 2.2)
        axes = figure.add_subplot()
        names = {"p50": "median", "mean": "mean", "p99": "99th percentile", "max": "longest"}
        found = [(name, summary.get(f"solve_ms_{key}")) for key, name in names.items()]
        known = [(name, float(value)) for name, value in found if value is not None]
        if known:
            labels, values = zip(*known, strict=True)
            bars = axes.barh(labels, values, 0.6, color=colour_of(SceneElement.OPTIMISED))
            axes.bar_label(bars, [f"{value:.3g} ms" for _, value in known], padding=4)
        axes.invert_yaxis()
        axes.margins(x=0.12)
        axes.grid(axis="y", visible=False)
        axes.set(xlabel="thread CPU time of one optimisation [ms]", title="Solve times")
    return figure


def events_figure(events: Sequence[Event], duration: float) -> Figure:
    """Times at which each kind of event happened."""
    with matplotlib.rc_context(STYLE):
        names = [described(event)[0] for event in events]
        kinds = list(dict.fromkeys(names))
        figure = canvas(9.4, 0.9 + 0.28 * max(len(kinds), 1))
        axes = figure.add_subplot()
        for row, kind in enumerate(kinds):
            times = [event.t for event, name in zip(events, names, strict=True) if name == kind]
            axes.plot(times, [row] * len(times), "|", ms=11, mew=1.8, color=colour_of(SceneElement.OPTIMISED))
        labels = [f"{kind} ({names.count(kind)})" for kind in kinds]
        axes.set_yticks(range(len(kinds)), labels)
        axes.set(xlabel="time [s]", title="Events", ylim=(len(kinds) - 0.4, -0.6))
        axes.set_xlim(-0.01 * duration, 1.01 * duration)
    return figure


def terrain_figure(terrain: HeightField) -> Figure:
    """The hill-shaded map of a terrain, the distribution of its heights and slopes, and its numbers."""
    with matplotlib.rc_context(STYLE | {"figure.facecolor": "white"}):
        figure = canvas(11.0, 6.6)
        grid = figure.add_gridspec(3, 2, width_ratios=(2.1, 1.0), height_ratios=(0.62, 1.0, 1.0))
        axes = figure.add_subplot(grid[:, 0])
        draw_map(axes, terrain)
        peak = np.unravel_index(int(np.argmax(terrain.z)), terrain.z.shape)
        top = (float(peak[1]) * terrain.spacing / 1e3, float(peak[0]) * terrain.spacing / 1e3)
        axes.plot(*top, "^", ms=7, mfc="white", mec="#101824", clip_on=False)
        side = "right" if top[0] > 0.8e-3 * terrain.width else "left"
        beside = (-8.0 if side == "right" else 8.0, -9.0 * (top[1] > 0.97e-3 * terrain.depth))
        beside = (beside[0], 9.0) if top[1] < 0.03e-3 * terrain.depth else beside
        name_place(axes, f"{terrain.z.max():.0f} m", top, beside, side)
        axes.set_title(terrain.name)
        east, north = np.diff(terrain.z, axis=1), np.diff(terrain.z, axis=0)
        rise = np.stack(
            [np.hypot(east[:-1], north[:, 1:]), np.hypot(east[1:], north[:, :-1])]
        )  # both triangles of a cell
        slope = np.degrees(np.arctan(rise / terrain.spacing))
        numbers = figure.add_subplot(grid[0, 1])
        numbers.axis("off")
        rows, columns = terrain.z.shape
        lines = {
            "nodes": f"{rows} x {columns}, {terrain.spacing:g} m apart",
            "extent": f"{terrain.width / 1e3:.1f} km east, {terrain.depth / 1e3:.1f} km north",
            "heights": f"{terrain.z.min():.0f} to {terrain.z.max():.0f} m, mean {terrain.z.mean():.0f} m",
            "slopes": f"median {np.median(slope):.0f}°, steepest {slope.max():.0f}°",
            "digest": f"{terrain.digest[:16]}…",
        }
        for k, (name, value) in enumerate(lines.items()):
            numbers.text(0.0, 0.94 - 0.22 * k, name, weight="bold", transform=numbers.transAxes)
            numbers.text(0.24, 0.94 - 0.22 * k, value, transform=numbers.transAxes)
        for row, (values, name) in enumerate(((terrain.z, "height [m]"), (slope, "slope [°]")), start=1):
            histogram = figure.add_subplot(grid[row, 1])
            low, high = float(values.min()), float(values.max())
            low, high = (low, high) if high - low > LEAST_RANGE else (low - LEAST_RANGE, high + LEAST_RANGE)
            counts, edges = np.histogram(values, 60, (low, high))
            middles = 0.5 * (edges[:-1] + edges[1:])
            colours = tints(terrain, middles) if row == 1 else GROUND  # those of heights are a scale of the map's
            histogram.bar(middles, 100.0 * counts / values.size, np.diff(edges), color=colours)
            histogram.set(xlabel=name, ylabel="share [%]")
            if row == 1:
                histogram.set_xlabel(f"{name}, in the colours of the map")
    return figure
