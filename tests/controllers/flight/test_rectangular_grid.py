"""The cost-to-go's grid lies on the map, whatever its shape, and a radar's sight has no way around it off the map."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mathnavi.controllers.flight.cost_to_go import (
    TerrainGrid,
    factored_cost,
    node_distance,
    threat_density,
    trilinear_cost,
)
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import Radar

SPACING = 100.0  # [m]


def rolling(rows: int, columns: int) -> HeightField:
    rng = np.random.default_rng([rows, columns])
    return HeightField(200.0 + rng.uniform(0.0, 40.0, (rows, columns)), SPACING)


@given(
    rows=st.integers(2, 90),
    columns=st.integers(2, 90),
    east=st.floats(0.0, 1.0),
    north=st.floats(0.0, 1.0),
    nodes=st.integers(3, 33),
)
@settings(max_examples=60, deadline=None)
@example(rows=21, columns=65, east=0.93, north=0.5, nodes=65)
@example(rows=65, columns=21, east=0.5, north=0.93, nodes=65)
@example(rows=2, columns=90, east=1.0, north=1.0, nodes=33)
@example(rows=90, columns=2, east=0.0, north=0.3, nodes=33)
def test_every_node_is_on_the_map_and_the_target_is_one(
    rows: int, columns: int, east: float, north: float, nodes: int
) -> None:
    terrain = rolling(rows, columns)
    x, y = east * terrain.width, north * terrain.depth
    target = np.array([x, y, float(terrain.height(x, y)) + 300.0])
    grid = TerrainGrid.around(terrain, target, nodes, 5)
    east_of, north_of = grid.positions[..., 0], grid.positions[..., 1]
    assert east_of.min() >= -1e-6
    assert north_of.min() >= -1e-6
    assert east_of.max() <= terrain.width + 1e-6
    assert north_of.max() <= terrain.depth + 1e-6
    np.testing.assert_allclose(grid.positions[grid.target], target, atol=1e-6)
    # It covers the map but for less than a cell at each edge.
    assert min(grid.shape[1:]) >= 2
    assert np.ptp(east_of) > terrain.width - 2.0 * grid.spacing
    assert np.ptp(north_of) > terrain.depth - 2.0 * grid.spacing
    longer = max(terrain.width, terrain.depth)
    assert grid.spacing == pytest.approx(min(longer / (nodes - 1), 0.5 * min(terrain.width, terrain.depth)))
    np.testing.assert_allclose(
        grid.ground, terrain.height(east_of[0].clip(0, terrain.width), north_of[0].clip(0, terrain.depth))
    )
    for build in (factored_cost, trilinear_cost):
        cost = build(terrain, target, (), nodes, 5)
        points = np.array([[0.1, 0.2, 900.0], [terrain.width, terrain.depth, 900.0], [x, y, target[2]]])
        assert np.isfinite(cost(points)).all()
        assert np.isfinite(cost.gradient(points)).all()
        assert cost(points)[2] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("north", [False, True])
def test_a_long_map_has_no_way_around_a_radar_that_sees_all_of_it(north: bool) -> None:
    plain = np.zeros((65, 21) if north else (21, 65))
    terrain = HeightField(plain, 320.0)
    ends = np.array([[1500.0, 3200.0, 300.0], [19_000.0, 3200.0, 300.0]])
    middle = np.array([10_200.0, 3200.0])
    if north:
        ends, middle = ends[:, [1, 0, 2]], middle[::-1]
    radar = Radar(*middle.tolist(), 7000.0, 20.0)
    grid = TerrainGrid.around(terrain, ends[1], 65, 9)
    density = threat_density(grid, terrain, (radar,))
    within = np.linalg.norm(grid.positions - radar.position(terrain), axis=-1) < radar.radius - 2.0 * grid.spacing
    assert (density[within] > 0.99 * radar.weight).all()
    i, j = ((ends[0, 1] - grid.y_0) / grid.spacing, (ends[0, 0] - grid.x_0) / grid.spacing)
    way = node_distance(grid, density)[0, round(i), round(j)]
    shadow = 2.0 * np.sqrt((radar.radius - 640.0) ** 2 - 3200.0**2)  # [m] the least way through its sight
    assert way > 17_000.0 + 0.9 * radar.weight * shadow


@pytest.mark.parametrize("east", [0.0, 0.015, 0.4, 0.999, 1.0])
def test_at_the_edge_of_a_square_map_a_radar_sees_the_last_nodes_too(east: float) -> None:
    terrain = HeightField(np.zeros((33, 33)), 320.0)
    target = np.array([east * terrain.width, 5000.0, 300.0])
    grid = TerrainGrid.around(terrain, target, 17, 5)
    density = threat_density(grid, terrain, (Radar(5000.0, 5000.0, 20_000.0, 1.0),))
    np.testing.assert_allclose(density, 1.0)


def test_a_map_and_its_transpose_have_the_same_cost() -> None:
    terrain = rolling(31, 80)
    turned = HeightField(terrain.z.T, SPACING)
    target = np.array([6100.0, 1700.0, 700.0])
    radar, turned_radar = Radar(4000.0, 1500.0, 1500.0, 5.0), Radar(1500.0, 4000.0, 1500.0, 5.0)
    points = np.random.default_rng(1).uniform([0.0, 0.0, 300.0], [terrain.width, terrain.depth, 1500.0], (200, 3))
    swap = [1, 0, 2]
    one = factored_cost(terrain, target, (radar,), 65, 9)(points)
    other = factored_cost(turned, target[swap], (turned_radar,), 65, 9)(points[:, swap])
    # The triangles' diagonals run the other way, which moves the ground between nodes and what a radar sees a little.
    assert np.abs(one / other - 1.0).max() < 0.1
    assert np.abs(one / other - 1.0).mean() < 0.01
