"""Multilevel splitting on distributions whose tails are known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from mathnavi.sim.search.rare import Splitting, _bound, mean_interval, split

Vector = np.ndarray
SIZE = 20
P = 1e-4
EVENT = float(norm.ppf(P))  # of the sum of SIZE normal numbers over sqrt(SIZE)


class Normals:
    """Independent normal numbers, of which the kernel draws a share again."""

    def draw(self, rng: np.random.Generator) -> Vector:
        return rng.standard_normal(SIZE)

    def propose(self, particle: Vector, rng: np.random.Generator) -> Vector:
        share = (0.5, 0.2, 0.1)[rng.integers(3)]
        return np.where(rng.random(SIZE) < share, rng.standard_normal(SIZE), particle)


def sums(particles: Sequence[Vector]) -> list[float]:
    return (np.sum(particles, axis=1) / math.sqrt(SIZE)).tolist()


def test_the_estimate_of_a_known_probability_of_1e_4_is_unbiased_and_its_interval_covers_it() -> None:
    runs, repetitions = 12, 5
    made = [
        [split(Normals(), sums, EVENT, np.random.default_rng([run, k])) for k in range(repetitions)]
        for run in range(runs)
    ]
    estimates = np.array([[each.estimate for each in row] for row in made], dtype=float)
    error = estimates.std(ddof=1) / math.sqrt(estimates.size)
    assert error < 0.2 * P  # or the next line says nothing
    assert abs(estimates.mean() - P) < 3.0 * error
    intervals = [mean_interval(row) for row in estimates.tolist()]
    covered = sum(each.low <= P <= each.high for each in intervals)
    assert covered >= runs - 2  # 95 % each: three misses or more have a probability of 2 %
    assert all(each.high / each.low < 30.0 for each in intervals)
    assert max(each.evaluations for row in made for each in row) < 0.5 / P  # one draw of each 1 / p is nothing to see


def test_probabilities_of_levels_on_the_way_are_those_of_the_distribution() -> None:
    made = [split(Normals(), sums, EVENT, np.random.default_rng(k), particles=100) for k in range(6)]
    for p in (0.1, 0.01):
        level = float(norm.ppf(p))
        found = [next(q for z, q in zip(each.levels, each.probabilities, strict=True) if z <= level) for each in made]
        assert p / 2.5 < np.mean(found) < p * 1.5  # of the first level beyond, so a little less


def test_the_same_generator_gives_the_same_splitting() -> None:
    one, other = (split(Normals(), sums, -2.0, np.random.default_rng(5)) for _ in range(2))
    assert (one.levels, one.estimate, one.evaluations) == (other.levels, other.estimate, other.evaluations)


def test_an_event_that_cannot_happen_ends_extinct_or_at_the_last_evaluation() -> None:
    flat = split(Normals(), lambda particles: [1.0] * len(particles), 0.0, np.random.default_rng(0))
    assert flat.estimate == 0.0
    deep = split(Normals(), sums, -1e9, np.random.default_rng(0), most=500)
    assert deep.estimate is None
    assert deep.evaluations <= 500
    assert deep.probabilities[-1] < 0.2


def test_an_event_that_always_happens_is_certain_without_a_transition() -> None:
    found = split(Normals(), sums, math.inf, np.random.default_rng(0), particles=10)
    assert (found.estimate, found.evaluations, found.levels) == (1.0, 10, ())


@pytest.mark.parametrize(("particles", "killed"), [(1, 0.25), (4, 1.0), (4, 0.0)])
def test_all_or_none_cannot_die(particles: int, killed: float) -> None:
    with pytest.raises(ValueError, match="at least one dies, and one is left"):
        split(Normals(), sums, 0.0, np.random.default_rng(0), particles=particles, killed=killed)


def test_an_interval_needs_two_estimates_and_says_nothing_of_zeros() -> None:
    with pytest.raises(ValueError, match="two or more"):
        mean_interval([0.1])
    nothing = mean_interval([0.0, 0.0, 0.0])
    assert (nothing.value, nothing.low, nothing.high) == (0.0, 0.0, 1.0)


def test_a_repetition_that_began_at_the_event_does_not_hide_how_far_the_others_came() -> None:
    """It has no levels, and another ran out of evaluations on its way."""
    began: Splitting[Any] = Splitting((), (), 0.5, 8, 0.0, ())
    stopped: Splitting[Any] = Splitting((3.0, 2.0), (0.5, 0.25), None, 80, 0.4, ())
    found = _bound((began, stopped), lambda level: level)
    assert (found.level, found.reached) == (2.0, False)
    assert 0.25 <= found.probability.value <= 1.0
