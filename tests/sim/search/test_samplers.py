"""Samplers on functions, and the importances of their arguments."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import get_args

import numpy as np
import pytest

from mathnavi.interfaces.bounds import LARGEST_SEED
from mathnavi.sim.search.evaluation import Evaluation
from mathnavi.sim.search.importance import importances
from mathnavi.sim.search.samplers import SamplerName, Shares, make_sampler
from mathnavi.sim.search.space import Choice, Dimension, Range, drawn

SAMPLERS: tuple[SamplerName, ...] = get_args(SamplerName)
LEARNING = [name for name in SAMPLERS if name != "random"]


def searched(
    name: SamplerName, cost: Callable[[Shares], float | None], points: int, size: int = 3, seed: int = 1, batch: int = 8
) -> list[Shares]:
    """Return the points that a sampler has asked for."""
    sampler = make_sampler(name, size, seed)
    asked: list[Shares] = []
    while len(asked) < points:
        asked += (now := [sampler.ask() for _ in range(batch)])
        for point in now:
            sampler.tell(point, cost(point))
    return asked


def distance(point: Shares) -> float:
    return math.dist(point, [0.9] * len(point))


@pytest.mark.parametrize("name", SAMPLERS)
@pytest.mark.parametrize("size", [1, 2, 12])
@pytest.mark.parametrize("batch", [1, 40])
def test_every_point_lies_in_the_cube_and_follows_from_the_seed(name: SamplerName, size: int, batch: int) -> None:
    def search(seed: int) -> list[Shares]:
        return searched(name, lambda point: -sum(point), 160, size, seed, batch)  # least in a corner

    points = search(LARGEST_SEED)
    assert all(len(point) == size and 0.0 <= min(point) <= max(point) < 1.0 for point in points)
    assert search(LARGEST_SEED) == points
    assert search(7)[0] != points[0]


@pytest.mark.parametrize("name", LEARNING)
@pytest.mark.parametrize("scale", [1.0, 1e300, 1e-300])
def test_only_the_order_of_the_costs_counts(name: SamplerName, scale: float) -> None:
    points = searched(name, lambda point: scale * distance(point), 400, size=6)
    assert points == searched(name, distance, 400, size=6)
    assert min(map(distance, points)) < 0.1 < min(map(distance, searched("random", distance, 400, size=6)))


@pytest.mark.parametrize("name", LEARNING)
@pytest.mark.parametrize("lowest", [(0.6, 0.25), (0.1, 0.9, 0.5, 0.3)])
def test_the_median_search_comes_twice_as_near_as_random_draws(name: SamplerName, lowest: Shares) -> None:
    def nearest(by: SamplerName) -> float:
        size = len(lowest)
        lots = [searched(by, lambda point: math.dist(point, lowest) ** 2, 96, size, seed) for seed in range(16)]
        return float(np.median([min(math.dist(point, lowest) for point in lot) for lot in lots]))

    assert nearest(name) < 0.5 * nearest("random")


@pytest.mark.parametrize("name", LEARNING)
def test_a_minimum_in_a_corner_is_found(name: SamplerName) -> None:
    assert min(map(sum, searched(name, sum, 300, size=6))) < 0.01


@pytest.mark.parametrize("name", LEARNING)
@pytest.mark.parametrize("unknown", [None, math.inf])
def test_a_minimum_beside_points_without_a_cost_is_found(name: SamplerName, unknown: float | None) -> None:
    def cost(point: Shares) -> float | None:
        return unknown if point[0] > 0.92 else distance(point)

    assert min(distance(point) for point in searched(name, cost, 300) if point[0] <= 0.92) < 0.02


@pytest.mark.parametrize("name", SAMPLERS)
@pytest.mark.parametrize("cost", [None, math.inf, -math.inf, 0.0])
def test_a_search_without_a_slope_goes_on_all_over_the_cube(name: SamplerName, cost: float | None) -> None:
    points = np.array(searched(name, lambda _: cost, 400))
    assert np.all(np.ptp(points[200:], axis=0) > 0.5)


@pytest.mark.parametrize("name", LEARNING)
def test_a_search_that_has_converged_begins_elsewhere(name: SamplerName) -> None:
    """And so finds a second minimum, which is lower and narrower."""

    def two(point: Shares) -> float:
        return min(math.dist(point, (0.25, 0.25)), 4.0 * math.dist(point, (0.9, 0.9)) - 0.5)

    assert min(map(two, searched(name, two, 2400, size=2))) < -0.4


def test_the_first_points_of_sobol_cover_every_range_evenly() -> None:
    points = np.array(searched("sobol-cmaes", distance, 16, size=5))
    for parts in (2, 4, 8, 16):
        for column in points.T:
            assert np.bincount((column * parts).astype(int), minlength=parts).tolist() == [16 // parts] * parts


SPACE: tuple[Dimension, ...] = (
    Range("x", -1.0, 1.0), Range("size", 1e-3, 1e3, log=True), Range("count", 0, 100), Choice("on", (True, False)),
)  # fmt: skip


def flown(figure: Callable[..., float | None], missions: int = 400) -> list[Evaluation]:
    points = np.random.default_rng(3).random((missions, len(SPACE)))
    made = [drawn(SPACE, point) for point in points.tolist()]
    return [Evaluation(k, values, "flown", figure(**values)) for k, values in enumerate(made)]


@pytest.mark.parametrize("name", [each.name for each in SPACE])
def test_the_field_that_decides_has_nearly_all_the_importance(name: str) -> None:
    """However the figure depends on it, and beside missions of infinite figure and without one."""

    def figure(**values: float) -> float | None:
        value = values[name]
        middle = {"x": 0.0, "size": 1.0, "count": 50, "on": True}[name]
        return None if values["count"] % 7 == 3 else math.inf if value == middle else abs(value - middle)

    found = importances(flown(figure), SPACE)
    assert next(iter(found)) == name
    assert found[name] > 0.9
    assert sum(found.values()) == pytest.approx(1.0)
    assert found.keys() == {each.name for each in SPACE}


def test_fields_have_the_importance_of_their_share_of_the_variance() -> None:
    """Ranks of a sum of uniform numbers are nearly the sum: 9 to 1."""
    found = importances(flown(lambda x, count, **_: 3.0 * x + count / 50.0, 4000), SPACE)
    assert found["x"] == pytest.approx(0.9, abs=0.03)
    assert found["count"] == pytest.approx(0.1, abs=0.03)


def test_nothing_is_said_of_fields_without_influence() -> None:
    assert importances(flown(lambda **_: 1.0), SPACE) == {}
    assert importances(flown(lambda x, **_: x, 19), SPACE) == {}
