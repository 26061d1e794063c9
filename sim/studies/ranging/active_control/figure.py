"""The picture of the study ``active-control``: errors as they fall, when they have, and where the robot drove."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from mathnavi.controllers.active_sensing.plugin import PATTERNS, ActiveSensing
from mathnavi.controllers.active_sensing.then_track import ReferencePath
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.renders.figures import INK, STYLE
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.records.store import Record
from mathnavi.sim.studies.ranging.active_control.claims import ActiveControlResults, Key
from mathnavi.sim.studies.ranging.active_control.flights import COMPARED, FAST, LIMIT, MODES, OFTEN, PATH, SLOW, WALL

COLOURS = dict(zip(MODES, ("#0d5fa8", "#7a4fb5", "#e07b00", "#0f9472", "#c2183b", "#8a6d1f", "#6b7a8c"), strict=True))
FALLING = LinearSegmentedColormap.from_list("falling", ("#0d5fa8", "#8fc3e6", "#f0a07c", "#b3202f"))
ERRORS = LogNorm(0.01, 1.0)  # [m]
SHOWN = 3  # which of the runs has its path drawn
_HALO = [patheffects.withStroke(linewidth=3.0, foreground="white")]


def figure(
    flown: Mapping[Key, Sequence[Record]],
    evidence: ActiveControlResults,
    tracks: Mapping[str, Sequence[Record]],
    seconds: float,
) -> Figure:
    """Draw the figure of the study."""
    with matplotlib.rc_context(STYLE):
        page = Figure(figsize=(13.0, 12.0))
        above = page.add_gridspec(
            1, 2, left=0.06, right=0.98, top=0.96, bottom=0.62, width_ratios=(1.25, 1.0), wspace=0.3
        )
        _draw_errors(page.add_subplot(above[0]), flown, seconds)
        _draw_times(page.add_subplot(above[1]), evidence)
        below = page.add_gridspec(3, 3, left=0.02, right=0.91, top=0.535, bottom=0.02, hspace=0.16, wspace=0.04)
        places = [page.add_subplot(below[k // 3, k % 3]) for k in range(9)]
        for axes, mode in zip(places, MODES, strict=False):
            records = flown[mode, SLOW]
            _draw_path(axes, records[min(SHOWN, len(records) - 1)].summary, mode, COLOURS[mode])
        for axes, (kind, records) in zip(places[len(MODES) :], tracks.items(), strict=True):
            _draw_reference(axes)
            _draw_path(axes, records[0].summary, f"figure of eight, {kind}", INK)
        page.text(0.02, 0.553, f"(c) Paths, {SLOW} rad/s, and a path that is kept", weight="bold", size=10.0)
        bar = page.colorbar(
            ScalarMappable(ERRORS, FALLING), cax=page.add_axes((0.935, 0.1, 0.012, 0.36)), extend="both"
        )
        bar.set_label("position error of the estimate [m]")
        bar.set_ticks([0.01, LIMIT, 1.0], labels=["0.01", f"{LIMIT}", "1"])
        bar.ax.yaxis.set_minor_locator(NullLocator())
    return page


def _draw_errors(axes: Axes, flown: Mapping[Key, Sequence[Record]], seconds: float) -> None:
    axes.set_title(f"(a) Position error, turn rate at most {SLOW} rad/s")
    ends = []
    for mode in COMPARED:
        errors = _series([record.summary["errors_m"] for record in flown[mode, SLOW]])
        t = OFTEN * np.arange(errors.shape[1])
        low, middle, high = np.nanquantile(errors, [0.25, 0.5, 0.75], axis=0)
        axes.fill_between(t, low, high, color=COLOURS[mode], alpha=0.16, lw=0.0)
        axes.plot(t, middle, color=COLOURS[mode], lw=2.2)
        ends.append((mode, t, middle))
    axes.axhline(LIMIT, color=INK, lw=1.0, ls=(0, (4, 3)))
    axes.set_yscale("log")
    axes.set_xlim(0.0, seconds)
    axes.annotate(f"{LIMIT} m", (seconds, LIMIT), (-4, 4), textcoords="offset points", ha="right", path_effects=_HALO)
    for place, (mode, t, middle) in zip((0.07, 0.28, 0.5), ends, strict=True):
        k = round(place * (len(t) - 1))
        axes.annotate(
            mode, (t[k], middle[k]), (10, 16), textcoords="offset points", color=COLOURS[mode], weight="bold",
            size=10.0, path_effects=_HALO,
        )  # fmt: skip
    axes.set_xlabel("time [s]")
    axes.set_ylabel("error [m]: median and quartiles")


def _series(rows: Sequence[Sequence[float]]) -> Array:
    """(n, m), NaN after a run that ended early."""
    filled = np.full((len(rows), max(len(row) for row in rows)), np.nan)
    for k, row in enumerate(rows):
        filled[k, : len(row)] = row
    return filled


def _draw_times(axes: Axes, evidence: ActiveControlResults) -> None:
    axes.set_title(f"(b) Below {LIMIT} m for good after")
    for k, mode in enumerate(reversed(MODES)):
        for turn_rate, lift, face in ((SLOW, 0.0, COLOURS[mode]), (FAST, -0.28, "white")):
            band = evidence.medians.get((mode, turn_rate))
            if band is None:
                continue
            axes.plot([band.low, band.high], [k + lift] * 2, color=COLOURS[mode], lw=2.4, alpha=0.6)
            axes.plot(band.median, k + lift, "o", ms=8.0, mfc=face, mec=COLOURS[mode], mew=1.6)
            right = band.median if np.isnan(band.high) else band.high
            never = band.median >= evidence.seconds
            text = "not within the run" if never else f"{band.median:.2f} s"
            axes.annotate(
                text, (band.low if never and np.isfinite(band.low) else right, k + lift), (-8 if never else 8, 0),
                textcoords="offset points", va="center", ha="right" if never else "left", size=8.5, path_effects=_HALO,
            )  # fmt: skip
    axes.set_yticks(range(len(MODES)), list(reversed(MODES)))
    for label, mode in zip(axes.get_yticklabels(), reversed(MODES), strict=True):
        label.set(color=COLOURS[mode], weight="bold")
    axes.set_xscale("log")
    ticks = [tick for tick in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0) if tick <= evidence.seconds]
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    lowest = min(0.2, *(max(0.02, b.median) for b in evidence.medians.values()))
    axes.set_xlim(0.7 * lowest, 1.5 * evidence.seconds)
    axes.set_ylim(-0.6, len(MODES) - 0.4)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel(f"time [s]; filled: {SLOW} rad/s, hollow: {FAST:g} rad/s")


def _draw_path(axes: Axes, summary: Mapping[str, Sequence[float]], title: str, colour: str) -> None:
    """The wall and the way driven in it, coloured by the error."""
    places, errors = np.array(summary["places_m"]), np.array(summary["errors_m"])
    axes.add_patch(Polygon(WALL.polyline, closed=True, facecolor="#f6f4ee", edgecolor=INK, lw=1.4, zorder=0))
    pieces = np.stack([places[:-1], places[1:]], axis=1)
    axes.add_collection(LineCollection(list(pieces), colors="white", lw=5.0, zorder=2))
    axes.add_collection(LineCollection(list(pieces), array=errors[1:], cmap=FALLING, norm=ERRORS, lw=2.6, zorder=3))
    axes.plot(*places[0], "o", ms=7.0, mfc="white", mec=INK, mew=1.4, zorder=4)
    axes.plot(*places[-1], "s", ms=6.0, mfc=FALLING(ERRORS(errors[-1])), mec=INK, mew=1.2, zorder=4)
    axes.set_title(title, color=colour, loc="center", pad=2.0, size=9.5)
    reach = np.abs(WALL.polyline).max(axis=0) * 1.04
    axes.set(xlim=(-reach[0], reach[0]), ylim=(-reach[1], reach[1]), aspect="equal")
    axes.axis("off")


def _draw_reference(axes: Axes) -> None:
    config = ActiveSensing.Config(**PATH)
    path = ReferencePath(PATTERNS[config.then](config), RangingMission(WALL, (0.0,))).poses
    axes.plot(path[:, 0], path[:, 1], color=INK, lw=1.0, ls=(0, (4, 3)), zorder=1)
