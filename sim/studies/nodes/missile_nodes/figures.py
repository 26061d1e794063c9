"""The figures of the study ``missile-nodes``: paths, accuracy and time against the number of nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.controllers.ocp.solution import ReplayResult, Solution
from mathnavi.renders.figures import STYLE
from mathnavi.sim.interfaces.signals import Array

SCHEME = "Hermite-Simpson"
COLOURS = {"uniform": "#6b7785", "equidistributed": "#c2183b", "redistributed, arclength": "#e08a1e",
           "redistributed, curvature": "#1b7fbd", "redistributed, local error": "#2f9e5b"}  # fmt: skip


@dataclass(frozen=True, eq=False)
class PlannedPath:
    """A planned path of the missile, at its nodes and between them."""

    x: Array  # (N, nx) states at the nodes
    between: Array  # (400, nx) states at equal times
    replay: ReplayResult

    @staticmethod
    def from_solution(solution: Solution) -> PlannedPath:
        """The path of a solution that was replayed."""
        assert solution.replay is not None
        return PlannedPath(solution.x, solution.state(np.linspace(0.0, solution.duration, 400)), solution.replay)


def nodes_figure(
    planned: tuple[PlannedPath, PlannedPath],
    table: Mapping[tuple[str, str, int, str], Mapping[str, Any]],
    case: str,
    nodes: Sequence[int],
    methods: Sequence[str],
) -> Figure:
    """Figures B.5, B.6, B.7 and B.2 side by side."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(10.4, 7.0), layout="constrained")
        (paths, errors), (times, load) = figure.subplots(2, 2)
        _paths(paths, *planned)
        for method in methods:
            rows = [table[case, SCHEME, n, method] for n in nodes]
            style = {"color": COLOURS[method], "label": method, "ms": 4, "lw": 1.5}
            errors.plot(nodes, [row["control_error"] for row in rows], "o-", **style)
            times.plot(nodes, [row["solve_ms"] for row in rows], "o-", **style)
        errors.set_yscale("log")
        errors.set(xlabel="N", ylabel="relative control error", title=f"(b) accuracy, {case} (Figure B.6)")
        errors.legend(fontsize=8)
        times.set(xlabel="N", ylabel="time [ms]", title=f"(c) time, {case} (Figure B.7)")
        times.set_ylim(bottom=0.0)
        _load(load, table, nodes)
    return figure


def _paths(axes: Axes, even: PlannedPath, adaptive: PlannedPath) -> None:
    for solution, method, marker in ((even, "uniform", "o"), (adaptive, "equidistributed", "s")):
        path = solution.between
        axes.plot(path[:, 4], -path[:, 5], color=COLOURS[method], lw=0.8, alpha=0.7)
        axes.plot(
            solution.x[:, 4], -solution.x[:, 5], marker, color=COLOURS[method], mfc="none", ms=5, mew=1.1, label=method
        )
        theta, u, w = solution.x[:, 3], solution.x[:, 0], solution.x[:, 1]
        velocity = np.stack([u * np.cos(theta) + w * np.sin(theta), u * np.sin(theta) - w * np.cos(theta)])
        axes.quiver(
            solution.x[:, 4], -solution.x[:, 5], *velocity, color=COLOURS[method], width=0.0022, alpha=0.5,
            angles="xy", scale_units="xy", scale=4.0, headwidth=0,
        )  # fmt: skip
    axes.plot(700.0, 0.0, "x", color="#101824", ms=8, mew=2)
    axes.annotate("target", (700.0, 0.0), (-8, 4), textcoords="offset points", ha="right", fontsize=8)
    axes.set(xlabel="x [m]", ylabel="altitude [m]", title="(a) reference trajectories, N = 50 (Figure B.5)")
    axes.legend(fontsize=8)
    density = axes.inset_axes((0.38, 0.1, 0.4, 0.24))
    for solution, method in ((even, "uniform"), (adaptive, "equidistributed")):
        steps = np.hypot(*np.diff(solution.x[:, 4:6], axis=0).T)
        density.plot(np.cumsum(steps) - 0.5 * steps, 100.0 / steps, color=COLOURS[method], lw=1.4)
    density.set(ylim=(0.0, None))
    density.set_title("nodes for each 100 m, along the path [m]", fontsize=7.5, weight="normal")
    density.tick_params(labelsize=7)


def _load(axes: Axes, table: Mapping[tuple[str, str, int, str], Mapping[str, Any]], nodes: Sequence[int]) -> None:
    """Mean and largest time of a uniform solve over the cases and transcriptions."""
    spent = {
        n: [row["solve_ms"] for (_, _, m, method), row in table.items() if m == n and method == "uniform"]
        for n in nodes
    }
    axes.plot(nodes, [max(spent[n]) for n in nodes], "s--", color="#1b2733", ms=4, label="largest")
    axes.plot(nodes, [float(np.mean(spent[n])) for n in nodes], "o-", color="#1b7fbd", ms=4, label="mean")
    axes.set(xlabel="N", ylabel="time [ms]", title="(d) uniform nodes, cases and transcriptions (Figure B.2)")
    axes.set_ylim(bottom=0.0)
    axes.legend(fontsize=8)
