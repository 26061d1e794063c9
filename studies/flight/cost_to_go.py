"""The terminal cost of A.5: time to build and to change it, error of its metric, and starts that get stuck.

The thesis reports, for its grid of 33 x 33 x 5 nodes in MATLAB, 15.8 s to build graph and cost and 1.5 s to change
them. A start of the gradient flow is stuck if the flow does not come within 200 m of the target. Targets are drawn; a
radar stands either in the way, farther from the target than its range, or over the target. The error of the metric is
that of the graph's 26 neighbours on flat, empty ground: the length of its paths over the straight line.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mathnavi.controllers.flight.cost_to_go import (
    FactoredCost,
    TerrainGrid,
    TrilinearCost,
    factored_cost,
    node_distance,
    threat_density,
    trilinear_cost,
)
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import Radar
from mathnavi.renders.study_report import Table
from mathnavi.renders.terrain_view import Track
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Row, Setup, StudyResult, TerrainReference

GRIDS = ((33, 5), (65, 9))
PLANNERS_GRID = GRIDS[1]
NEAR = 200.0  # [m]
THERE = 1.0  # [m] from the target, where the flow need not go on
RADIUS, WEIGHT = 10_000.0, 10.0
CASES = ("none", "in the way", "over the target")  # where the radar stands
PRINTED_BUILD, PRINTED_CHANGE = 15.8, 1.5  # [s]
MOST_SECONDS = {GRIDS[0]: 0.05, GRIDS[1]: 0.2}  # of the target
MOST_STUCK = 0.005  # of the target, with a radar
SHOWN = 12  # flow lines in the 3-D view
COSTS: dict[str, Callable[..., FactoredCost | TrilinearCost]] = {
    "factored": factored_cost,
    "trilinear": trilinear_cost,
}


@configuration
class CostToGoConfig:
    """Sample sizes: cases that are measured."""

    targets: Count = 10
    """number of targets, each with its radar"""
    starts: Count = 200
    """number of random starts of the gradient flow to each target"""
    repetitions: Count = 7
    """number of times that each cost is built"""


class CostToGo:
    """The terminal cost: time to build, error of its metric, starts that get stuck (A.5)."""

    Config = CostToGoConfig
    quick = CostToGoConfig(targets=3, starts=60, repetitions=3)
    title = "Terminal cost by Dijkstra and interpolation"

    @staticmethod
    def run(config: CostToGoConfig, setup: Setup) -> StudyResult:
        terrain, draw = setup.ground, DrawnTargets(setup.place, config.targets, config.starts)
        first = _targets(draw)[0]
        times = setup.compute(timed_grid, GRIDS, draw=draw, repetitions=config.repetitions)
        cases = [
            GradientFlow(draw, grid, interpolation, radar)
            for grid in GRIDS
            for interpolation in COSTS
            for radar in CASES
        ]
        flows: list[dict[str, Any]] = [
            {"grid": case.grid[0], "layers": case.grid[1], "interpolation": case.interpolation, "radar": case.radar,
             "stuck": sum(stuck), "starts": config.starts * config.targets,
             "targets_with_stuck": sum(map(bool, stuck)), "targets": config.targets}
            for case, stuck in zip(cases, setup.compute(stuck_starts, cases), strict=True)
        ]  # fmt: skip
        (lines,) = setup.compute(flow_lines, [GradientFlow(draw, PLANNERS_GRID, "factored", CASES[1])])
        (error,) = setup.compute(flat_metric_error, [setup.place])
        ours = {
            row["radar"]: row["stuck"]
            for row in flows
            if row["grid"] == PLANNERS_GRID[0] and row["interpolation"] == "factored"
        }
        shown = first.radars["in the way"]
        quick_enough = all(row["build_s"] <= MOST_SECONDS[row["grid"], row["layers"]] for row in times)
        return StudyResult(
            summary=(
                f"{config.targets} targets over {terrain.name}, each with {config.starts} random starts 50 to 2000 m "
                "above the ground and with a radar, in the way or over the target itself. The flow follows the "
                f"negative gradient. On flat, empty ground the graph's paths are {100.0 * np.median(error):.1f} % "
                f"long (median; largest {100.0 * error.max():.1f} %).",
            ),
            rows=[*times, *flows],
            tables=(_times_table(times), _flow_table(flows)),
            figure=_figure(flows, error),
            caption="Starts that get stuck with each interpolation, and how much too long the graph's paths are.",
            claims=(
                Claim(
                    "flight.cost-to-go", "target", "The terminal cost is built fast and has no traps.",
                    f"A.5 (print: {PRINTED_BUILD} s to build, {PRINTED_CHANGE} s to change)",
                    "built within 50 ms (33 x 33 x 5) and 200 ms (65 x 65 x 9); on the latter no start stuck "
                    f"without a radar, at most {MOST_STUCK:.1%} with one in the way",
                    ", ".join(f"{1e3 * row['build_s']:.1f}" for row in times) + " ms to build, "
                    + ", ".join(f"{1e3 * row['change_s']:.1f}" for row in times)
                    + f" ms to change; stuck {ours['none']} without a radar, {ours['in the way']} with one in the way, "
                    f"{ours['over the target']} with one over the target, of {config.starts * config.targets}",
                    quick_enough and ours["none"] == 0
                    and ours["in the way"] <= MOST_STUCK * config.starts * config.targets,
                ),
            ),
            tracks=[Track("gradient flow", line, "#2166ac") for line in lines],
            places={"target": first.target},
            radars=[(shown.x, shown.y, float(terrain.height(shown.x, shown.y)), shown.radius)],
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class FlowTarget:
    """A target of the gradient flow, with its starts and its radars."""

    target: Array  # (3,) [m]
    starts: Array  # (n, 3) [m]
    radars: dict[str, Radar]  # by where they stand


@dataclass(frozen=True)
class DrawnTargets:
    """Targets drawn over a terrain, each with a number of starts."""

    place: TerrainReference
    targets: int
    starts: int


@dataclass(frozen=True)
class GradientFlow:
    """Gradient flow to drawn targets, on one grid, by one interpolation, with one place of the radar."""

    draw: DrawnTargets
    grid: tuple[int, int]  # nodes along a side, layers
    interpolation: str  # of COSTS
    radar: str  # of CASES

    def paths(self, to: FlowTarget) -> tuple[Array, Array]:
        """Return positions (m, n, 3) [m] of the flow to one target, and the target (3,) [m] on the grid."""
        ground = self.draw.place.ground
        radars = [to.radars[self.radar]] if self.radar in to.radars else []
        cost = COSTS[self.interpolation](ground, to.target, radars, *self.grid)
        return flow(cost, ground, to.starts, keep=SHOWN), cost.target


@cache
def _targets(draw: DrawnTargets) -> list[FlowTarget]:
    rngs = np.random.default_rng(0).spawn(draw.targets)
    return [_target(draw.place.ground, draw.starts, rng) for rng in rngs]


def stuck_starts(case: GradientFlow) -> list[int]:
    """A job: number of starts, by target, from which the flow does not arrive."""
    found = map(case.paths, _targets(case.draw))
    return [int((np.linalg.norm(paths[-1] - target, axis=1) > NEAR).sum()) for paths, target in found]


def flow_lines(case: GradientFlow) -> list[Array]:
    """A job: the first lines (m, 3) [m] of the flow to the first target, for the 3-D view."""
    paths, _ = case.paths(_targets(case.draw)[0])
    return list(np.swapaxes(paths[:, :SHOWN], 0, 1))


def flat_metric_error(place: TerrainReference) -> Array:
    """A job: ``metric_error`` on flat ground of the size of a terrain."""
    return metric_error(place.ground)


def _target(terrain: HeightField, count: int, rng: np.random.Generator) -> FlowTarget:
    """Draw a target, its starts and its radars; radars on a small map have a smaller range."""
    size = np.array([terrain.width, terrain.depth])
    radius = min(RADIUS, 0.2 * float(size.min()))
    x, y = rng.uniform(0.1 * size, 0.9 * size)
    while True:  # more than half of the map lies so far from any of its points
        place = rng.uniform(0.0, size)
        if np.hypot(*(place - (x, y))) > 1.2 * radius:
            break
    over = np.clip(np.array([x, y]) + rng.uniform(-0.5, 0.5, 2) * radius, 0.0, size)
    points = rng.uniform(0.0, size, (count, 2))
    above = rng.uniform(50.0, 2000.0, count)
    return FlowTarget(
        np.array([x, y, float(terrain.height(x, y)) + 250.0]),
        np.column_stack([points, terrain.height(points[:, 0], points[:, 1]) + above]),
        {
            CASES[1]: Radar(float(place[0]), float(place[1]), radius, WEIGHT),
            CASES[2]: Radar(float(over[0]), float(over[1]), radius, WEIGHT),
        },
    )


def flow(cost: FactoredCost | TrilinearCost, terrain: HeightField, starts: Array, keep: int) -> Array:
    """Follow the negative gradient from the points (n, 3) [m]; return positions (m, n, 3) [m] over time.

    Before the end only the first ``keep`` points are recorded; the others stand at their starts. A point within
    ``THERE`` of the target stays, and the flow ends when all points are there.
    """
    p, instants = starts.copy(), [starts.copy()]
    across = max(terrain.width, terrain.depth)
    for stride, count in ((100.0, min(2500, round(8.0 * across / 100.0))), (10.0, 400)):
        for k in range(count):
            left = np.linalg.norm(p - cost.target, axis=1)
            under_way = left > THERE
            if not under_way.any():
                break
            gradient = cost.gradient(p[under_way])
            size = np.linalg.norm(gradient, axis=1, keepdims=True) + 1e-12
            moved = p[under_way] - np.minimum(stride, 0.5 * left[under_way, None]) * gradient / size
            moved[:, :2] = np.clip(moved[:, :2], 0.0, (terrain.width, terrain.depth))
            p[under_way] = moved
            if k % 25 == 24:
                instants.append(np.vstack([p[:keep], starts[keep:]]))
    return np.array([*instants, p])


def metric_error(terrain: HeightField) -> Array:
    """Return the length of the graph's path over the straight line, less one, to every node of the thesis' grid."""
    flat = HeightField(np.zeros((2, 2)), max(terrain.width, terrain.depth), "flat")
    nodes, layers = GRIDS[0]
    target = np.array([0.5 * flat.width, 0.5 * flat.depth, 300.0])
    grid = TerrainGrid.around(flat, target, nodes, layers)
    distance = node_distance(grid, threat_density(grid, flat, ()))
    straight = np.linalg.norm(grid.positions - grid.positions[grid.target], axis=-1)
    elsewhere = straight > 0.0
    error: Array = distance[elsewhere] / straight[elsewhere] - 1.0
    return error


def timed_grid(size: tuple[int, int], draw: DrawnTargets, repetitions: int) -> dict[str, Any]:
    """A job: times [s] to build the cost to the first target on a grid, and to change it for a radar in the way."""
    terrain, first = draw.place.ground, _targets(draw)[0]
    target, radar = first.target, first.radars["in the way"]
    grid = TerrainGrid.around(terrain, target, *size)

    def build() -> object:
        fresh = TerrainGrid.around(terrain, target, *size)
        return FactoredCost.build(fresh, node_distance(fresh, threat_density(fresh, terrain, ())))

    def change() -> object:
        return FactoredCost.build(grid, node_distance(grid, threat_density(grid, terrain, (radar,))))

    change()  # so that the graph is there: a threat changes its weights only
    return {
        "grid": size[0],
        "layers": size[1],
        "build_s": _seconds(build, repetitions),
        "change_s": _seconds(change, repetitions),
    }


def _seconds(work: Callable[[], object], repetitions: int) -> MeasuredTime:
    """Return the median wall-clock time [s]."""
    spent = []
    for _ in range(repetitions):
        began = time.perf_counter()
        work()
        spent.append(time.perf_counter() - began)
    return MeasuredTime(statistics.median(spent))


def _name(row: Row) -> str:
    return f"{row['grid']} × {row['grid']} × {row['layers']}"


def _beside(row: Row) -> str:
    return "" if row["radar"] == "none" else f", radar {row['radar']}"


def _times_table(times: list[dict[str, Any]]) -> Table:
    printed = (f"{PRINTED_BUILD} s", f"{PRINTED_CHANGE} s")
    return Table.of("Time, median", times, (
        ("grid", _name), ("to build", lambda r: f"{1e3 * r['build_s']:.1f} ms"),
        ("printed", lambda r: printed[0] if r["grid"] == GRIDS[0][0] else "–"),
        ("to change for a radar", lambda r: f"{1e3 * r['change_s']:.1f} ms"),
        ("printed", lambda r: printed[1] if r["grid"] == GRIDS[0][0] else "–"),
    ))  # fmt: skip


def _flow_table(flows: list[dict[str, Any]]) -> Table:
    return Table.of("Gradient flow", flows, (
        ("grid", _name), ("interpolation", "interpolation"), ("radar", "radar"),
        ("starts stuck", "{stuck} of {starts}"), ("targets with any", "{targets_with_stuck} of {targets}"),
    ))  # fmt: skip


def _figure(flows: list[dict[str, Any]], error: Array) -> Figure:
    with styled_figure((9.4, 4.4)) as figure:
        stuck, metric = figure.subplots(1, 2, width_ratios=(1.3, 1))
        names = [f"{_name(r)}\n{r['interpolation']}{_beside(r)}" for r in flows]
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
