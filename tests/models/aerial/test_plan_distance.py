"""The least distance of two plans is that of dense samples, never above it, and exact where it is known by hand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.interfaces.signals import Plan, Status
from mathnavi.models.aerial.plan_distance import PlannedTrajectory, _least_squared, clear, clear_of_each, least_distance
from tests.controllers.arrival.flights import arcs, hover, sampled_distances, straight

SEEDS = st.integers(0, 2**32 - 1)


def random_plan(rng: np.random.Generator, scale: float) -> Plan:
    """Zero to five arcs, some of the same length in every plan, some without acceleration, some along one axis."""
    count = int(rng.integers(0, 6))
    durations = rng.choice([0.5, 1.0, rng.uniform(0.01, 3.0)], count)
    u = (
        scale
        * rng.normal(size=(count, 3))
        * rng.choice([0.0, 1.0], (count, 1))
        * rng.choice([0.0, 1.0], 3, p=[0.2, 0.8])
    )
    return arcs(
        scale * rng.normal(size=6) * rng.choice([0.0, 1.0], 6, p=[0.2, 0.8]), u, durations, rng.choice([0.0, 0.7])
    )


@settings(max_examples=150)
@given(SEEDS, st.sampled_from([1e-2, 1.0, 1e4]), st.floats(-1.0, 5.0))
def test_it_is_never_above_sampling_and_below_by_no_more_than_the_motion_in_between(
    seed: int, scale: float, t: float
) -> None:
    rng = np.random.default_rng(seed)
    a, b = random_plan(rng, scale), random_plan(rng, scale)
    least = least_distance(a, b, t)
    times, distances = sampled_distances(a, b, t, 2000)
    sampled = float(distances.min())
    speed = PlannedTrajectory.from_plan(a).speed + PlannedTrajectory.from_plan(b).speed
    assert least <= sampled * (1.0 + 1e-6) + 1e-12 * scale
    # A jump into rest at the end, which these plans make, is not in position.
    assert least >= sampled - 0.5 * speed * float(np.diff(times).max(initial=0.0)) - 1e-9 * scale
    assert least == pytest.approx(least_distance(b, a, t), rel=1e-9, abs=1e-9 * scale)


@settings(max_examples=100)
@given(SEEDS, st.floats(0.0, 3.0))
def test_clear_is_at_least_so_far_apart(seed: int, factor: float) -> None:
    rng = np.random.default_rng(seed)
    a, b = random_plan(rng, 1.0), random_plan(rng, 1.0)
    least = least_distance(a, b, 0.0)
    distance = factor * least
    assert clear(a, b, distance, 0.0) == (least >= distance) or abs(factor - 1.0) < 1e-9
    apart = dataclasses.replace(b, x=b.x + np.array([500.0, 0.0, 0.0, 0.0, 0.0, 0.0]))  # boxes decide
    assert clear(a, apart, 200.0, 0.0) == (least_distance(a, apart, 0.0) >= 200.0)


@settings(max_examples=100)
@given(SEEDS, st.integers(0, 12), st.sampled_from([1e-2, 1.0, 1e4]))
def test_boxes_decide_for_many_plans_as_the_exact_distance_does_for_each(seed: int, count: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    plan = PlannedTrajectory.from_plan(random_plan(rng, scale))
    others = [PlannedTrajectory.from_plan(moved(random_plan(rng, scale), rng, 5.0 * scale)) for _ in range(count)]
    times = rng.uniform(-1.0, 5.0, count)
    least = [math.sqrt(_squared(plan, other, t, math.inf)) for other, t in zip(others, times, strict=True)]
    distances = np.array([rng.choice([0.0, 0.5, 1.0 - 1e-12, 1.0, 1.0 + 1e-12, 2.0]) * each for each in least])
    caps = distances * distances
    exact = [_squared(plan, other, t, cap) >= cap for other, t, cap in zip(others, times, caps, strict=True)]
    assert clear_of_each(plan, others, distances, times) == exact


def moved(plan: Plan, rng: np.random.Generator, far: float) -> Plan:
    return dataclasses.replace(plan, x=plan.x + np.array([*rng.normal(0.0, far, 3), 0.0, 0.0, 0.0]))


def _squared(a: PlannedTrajectory, b: PlannedTrajectory, t: float, cap: float) -> float:
    found = _least_squared(a.t, a.x, a.u, b.t, b.x, b.u, float(t), float(cap))
    assert found == _least_squared(b.t, b.x, b.u, a.t, a.x, a.u, float(t), float(cap))  # bit for bit
    return float(found)


def test_a_distance_that_is_just_kept_is_clear() -> None:
    for distance in (0.1, 0.3, 7.7, 123.456):
        assert clear(hover(np.zeros(3)), hover(np.array([distance, 0.0, 0.0])), distance, 0.0)
        assert not clear(hover(np.zeros(3)), hover(np.array([distance, 0.0, 0.0])), distance * (1 + 1e-12), 0.0)


def test_head_on_they_meet_and_beside_each_other_pass() -> None:
    a = straight((0.0, 0.0, 0.0), (150.0, 0.0, 0.0), 100.0)
    assert least_distance(a, straight((9e3, 0.0, 0.0), (-100.0, 0.0, 0.0), 80.0), 0.0) < 1e-9
    assert least_distance(a, straight((9e3, 40.0, 9.0), (-100.0, 0.0, 0.0), 80.0), 0.0) == pytest.approx(
        41.0, rel=1e-12
    )
    after = straight((9e3, 0.0, 0.0), (-100.0, 0.0, 0.0), 80.0)  # they have met at 36 s
    assert least_distance(a, after, 40.0) == pytest.approx(4.0 * 250.0, rel=1e-12)


def test_parallel_ones_keep_their_distance_whatever_both_do() -> None:
    u, h = np.array([[3.0, 1.0, -2.0], [-3.0, 0.0, 2.0]]), np.array([4.0, 7.0])
    a, b = arcs(np.array([0.0, 0.0, 0.0, 9.0, 1.0, 0.0]), u, h), arcs(np.array([3.0, 4.0, 12.0, 9.0, 1.0, 0.0]), u, h)
    assert least_distance(a, b, 0.0) == pytest.approx(13.0, rel=1e-12)
    assert clear(a, b, 12.999999, 0.0)
    assert not clear(a, b, 13.000001, 0.0)


def test_one_that_has_ended_stays_where_it_rests_and_is_met_there() -> None:
    short = straight((0.0, 0.0, 0.0), (10.0, 0.0, 0.0), 2.0)  # rests at x = 20 from 2 s on
    late = straight((20.0, 100.0, 0.0), (0.0, -5.0, 0.0), 30.0)  # there at 20 s
    assert least_distance(short, late, 0.0) < 1e-9
    assert least_distance(short, late, 22.0) == pytest.approx(10.0)
    assert least_distance(short, late, 1000.0) == pytest.approx(50.0)  # both rest for ever


def test_before_its_start_a_plan_stands_where_it_begins_unless_the_distance_is_taken_from_then_on() -> None:
    waits = straight((0.0, 0.0, 0.0), (0.0, 50.0, 0.0), 10.0, t=20.0)
    passes = straight((-100.0, 0.0, 0.0), (10.0, 0.0, 0.0), 100.0)  # at the origin at 10 s
    assert least_distance(waits, passes, 0.0) < 1e-9
    assert least_distance(waits, passes, 20.0) == pytest.approx(100.0)


@pytest.mark.parametrize("gap", [0.0, 1e-16, 1e-12, 1e-8, 1e-4, 1e-2])
def test_nearly_double_roots_are_found(gap: float) -> None:
    # y = ((s - 1/2)^2 - gap) vanishes at 1/2 -+ sqrt(gap), between which |y| rises to gap.
    start = np.array([0.0, 0.25 - gap, 0.0, 0.0, -1.0, 0.0])
    moving = arcs(start, np.array([[0.0, 2.0, 0.0]]), np.array([1.0]))
    assert least_distance(moving, hover(np.zeros(3)), 0.0) < 1e-9
    assert least_distance(moving, hover(np.array([2.0, 0.0, 0.0])), 0.0) == pytest.approx(2.0, rel=1e-12)


def test_a_manoeuvre_nearest_in_the_middle_of_an_arc_is_found() -> None:
    thrown = arcs(np.array([0.0, 0.0, 0.0, 10.0, 0.0, 10.0]), np.array([[0.0, 0.0, -10.0]]), np.array([2.0]))
    assert least_distance(thrown, hover(np.array([10.0, 0.0, 8.0])), 0.0) == pytest.approx(3.0, rel=1e-12)


def test_what_is_no_plan_is_refused_by_name() -> None:
    good = straight((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 1.0)
    for bad, said in (
        (Plan.failure(Status.LATE), "status = LATE; allowed: OK"),
        (dataclasses.replace(good, u=np.zeros((2, 3))), "allowed: .K . 1,."),
        (dataclasses.replace(good, x=good.x * np.nan), "not finite"),
        (dataclasses.replace(good, t=np.zeros(2)), "does not increase"),
    ):
        with pytest.raises(ValueError, match=said):
            least_distance(good, bad, 0.0)
    with pytest.raises(ValueError, match=r"t = nan; allowed"):
        least_distance(good, good, np.nan)
    with pytest.raises(ValueError, match=r"distance = -1.0; allowed"):
        clear(good, good, -1.0, 0.0)


def test_a_trajectory_is_its_own() -> None:
    plan = straight((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 1.0)
    held = PlannedTrajectory.from_plan(plan)
    plan.x[:] = 7.0
    assert held.x[0, 3] == 1.0
    assert not held.x.flags.writeable
