"""Estimates that agree with what was driven are believed, those that contradict one another are not."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.controllers.active_sensing.belief import BeliefFromEstimates, Disagreement, pose_on
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest
from tests.controllers.active_sensing.robots import FIELD, START, built, fly, mission, winding_path

SURE = np.full(2, 0.01)
OFFSET = np.array([0.3, -0.4, 0.7])  # .5 m and .7 rad


def path() -> Plan:
    return winding_path(mission())


def at(t: float) -> Array:
    return pose_on(path(), t)


def test_poses_along_what_is_driven_agree() -> None:
    disagreement = Disagreement(1.0)
    for t in np.arange(0.0, 3.0, 0.2):
        assert disagreement.update(float(t), at(t), np.zeros(2), path()) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_a_jump_is_as_large_as_it_is_and_is_forgotten_after_the_span() -> None:
    disagreement = Disagreement(1.0)
    for t in np.arange(0.0, 4.0, 0.25):
        jumped = t >= 1.5
        found = disagreement.update(float(t), at(t) + (np.array([0.3, -0.4, 0.0]) if jumped else 0.0), SURE, path())
        assert found == pytest.approx((0.5 if 1.5 <= t < 2.5 else 0.0, 0.0), abs=1e-9)


def test_what_an_estimate_said_that_it_may_be_off_by_is_no_disagreement() -> None:
    for deviation, expected in ((0.2, (0.0, 0.7)), (0.3, (0.0, 0.0)), (0.1, (0.5, 0.7))):
        disagreement = Disagreement(1.0)
        disagreement.update(0.0, at(0.0), np.full(2, deviation), path())
        assert disagreement.update(0.2, at(0.2) + OFFSET, SURE, path()) == pytest.approx(expected, abs=1e-9)


def test_headings_are_compared_the_short_way_round() -> None:
    disagreement = Disagreement(1.0)
    disagreement.update(0.0, at(0.0), np.zeros(2), path())
    turned = disagreement.update(0.2, at(0.2) + np.array([0.0, 0.0, 4.0 * math.pi + 0.1]), np.zeros(2), path())
    assert turned == pytest.approx((0.0, 0.1), abs=1e-9)


def test_before_the_first_plan_nothing_is_known_of_what_was_driven() -> None:
    disagreement = Disagreement(1.0)
    disagreement.update(0.0, at(0.0), np.zeros(2), None)
    assert disagreement.update(0.2, at(0.2) + OFFSET, np.zeros(2), path()) == (0.0, 0.0)


@pytest.mark.parametrize("covariance", [None, 1e-4 * np.eye(3)], ids=["none", "too small"])
def test_who_contradicts_himself_is_believed_less(covariance: Array | None) -> None:
    believing = BeliefFromEstimates(0.1, 1.0)
    first, second = (
        believing.update(PlanRequest(t, t + 0.2, Estimate(t, at(t) + error, covariance), path()))
        for t, error in ((0.0, np.zeros(3)), (0.2, OFFSET))
    )
    assert first.position_deviation <= 0.1 + 1e-12
    assert second.position_deviation >= 0.5
    assert second.heading_deviation >= 0.7
    np.testing.assert_array_equal(second.pose, at(0.2) + OFFSET)


@pytest.mark.parametrize("covariance", [None, 1e-4 * np.eye(3)], ids=["none", "too small"])
@pytest.mark.parametrize("mode", ["active", "singular-value", "random"])
@pytest.mark.parametrize("seed", range(2))
def test_estimates_that_wander_do_not_lead_to_the_wall(mode: str, covariance: Array | None, seed: int) -> None:
    """As those of an observer on its way do: somewhere within the wall, somewhere else a second later, and not sure."""
    task, rng = mission(), np.random.default_rng(seed)
    start = task.curve.draw(rng, task.margin)
    wandering = [task.curve.draw(rng, 0.1) for _ in range(8)]

    def believing(t: float, truth: Array) -> Estimate:
        k, share = int(t), t % 1.0
        return Estimate(t, (1.0 - share) * wandering[k] + share * wandering[k + 1], covariance)

    flight = fly(built(task, mode=mode, seed=1 + seed), task, start, 6.0, believing)
    assert flight.clearance(FIELD) > 0.16


def test_a_wandering_estimate_near_the_wall_leads_no_way_back() -> None:
    """The robot turns on the spot, as it cannot know where the wall is."""
    task = mission()

    def believing(t: float, truth: Array) -> Estimate:
        return Estimate(t, np.array([3.7 * math.cos(3.0 * t), 1.39 * math.sin(3.0 * t), 0.0]), 1e-4 * np.eye(3))

    flight = fly(built(task, mode="active"), task, START, 3.0, believing)
    driven = np.array(flight.truth)[50:, :2]
    np.testing.assert_allclose(driven, np.broadcast_to(driven[0], driven.shape), atol=1e-12)
    assert flight.kinds[-1] == "blind"
