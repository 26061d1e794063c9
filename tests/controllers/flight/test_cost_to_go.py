"""The terminal cost: shortest ways on the grid, interpolated without traps."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.controllers.flight.cost_to_go import (
    FactoredCost,
    TerrainGrid,
    TrilinearCost,
    factored_cost,
    node_distance,
    threat_density,
    trilinear_cost,
)
from mathnavi.controllers.flight.spline import TARGET_LENGTH
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain
from mathnavi.models.terrain.visibility import Radar
from tests import flight

RADAR = Radar(6500.0, 6000.0, 2500.0, 6.0)


def target_of(terrain: HeightField) -> Array:
    return np.array(flight.above(terrain, flight.TARGET, 150.0))


@pytest.fixture(scope="module")
def factored() -> FactoredCost:
    terrain = flight.mountains()
    return factored_cost(terrain, target_of(terrain), (), 33, 5)


@pytest.fixture(scope="module")
def trilinear() -> TrilinearCost:
    terrain = flight.mountains()
    return trilinear_cost(terrain, target_of(terrain), (), 33, 5)


def test_over_flat_ground_it_is_the_straight_line() -> None:
    plain = HeightField(np.full((41, 41), 100.0), 1000.0)
    target = np.array([17_300.0, 22_900.0, 700.0])
    cost = factored_cost(plain, target, (), 65, 9)
    p = np.random.default_rng(0).uniform([0.0, 0.0, 220.0], [40_000.0, 40_000.0, 2500.0], (2000, 3))
    level = np.column_stack([p[:, :2], np.full(len(p), target[2])])

    def excess(points: Array) -> Array:
        straight = np.sqrt(((points - target) ** 2).sum(axis=1) + TARGET_LENGTH**2)
        ratio: Array = (cost(points) + TARGET_LENGTH) / straight
        return np.abs(ratio - 1.0)

    assert excess(level).max() < 1e-9
    assert np.percentile(excess(p), 95) < 0.02  # steeply above or below the target the grid's own directions show


def test_at_the_target_nothing_is_left_to_pay(factored: FactoredCost, trilinear: TrilinearCost) -> None:
    np.testing.assert_allclose(factored(factored.target), 0.0, atol=1e-6)
    np.testing.assert_allclose(factored.gradient(factored.target), 0.0, atol=1e-3)
    np.testing.assert_allclose(trilinear(trilinear.target), 0.0, atol=1e-6)


def test_the_trilinear_cost_has_the_nodes_values(trilinear: TrilinearCost) -> None:
    nodes = trilinear.grid.positions.reshape(-1, 3)
    np.testing.assert_allclose(trilinear(nodes), trilinear.distance.ravel(), atol=1e-6)


def numerical_gradient(cost: FactoredCost | TrilinearCost, p: Array, step: float) -> Array:
    axes = step * np.eye(3)
    return np.stack([(cost(p + axis) - cost(p - axis)) / (2.0 * step) for axis in axes], axis=-1)


def points(count: int, low: float, high: float) -> Array:
    terrain, rng = flight.mountains(), np.random.default_rng(2)
    x, y = rng.uniform(100.0, flight.SIDE - 100.0, (2, count))
    return np.column_stack([x, y, terrain.height(x, y) + rng.uniform(low, high, count)])


def test_the_factored_costs_gradient_is_its_slope(factored: FactoredCost) -> None:
    p = points(500, 150.0, 2000.0)
    np.testing.assert_allclose(factored.gradient(p), numerical_gradient(factored, p, 0.1), rtol=0.0, atol=1e-4)


def test_the_trilinear_costs_gradient_is_its_slope_within_cells_and_above_them(trilinear: TrilinearCost) -> None:
    p = np.vstack([points(500, 150.0, 2000.0), points(500, 3500.0, 9000.0)])
    difference = np.abs(trilinear.gradient(p) - numerical_gradient(trilinear, p, 1e-3)).max(axis=1)
    assert (difference < 1e-5).mean() > 0.99  # a few points lie on the faces of cells


def test_above_its_grid_the_trilinear_cost_rises_with_the_height(trilinear: TrilinearCost) -> None:
    p = points(200, 4000.0, 5000.0)
    np.testing.assert_allclose(trilinear(p + np.array([0.0, 0.0, 777.0])) - trilinear(p), 777.0)


def test_a_radar_makes_its_sight_dear_and_nothing_cheaper() -> None:
    terrain = flight.mountains()
    grid = TerrainGrid.around(terrain, target_of(terrain), 33, 5)
    density = threat_density(grid, terrain, (RADAR,))
    plain, threatened = node_distance(grid, np.zeros(grid.shape)), node_distance(grid, density)
    assert (threatened >= plain - 1e-9).all()
    seen = RADAR.exposed(terrain, grid.positions.reshape(-1, 3)).reshape(grid.shape)
    assert seen.sum() > 100
    assert (threatened[seen] > 1.05 * plain[seen]).all()
    outside = np.linalg.norm(grid.positions - RADAR.position(terrain), axis=-1) > RADAR.radius + 4.0 * grid.spacing
    assert density[outside].max() < 1e-3


def test_a_radar_behind_the_mountain_does_not_see_the_valley() -> None:
    terrain = flight.mountains()
    grid = TerrainGrid.around(terrain, target_of(terrain), 33, 5)
    density = threat_density(grid, terrain, (Radar(*flight.TARGET, 30_000.0, 1.0),))
    east, north = flight.START
    i, j = round((north - grid.y_0) / grid.spacing), round((east - grid.x_0) / grid.spacing)
    assert density[0, i, j] < 0.05 < 0.5 < density[-1, i, j]


def flown_down(cost: FactoredCost, p: Array) -> Array:
    """Where gradient descent comes to, with steps of a part of the way that is left."""
    for _ in range(600):
        slope = cost.gradient(p)
        distance = np.linalg.norm(p - cost.target, axis=1)
        step = np.minimum(0.05 * distance, 400.0)
        p = p - (step / np.maximum(np.linalg.norm(slope, axis=1), 1e-9))[:, None] * slope
    return p


def test_down_its_gradient_every_way_leads_to_the_target() -> None:
    terrain = load_terrain("tian_shan")
    target = np.array(flight.above(terrain, (0.83 * terrain.width, 0.77 * terrain.depth), 180.0))
    cost = factored_cost(terrain, target, (), 65, 9)
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0.0, terrain.width, (2, 300))
    starts = np.column_stack([x, y, terrain.height(x, y) + rng.uniform(60.0, 2000.0, 300)])
    stuck = np.linalg.norm(flown_down(cost, starts) - target, axis=1) > 100.0
    assert not stuck.any()
