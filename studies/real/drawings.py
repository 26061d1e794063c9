"""Figure of the study: a robot that finds itself in a building, and what the estimators reach on the logs.

The picture shows the walls, the beams, and the poses that can be, which become fewer. It shows the map, which is made
of third-party data: it is drawn where these are available.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from mathnavi.interfaces.signals import Array
from mathnavi.sim.records.table import Row
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import chosen
from mathnavi.studies.real.floor_windows import DrawnWindow

PANELS = 6
WALL, POSE, BEAM, TRUTH = "#30343b", "#d9480f", "#1c7ed6", "#2b8a3e"
COLOURS = {
    "feasible_set_bank": "#0d5fa8",
    "range_particle": "#e08214",
    "range_ekf": "#7b3294",
    "range_iekf": "#c2183b",
    "range_ukf": "#2b8a3e",
    "moving_horizon": "#6d6d6d",
}
WIDTH = 12.0  # [inch]
_HIGH, _ABREAST = 3.6, 3  # [inch] height of a chart, and charts in a row at most


def figure(drawn: DrawnWindow | None, rows: Sequence[Row]) -> Figure:
    """Draw the picture, if there is one, above a chart of each kind of logs that has rows."""
    down, across, high = _shape(drawn) if drawn is not None else (0, 0, 0.0)
    measured = [chart for chart in _CHARTS if any(chosen(rows, part=part) for part in chart.parts)]
    lines = max(1, math.ceil(len(measured) / _ABREAST))
    with styled_figure((WIDTH, down * high + lines * _HIGH)) as page:
        charts: Any = page
        if drawn is not None:
            halves: Any = page.subfigures(2, 1, height_ratios=(down * high, lines * _HIGH))
            above, charts = halves
            _building(above.subplots(down, across).ravel(), drawn)
        panels = charts.subplots(lines, math.ceil(max(1, len(measured)) / lines), squeeze=False).ravel()
        for axes, letter, chart in zip(panels, "abcd", measured, strict=False):
            chart.draw(axes, rows)
            axes.set_title(f"({letter}) {chart.title}")
        for axes in panels[len(measured) :]:
            axes.set_axis_off()
        if not measured:
            panels[0].text(0.5, 0.5, "not measured", transform=panels[0].transAxes, ha="center", va="center")
    return page


def _shape(drawn: DrawnWindow) -> tuple[int, int, float]:
    """Panels down and across, and the height of one [inch]."""
    low, high = _box(drawn)
    wide, tall = (high - low).tolist()
    across = 2 if wide > 1.5 * tall else PANELS if tall > 2.0 * wide else 3
    return math.ceil(PANELS / across), across, WIDTH / across * tall / wide + 0.35


def _box(drawn: DrawnWindow) -> tuple[Array, Array]:
    corners = np.vstack(drawn.outlines)
    return corners.min(axis=0), corners.max(axis=0)


def _building(panels: Sequence[Axes], drawn: DrawnWindow) -> None:
    low, high = _box(drawn)
    shown = moments(drawn.hypotheses)
    for axes in panels:
        axes.set_axis_off()
    for axes, k in zip(panels, shown, strict=False):
        axes.add_collection(LineCollection(list(drawn.outlines), colors=WALL, linewidths=0.6))
        poses = drawn.hypotheses[k][np.isfinite(drawn.hypotheses[k, :, 0])]
        ahead = 0.6 * np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
        arrows = np.stack([poses[:, :2], poses[:, :2] + ahead], axis=1)
        axes.add_collection(LineCollection(list(arrows), colors=POSE, linewidths=0.8, alpha=0.7, zorder=3))
        axes.plot(*poses[:, :2].T, ".", color=POSE, markersize=2.5, zorder=3)
        best, seen = drawn.best[k], np.isfinite(drawn.ranges[k])
        along = best[2] + drawn.angles[seen]
        ends = best[:2] + drawn.ranges[k, seen, None] * np.column_stack([np.cos(along), np.sin(along)])
        beams = np.stack([np.broadcast_to(best[:2], ends.shape), ends], axis=1)
        axes.add_collection(LineCollection(list(beams), colors=BEAM, linewidths=0.7, zorder=2))
        axes.plot(*drawn.truth[k, :2], "o", markerfacecolor="none", markeredgecolor=TRUTH, markersize=9, zorder=4)
        count = f"{len(poses)} poses can be" if len(poses) > 1 else "one pose is left"
        axes.set_title(f"after {drawn.t[k]:.0f} s: {count}", fontsize=9)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")


def moments(hypotheses: Array) -> list[int]:
    """Scans (up to ``PANELS``) at which the number of hypotheses (n, K, 3) is less than before, and the last."""
    counts = np.isfinite(hypotheses[:, :, 0]).sum(axis=1)
    fewer = [0]
    for k, count in enumerate(counts.tolist()):
        if 0 < count < 0.75 * counts[fewer[-1]]:
            fewer.append(k)
    kept = fewer[: PANELS - 1]
    return kept if kept[-1] == len(counts) - 1 else [*kept, len(counts) - 1]


def _found(axes: Axes, rows: Sequence[Row]) -> None:
    """Share of the windows in which an estimator is right in the end, by the number of beams."""
    for place, style in (("floor", "-o"), ("room", "--s")):
        of_place = chosen(rows, part=place)
        for name in dict.fromkeys(each["estimator"] for each in of_place):
            own = chosen(of_place, estimator=name)
            beams = sorted({each["beams"] for each in own})
            shares = [100.0 * float(np.mean([each["found"] for each in chosen(own, beams=n)])) for n in beams]
            label = name if place == "floor" else None
            axes.plot(range(len(beams)), shares, style, color=COLOURS.get(name), label=label, ms=5, lw=1.4)
            axes.set_xticks(range(len(beams)), [str(n) for n in beams])
    axes.set(xlabel="beams", ylabel="right in the last quarter [% of windows]", ylim=(-3.0, 103.0))
    axes.legend(fontsize=7)


def _beacons(axes: Axes, rows: Sequence[Row]) -> None:
    """Error of position with all beacons, by log and method."""
    every = [row for part in ("beacons", "unicycles") for row in _whole(chosen(rows, part=part))]
    own = [row for log in dict.fromkeys(row["log"] for row in every) for row in chosen(every, log=log)]
    labels = [f"{row['log']}, {row['estimator']}" for row in own]
    colours = {"beacon_bank": "#0d5fa8", "smoother of beacon_bank": "#6fb0dc"}
    axes.barh(
        range(len(own)),
        [row["position_rms_m"] for row in own],
        color=[colours.get(row["estimator"], "#9aa1a9") for row in own],
    )
    axes.set_yticks(range(len(own)), labels, fontsize=7)
    axes.invert_yaxis()
    axes.set(xlabel="error of position, RMS [m]")


def _whole(rows: Sequence[Row]) -> list[Row]:
    """Rows with all beacons of each log, of GTSAM the better one."""
    most = {row["log"]: max(each["beams"] for each in chosen(rows, log=row["log"])) for row in rows}
    of_all = [row for row in rows if row["beams"] == most[row["log"]] and row["start"] != "known"]
    best: dict[tuple[str, str], Row] = {}
    for row in of_all:
        key = row["log"], row["estimator"]
        if key not in best or row["position_rms_m"] < best[key]["position_rms_m"]:
            best[key] = row
    return list(best.values())


def _arm(axes: Axes, rows: Sequence[Row]) -> None:
    """Error of the velocities of an arm, by filter."""
    own = chosen(rows, part="arm")
    names = list(dict.fromkeys(row["estimator"] for row in own))
    for log, marker in zip(dict.fromkeys(row["log"] for row in own), "osD^", strict=False):
        errors = [row["velocity_rms_rad_s"] for row in chosen(own, log=log)]
        axes.plot(errors, range(len(errors)), marker, label=log, ms=6)
    axes.set_yticks(range(len(names)), names, fontsize=7)
    axes.invert_yaxis()
    axes.set(xlabel="error of velocity, RMS [rad/s]", xscale="log")
    axes.legend(fontsize=7)


def _attitude(axes: Axes, rows: Sequence[Row]) -> None:
    """Error of the inclination in each trial, by filter."""
    own = chosen(rows, part="attitude")
    trials = list(dict.fromkeys(row["log"] for row in own))
    names = dict.fromkeys(row["estimator"] for row in own)
    for name, marker, colour in zip(names, "osd^", ("#0d5fa8", "#e08214", "#9aa1a9", "#c2183b"), strict=False):
        errors = {row["log"]: row["inclination_rms_deg"] for row in chosen(own, estimator=name)}
        axes.plot(
            [errors.get(trial, math.nan) for trial in trials],
            range(len(trials)),
            marker,
            color=colour,
            label=name,
            ms=4,
        )
    axes.set_yticks(range(len(trials)), [trial.partition("_")[0] for trial in trials], fontsize=6)
    axes.invert_yaxis()
    axes.set(xlabel="error of the inclination, RMS [°]", ylabel="trial", xlim=(0.0, None))
    axes.legend(fontsize=7, loc="upper right")


@dataclass(frozen=True)
class _Chart:
    """Chart of the rows of some parts."""

    title: str
    parts: tuple[str, ...]
    draw: Callable[[Axes, Sequence[Row]], None]


_CHARTS = (
    _Chart("floors (solid) and rooms (dashed)", ("floor", "room"), _found),
    _Chart("beacons, all of them", ("beacons", "unicycles"), _beacons),
    _Chart("arm", ("arm",), _arm),
    _Chart("attitude", ("attitude",), _attitude),
)
