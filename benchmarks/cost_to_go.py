"""The terminal cost: how long it takes to build, and whether its gradient leads to the target from everywhere.

    python benchmarks/cost_to_go.py [--terrain NAME|FILE.npz] [--starts 2000]

The print's figures for its 33 x 33 x 5 grid are 15.8 s to build and 1.5 s to change. A start is stuck if the gradient
flow from it does not come within 200 m of the target.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

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
from models.terrain.library import load_terrain
from models.terrain.visibility import Radar
from sim.signals import Array

GRIDS = ((33, 5), (65, 9))
NEAR = 200.0  # [m]
RADAR_RADIUS, RADAR_WEIGHT = 10_000.0, 10.0


@dataclass(frozen=True)
class Arguments:
    """Time the cost-to-go and follow its gradient."""

    terrain: str = "tian_shan"
    """name of a terrain, or an .npz file"""
    starts: int = 2000
    """random starts of the gradient flow"""
    repetitions: int = 7
    """builds of each grid"""
    seed: int = 0
    """of target, radar and starts"""


def median_ms(work: Callable[[], object], repetitions: int) -> float:
    """Median wall time [ms] of several runs."""
    times = []
    for _ in range(repetitions):
        began = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - began))
    return statistics.median(times)


def stuck(cost: FactoredCost | TrilinearCost, terrain: HeightField, starts: int, rng: np.random.Generator) -> int:
    """How many of the random starts do not reach the target along the negative gradient."""
    points = rng.uniform((0.0, 0.0), (terrain.width, terrain.depth), (starts, 2))
    above = rng.uniform(50.0, 2000.0, starts)
    p: Array = np.column_stack([points, terrain.height(points[:, 0], points[:, 1]) + above])
    for stride, count in ((100.0, 2500), (10.0, 400)):
        for _ in range(count):
            gradient = cost.gradient(p)
            size = np.linalg.norm(gradient, axis=1, keepdims=True) + 1e-12
            left = np.linalg.norm(p - cost.target, axis=1, keepdims=True)
            p = p - np.minimum(stride, 0.5 * left) * gradient / size
            p[:, :2] = np.clip(p[:, :2], 0.0, (terrain.width, terrain.depth))
    return int((np.linalg.norm(p - cost.target, axis=1) > NEAR).sum())


def main(arguments: Arguments) -> None:
    console, rng = Console(), np.random.default_rng(arguments.seed)
    terrain = load_terrain(arguments.terrain)
    size = np.array([terrain.width, terrain.depth])
    x, y = rng.uniform(0.1 * size, 0.9 * size)
    target = np.array([x, y, float(terrain.height(x, y)) + 250.0])
    radar = Radar(float(0.5 * size[0]), float(0.5 * size[1]), RADAR_RADIUS, RADAR_WEIGHT)

    times = Table("grid", "build [ms]", "change for a radar [ms]", title=f"Cost-to-go on {terrain.name}, medians")
    for nodes, layers in GRIDS:

        def build(nodes: int = nodes, layers: int = layers) -> object:
            return factored_cost(terrain, target, (), nodes, layers)

        grid = TerrainGrid.around(terrain, target, nodes, layers)
        _ = grid.edges  # the graph exists already when a threat changes its weights

        def change(grid: TerrainGrid = grid) -> object:
            return FactoredCost.build(grid, node_distance(grid, threat_density(grid, terrain, (radar,))))

        medians = [f"{median_ms(work, arguments.repetitions):.1f}" for work in (build, change)]
        times.add_row(f"{nodes} x {nodes} x {layers}", *medians)
    console.print(times)

    flow = Table("grid", "interpolation", "radar", f"stuck of {arguments.starts}", title="Gradient flow")
    for nodes, layers in GRIDS:
        for name, build_cost in (("factored", factored_cost), ("trilinear", trilinear_cost)):
            for radars in ((), (radar,)):
                cost = build_cost(terrain, target, radars, nodes, layers)
                count = stuck(cost, terrain, arguments.starts, np.random.default_rng(arguments.seed))
                row = (f"{nodes} x {nodes} x {layers}", name, "yes" if radars else "no", str(count))
                flow.add_row(*row)
    console.print(flow)


if __name__ == "__main__":
    main(tyro.cli(Arguments, description=__doc__))
