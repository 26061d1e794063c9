"""A picture of a robot that finds itself on a floor: walls, beams, and the poses that can be, which become fewer."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

import mathnavi as mn
from mathnavi.interfaces.signals import Array, Integers

PANELS = 6
WALL, POSE, BEAM, TRUTH = "#30343b", "#d9480f", "#1c7ed6", "#2b8a3e"


def draw(
    file: Path, walls: mn.Polygon, found: mn.EstimateHistory, at: Integers, truth: Array, ranges: Array, angles: Array
) -> None:
    """Write a picture with a panel for each of some scans.

    ``at`` (n,) are the rows of the estimates at the scans, ``truth`` (n, 3) the poses of the reference, ``ranges``
    (n, l) [m] what the beams at ``angles`` (l,) [rad] read, NaN without an echo.
    """
    chosen = moments(found.extra["hypotheses"][at])
    low, high = walls.polyline.min(axis=0), walls.polyline.max(axis=0)
    across = 2 if (high - low)[0] > 1.5 * (high - low)[1] else 3
    down = math.ceil(PANELS / across)
    width = 5.0
    figure = Figure((across * width, down * width * float((high - low)[1] / (high - low)[0]) + 0.35 * down))
    for number, k in enumerate(chosen, start=1):
        axes = figure.add_subplot(down, across, number)
        axes.add_collection(LineCollection(list(walls.outlines), colors=WALL, linewidths=0.6))
        poses = found.extra["hypotheses"][at[k]]
        poses = poses[np.isfinite(poses[:, 0])]
        ahead = 0.6 * np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
        arrows = np.stack([poses[:, :2], poses[:, :2] + ahead], axis=1)
        axes.add_collection(LineCollection(list(arrows), colors=POSE, linewidths=0.8, alpha=0.7, zorder=3))
        axes.plot(*poses[:, :2].T, ".", color=POSE, markersize=2.5, zorder=3)
        best = found.x[at[k]]
        seen = np.isfinite(ranges[k])
        directions = best[2] + angles[seen]
        ends = best[:2] + ranges[k, seen, None] * np.column_stack([np.cos(directions), np.sin(directions)])
        beams = np.stack([np.broadcast_to(best[:2], ends.shape), ends], axis=1)
        axes.add_collection(LineCollection(list(beams), colors=BEAM, linewidths=0.7, zorder=2))
        axes.plot(*truth[k, :2], "o", markerfacecolor="none", markeredgecolor=TRUTH, markersize=9, zorder=4)
        count = f"{len(poses)} poses" if len(poses) > 1 else "one pose"
        axes.set_title(f"after {found.t[at[k]] - found.t[at[0]]:.0f} s: {count}", fontsize=9)
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_aspect("equal")
        axes.set_axis_off()
    figure.tight_layout(pad=0.4)
    figure.savefig(file, dpi=160)


def moments(hypotheses: Array) -> list[int]:
    """Scans (up to ``PANELS``) at which the number of hypotheses (n, K, 3) is less than before, and the last."""
    counts = np.isfinite(hypotheses[:, :, 0]).sum(axis=1)
    fewer = [0]
    for k, count in enumerate(counts.tolist()):
        if 0 < count < 0.75 * counts[fewer[-1]]:
            fewer.append(k)
    chosen = fewer[: PANELS - 1]
    return chosen if chosen[-1] == len(counts) - 1 else [*chosen, len(counts) - 1]
