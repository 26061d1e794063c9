"""A.5: the terminal cost: how fast it is built and changed, how far its metric is off, and whether its gradient
arrives.

The print's figures, on its grid of 33 x 33 x 5 nodes in MATLAB: 15.8 s to build graph and cost, 1.5 s to change them. A
start of the gradient flow is stuck if the flow does not come within 200 m of the target. The error of the metric is
that of the graph's 26 neighbours on flat, empty ground: the length of its paths over the straight line.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from controllers.flight.cost_to_go import (
    FactoredCost,
    TerrainGrid,
    TrilinearCost,
    factored_cost,
    node_distance,
    threat_density,
    trilinear_cost,
)
from models.terrain.height_field import HeightField
from models.terrain.visibility import Radar
from renders.claims import Claim
from renders.figures import STYLE
from renders.study_report import Table
from renders.terrain_view import Track
from sim.signals import Array
from sim.statistics import rate
from sim.studies.study import Findings, Setup, check_counts

GRIDS = ((33, 5), (65, 9))
PLANNERS_GRID = GRIDS[1]
NEAR = 200.0  # [m]
RADIUS, WEIGHT = 10_000.0, 10.0
PRINTED_BUILD, PRINTED_CHANGE = 15.8, 1.5  # [s]
MOST_SECONDS = {GRIDS[0]: 0.05, GRIDS[1]: 0.2}  # of the target
MOST_STUCK = 0.005  # of the target, with a radar
SHOWN = 12  # flow lines in the 3-D view


@dataclass(frozen=True)
class CostToGoConfig:
    """How much is measured."""

    starts: int = 2000
    """random starts of each gradient flow"""
    repetitions: int = 7
    """times that each cost is built"""

    def __post_init__(self) -> None:
        check_counts(self)


class CostToGo:
    """The terminal cost: time to build, error of its metric, starts that get stuck (A.5)."""

    Config = CostToGoConfig
    quick = CostToGoConfig(starts=200, repetitions=3)
    title = "Terminal cost by Dijkstra and interpolation"

    @staticmethod
    def run(config: CostToGoConfig, setup: Setup) -> Findings:
        terrain, rng = setup.ground, np.random.default_rng(0)
        size = np.array([terrain.width, terrain.depth])
        x, y = rng.uniform(0.1 * size, 0.9 * size)
        target = np.array([x, y, float(terrain.height(x, y)) + 250.0])
        radar = Radar(float(0.5 * size[0]), float(0.5 * size[1]), RADIUS, WEIGHT)
        starts = _starts(terrain, config.starts)
        times = [_times(terrain, target, radar, grid, config.repetitions) for grid in GRIDS]
        flows: list[dict[str, Any]] = []
        lines: list[Array] = []
        for nodes, layers in GRIDS:
            for name, build in (("factored", factored_cost), ("trilinear", trilinear_cost)):
                for radars in ((), (radar,)):
                    cost = build(terrain, target, radars, nodes, layers)
                    paths = flow(cost, terrain, starts, keep=SHOWN)
                    stuck = int((np.linalg.norm(paths[-1] - cost.target, axis=1) > NEAR).sum())
                    flows.append({"grid": nodes, "layers": layers, "interpolation": name, "radar": bool(radars),
                                  "stuck": stuck, "starts": config.starts})  # fmt: skip
                    if (nodes, layers) == PLANNERS_GRID and name == "factored" and radars:
                        lines = list(np.swapaxes(paths[:, :SHOWN], 0, 1))
        error = metric_error(setup.ground)
        ours = {
            row["radar"]: row["stuck"]
            for row in flows
            if row["grid"] == PLANNERS_GRID[0] and row["interpolation"] == "factored"
        }
        quick_enough = all(row["build_s"] <= MOST_SECONDS[row["grid"], row["layers"]] for row in times)
        return Findings(
            summary=(
                f"One target over {terrain.name}, a radar of {RADIUS / 1e3:.0f} km in the middle of the map. The "
                "flow follows the "
                f"negative gradient from {config.starts} random starts, 50 to 2000 m above the ground. On flat, "
                "empty ground "
                f"the graph's paths are {100.0 * np.median(error):.1f} % long (median; largest "
                f"{100.0 * error.max():.1f} %).",
            ),
            rows=[*times, *flows],
            tables=(_times_table(times), _flow_table(flows)),
            figure=_figure(flows, error),
            caption="Starts that get stuck with each interpolation, and how much too long the graph's paths are.",
            claims=(
                Claim(
                    "flight.cost-to-go", "target", "The terminal cost is built fast and has no traps.",
                    f"A.5 (print: {PRINTED_BUILD} s to build, {PRINTED_CHANGE} s to change)",
                    "built within 50 ms (33 x 33 x 5) and 200 ms (65 x 65 x 9); on the latter no start stuck without "
                    "a radar, "
                    f"at most {MOST_STUCK:.1%} with",
                    ", ".join(f"{1e3 * row['build_s']:.1f}" for row in times) + " ms to build, "
                    + ", ".join(f"{1e3 * row['change_s']:.1f}" for row in times)
                    + f" ms to change; stuck {ours[False]} without and {ours[True]} with a radar, of {config.starts}",
                    quick_enough and ours[False] == 0 and ours[True] <= MOST_STUCK * config.starts,
                ),
            ),
            tracks=[Track("gradient flow", line, "#2166ac") for line in lines],
            places={"target": target},
            radars=[(radar.x, radar.y, float(terrain.height(radar.x, radar.y)), RADIUS)],
        )  # fmt: skip


def _starts(terrain: HeightField, count: int) -> Array:
    rng = np.random.default_rng(0)
    points = rng.uniform((0.0, 0.0), (terrain.width, terrain.depth), (count, 2))
    above = rng.uniform(50.0, 2000.0, count)
    starts: Array = np.column_stack([points, terrain.height(points[:, 0], points[:, 1]) + above])
    return starts


def flow(cost: FactoredCost | TrilinearCost, terrain: HeightField, starts: Array, keep: int) -> Array:
    """Follow the negative gradient from the points (n, 3) [m]; (m, n, 3) are a few instants, the last one the end.

    Only the first ``keep`` points matter but in the last instant: in the others, the rest stands where it started.
    """
    p, instants = starts.copy(), [starts.copy()]
    for stride, count in ((100.0, 2500), (10.0, 400)):
        for k in range(count):
            gradient = cost.gradient(p)
            size = np.linalg.norm(gradient, axis=1, keepdims=True) + 1e-12
            left = np.linalg.norm(p - cost.target, axis=1, keepdims=True)
            p = p - np.minimum(stride, 0.5 * left) * gradient / size
            p[:, :2] = np.clip(p[:, :2], 0.0, (terrain.width, terrain.depth))
            if k % 25 == 24:
                instants.append(np.vstack([p[:keep], starts[keep:]]))
    return np.array([*instants, p])


def metric_error(terrain: HeightField) -> Array:
    """Length of the graph's way over the straight line, less one, to every node of the print's grid on flat ground."""
    flat = HeightField(np.zeros((2, 2)), max(terrain.width, terrain.depth), "flat")
    nodes, layers = GRIDS[0]
    target = np.array([0.5 * flat.width, 0.5 * flat.depth, 300.0])
    grid = TerrainGrid.around(flat, target, nodes, layers)
    distance = node_distance(grid, threat_density(grid, flat, ()))
    straight = np.linalg.norm(grid.positions - grid.positions[grid.target], axis=-1)
    away = straight > 0.0
    error: Array = distance[away] / straight[away] - 1.0
    return error


def _times(
    terrain: HeightField, target: Array, radar: Radar, size: tuple[int, int], repetitions: int
) -> dict[str, Any]:
    grid = TerrainGrid.around(terrain, target, *size)
    _ = grid.edges  # the graph exists already when a threat changes its weights

    def change() -> object:
        return FactoredCost.build(grid, node_distance(grid, threat_density(grid, terrain, (radar,))))

    return {
        "grid": size[0],
        "layers": size[1],
        "build_s": _seconds(lambda: factored_cost(terrain, target, (), *size), repetitions),
        "change_s": _seconds(change, repetitions),
    }


def _seconds(work: Callable[[], object], repetitions: int) -> float:
    """Median wall time [s]."""
    spent = []
    for _ in range(repetitions):
        began = time.perf_counter()
        work()
        spent.append(time.perf_counter() - began)
    return statistics.median(spent)


def _name(row: dict[str, Any]) -> str:
    return f"{row['grid']} × {row['grid']} × {row['layers']}"


def _times_table(times: list[dict[str, Any]]) -> Table:
    printed = (f"{PRINTED_BUILD} s", f"{PRINTED_CHANGE} s")
    cells = [
        (
            _name(r), f"{1e3 * r['build_s']:.1f} ms", printed[0] if r["grid"] == GRIDS[0][0] else "–",
            f"{1e3 * r['change_s']:.1f} ms", printed[1] if r["grid"] == GRIDS[0][0] else "–",
        )
        for r in times
    ]  # fmt: skip
    return Table("Time, median", ("grid", "to build", "printed", "to change for a radar", "printed"), cells)


def _flow_table(flows: list[dict[str, Any]]) -> Table:
    cells = [
        (_name(r), r["interpolation"], "yes" if r["radar"] else "no", rate(r["stuck"], r["starts"]).text())
        for r in flows
    ]
    return Table("Gradient flow", ("grid", "interpolation", "radar", "stuck"), cells)


def _figure(flows: list[dict[str, Any]], error: Array) -> Figure:
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.4, 3.2), layout="constrained")
        stuck, metric = figure.subplots(1, 2, width_ratios=(1.3, 1))
        names = [f"{_name(r)}\n{r['interpolation']}{', radar' if r['radar'] else ''}" for r in flows]
        shares = [100.0 * r["stuck"] / r["starts"] for r in flows]
        colours = ["#1a9850" if r["interpolation"] == "factored" else "#c2183b" for r in flows]
        bars = stuck.barh(names, shares, color=colours)
        stuck.bar_label(bars, [f"{r['stuck']}" for r in flows], padding=3)
        stuck.invert_yaxis()
        stuck.set(xlabel="starts that get stuck [%]", title="Gradient flow", xlim=(0.0, max(1.0, 1.15 * max(shares))))
        stuck.tick_params(axis="y", labelsize=7.5)
        metric.hist(100.0 * error, 40, color="#2166ac")
        metric.set(xlabel="longer than the straight line [%]", ylabel="nodes", title="26 neighbours on flat ground")
    return figure
