"""Directed search and rare events, over trials in a store."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from scipy.stats import norm

from mathnavi.sim.records.store import Store
from mathnavi.sim.search.directed import directed
from mathnavi.sim.search.evaluation import Evaluation, Evaluator, NoSuchFigureError, Objective
from mathnavi.sim.search.importance import importances
from mathnavi.sim.search.rare import rare_event
from mathnavi.sim.search.samplers import SamplerName
from mathnavi.sim.search.space import Choice, Dimension, Range, Values
from mathnavi.sim.sweep.execution import Pool
from mathnavi.sim.sweep.trial import Trial, trial

BOWL = "tests.sim.search.scenarios:Bowl"
SPACE = (Range("x", -4.0, 4.0), Range("y", -4.0, 4.0))


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    with Pool(2) as made:
        yield made


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store.open(tmp_path / "store.db") as made:
        yield made


def evaluator(store: Store, pool: Pool, key: str = "height_m", largest: bool = False, **fields: Any) -> Evaluator:
    def make(values: Values) -> Trial:
        return trial(BOWL, fields={**fields, **values})

    return Evaluator(make, Objective(key, largest), store, pool)


def values_of(evaluations: Sequence[Evaluation]) -> list[Any]:
    return [(each.number, dict(each.values), each.figure, each.ending) for each in evaluations]


@pytest.mark.parametrize("sampler", ["sobol-cmaes", "cmaes", "random"])
def test_the_same_seed_makes_the_same_search_and_flies_nothing_twice(
    store: Store, pool: Pool, sampler: SamplerName
) -> None:
    first = directed(evaluator(store, pool), SPACE, 24, sampler=sampler, seed=3)
    known = store.keys()
    with Pool(1) as one:
        again = directed(evaluator(store, one), SPACE, 24, sampler=sampler, seed=3)
    assert values_of(first) == values_of(again)
    assert store.keys() == known
    assert values_of(directed(evaluator(store, pool), SPACE, 8, sampler=sampler, seed=4)) != values_of(first[:8])


def test_a_search_ends_with_the_batch_in_which_it_has_found_what_it_looks_for(store: Store, pool: Pool) -> None:
    found = directed(evaluator(store, pool), SPACE, 400, seed=1, batch=4, until=2.0)
    assert len(found) < 400
    assert min(each.figure for each in found[-4:] if each.figure is not None) <= 2.0
    assert all(each.figure is None or each.figure > 2.0 for each in found[:-4])


def test_the_largest_figure_is_looked_for_at_the_other_end(store: Store, pool: Pool) -> None:
    made = evaluator(store, pool, largest=True)
    found = directed(made, SPACE, 40, seed=1, until=50.0)
    best = made.objective.best(found)[0]
    assert best.figure == max(each.figure for each in found if each.figure is not None)
    assert best.figure > 45.0


def test_what_is_refused_and_what_fails_is_counted_and_recorded(store: Store, pool: Pool) -> None:
    made = evaluator(store, pool, edge=3.0, rim=2.0, fire=2.0, hole=4.0)
    points = [{"x": 3.5}, {"x": 2.5}, {"y": 4.0}, {"y": 3.0}, {"x": -4.0}, {"x": 1.0, "y": -2.0}]
    endings = ["refused", "refused", "refused", "failed", "failed", "flown"]
    assert [each.ending for each in made.evaluate(points)] == endings
    configured, rim, hole, fire, defect, flown = made.evaluations
    assert configured.reason == "x = 3.5; allowed: < 3.0"
    assert configured.record is None
    assert rim.reason == "x = 2.5 is beyond the rim; allowed: < 2.0"
    assert rim.record is not None
    assert rim.record.status == "raised"
    assert hole.reason == "y = 4.0 is in the hole; allowed: < 4.0"
    assert fire.reason.startswith("crashed: ")
    assert "a run failed: ValueError: a defect in flight (" in defect.reason
    assert flown.figure == 0.0
    assert len(store.keys()) == 5
    assert [made.count("refused"), made.count("failed"), made.count("flown")] == [3, 2, 1]


def test_a_search_goes_on_beside_missions_that_are_refused_and_that_fail(store: Store, pool: Pool) -> None:
    made = evaluator(store, pool, rim=2.0, fire=3.0)
    found = directed(made, SPACE, 40, seed=2)
    assert {each.ending for each in found} == {"flown", "refused", "failed"}
    assert len(found) == 40
    best = made.objective.best(found)
    assert len(best) == made.count("flown")
    assert best[0].figure is not None
    assert best[0].figure < 1.0


def test_a_search_chooses_among_listed_values_and_whole_numbers(store: Store, pool: Pool) -> None:
    space: tuple[Dimension, ...] = (Choice("colour", ("red", "blue")), Range("times", 1, 3), *SPACE)
    found = directed(evaluator(store, pool), space, 40, seed=1)
    assert {each.values["colour"] for each in found} == {"red", "blue"}
    assert {each.values["times"] for each in found} == {1, 2, 3}
    weight = importances(found, space)
    assert weight.keys() == {"colour", "times", "x", "y"}
    assert list(weight.values()) == sorted(weight.values(), reverse=True)
    assert weight["x"] + weight["y"] > weight["times"]


def test_nothing_is_said_of_importance_after_a_few_missions(store: Store, pool: Pool) -> None:
    assert importances(directed(evaluator(store, pool), SPACE, 8), SPACE) == {}


def test_an_infinite_figure_is_the_most_extreme_one(store: Store, pool: Pool) -> None:
    found = directed(evaluator(store, pool, key="lost"), SPACE, 3)
    assert [each.figure for each in found] == [-math.inf] * 3


def test_a_figure_that_is_no_number_is_a_failed_evaluation(store: Store, pool: Pool) -> None:
    (found,) = evaluator(store, pool, key="nothing").evaluate([{}])
    assert (found.ending, found.reason) == ("failed", "its nothing is None")


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("depth_m", "depth_m is not a figure of .*Bowl; allowed: height_m, lost, noise"),
        ("solve_ms_mean", "solve_ms_mean is a wall-clock time"),
    ],
)
def test_a_figure_that_there_is_not_is_named_with_those_that_there_are(
    store: Store, pool: Pool, key: str, message: str
) -> None:
    with pytest.raises(NoSuchFigureError, match=message):
        evaluator(store, pool, key=key).evaluate([{}])


def test_a_space_without_a_field_is_refused(store: Store, pool: Pool) -> None:
    with pytest.raises(ValueError, match="at least one field"):
        directed(evaluator(store, pool), (), 4)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.999999])
def test_values_at_shares_of_a_range_lie_within_it(share: float) -> None:
    assert Range("a", 2.0, 8.0).at(share) == pytest.approx(2.0 + 6.0 * share)
    assert Range("a", 2.0, 8.0, log=True).at(share) == pytest.approx(2.0 * 4.0**share)
    assert Range("a", 2, 4).at(share) in (2, 3, 4)
    assert Choice("a", ("x", "y")).at(share) == ("x" if share < 0.5 else "y")


@pytest.mark.parametrize("wrong", [(2.0, 1.0, False), (0.0, 1.0, True), (0.0, math.inf, False)])
def test_a_range_has_finite_ends_in_order(wrong: tuple[float, float, bool]) -> None:
    with pytest.raises(ValueError, match=r"a = .*; allowed"):
        Range("a", *wrong)


def test_the_probability_of_a_rare_draw_of_a_scenario_is_found_from_its_streams(store: Store, pool: Pool) -> None:
    p = 0.02
    made = evaluator(store, pool, key="noise", largest=True, times=8)
    found = rare_event(made, (), float(norm.isf(p)), 1200, seed=2, particles=12, repetitions=3)
    assert found.reached
    assert found.probability.low <= p <= found.probability.high
    extreme = made.objective.best(made.evaluations)[0]
    assert extreme.trial is not None
    assert extreme.record is not None
    assert extreme.trial.run()[0]["noise"] == extreme.record.summary["noise"] == extreme.figure
    one = made.evaluations[0].values["redraw"]
    assert len(one) == 1
    assert one[0][1] == 1.0


def test_an_event_out_of_reach_is_bounded_at_the_nearest_level_that_was_reached(store: Store, pool: Pool) -> None:
    made = evaluator(store, pool, key="noise", largest=True)
    found = rare_event(made, (), 50.0, 100, particles=8, repetitions=2)
    assert not found.reached
    assert 0.5 < found.level < 5.0
    assert 0.0 < found.probability.value < 0.7
    assert len(made.evaluations) <= 100


def test_a_rare_event_over_a_field_draws_the_field_too(store: Store, pool: Pool) -> None:
    made = evaluator(store, pool, rim=3.9)
    found = rare_event(made, (Range("x", -4.0, 4.0),), 4.25, 300, seed=1, particles=10, repetitions=3)  # |x - 1| < .5
    p = 1.0 / 8.0
    assert found.reached
    assert found.probability.low <= p <= found.probability.high
    assert {each.ending for each in made.evaluations} == {"flown", "refused"}


def test_too_few_missions_for_the_particles_of_all_repetitions_are_refused(store: Store, pool: Pool) -> None:
    with pytest.raises(ValueError, match="missions = 10; allowed: >= 20"):
        rare_event(evaluator(store, pool), (), 0.0, 10, particles=10, repetitions=2)
