"""The planner with valid and with invalid estimates."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.controllers.active_sensing.belief import Belief, BeliefFromEstimates
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest, Status
from tests.controllers.active_sensing.robots import START, assert_well_formed, built, mission, winding_path


def asked(covariance: Array | None, x: Array = START, status: Status = Status.OK, **fields: object) -> Plan:
    planner, _ = built(mission(), **fields)
    return planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, x, covariance, status), None))


def believed(covariance: Array | None, deviation: float) -> Belief:
    """Belief of a first estimate."""
    return BeliefFromEstimates(deviation, 1.0).update(PlanRequest(0.0, 0.0, Estimate(0.0, START, covariance), None))


@pytest.mark.parametrize(
    "covariance",
    [
        np.full((3, 3), math.nan),
        np.zeros((3, 3)),
        np.diag([1.0, -1.0, 0.1]),
        np.diag([1e300, 1e300, 1e300]),
        np.eye(2),
        np.array([[1.0, 5.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    ],
    ids=["NaN", "nought", "negative", "huge", "of another shape", "asymmetric"],
)
@pytest.mark.parametrize("mode", ["active", "singular-value", "random"])
def test_whatever_the_covariance_the_plan_is_well_formed(mode: str, covariance: Array) -> None:
    plan = asked(covariance, mode=mode)
    assert plan.ok
    assert_well_formed(plan, mission())


def test_an_estimate_that_is_not_finite_is_a_failure_and_no_exception() -> None:
    plan = asked(None, np.array([0.0, math.nan, 0.0]))
    assert plan.status is Status.NOT_FINITE
    assert "nan" in plan.message


@pytest.mark.parametrize("covariance", [None, np.full((3, 3), math.inf), np.eye(4)])
def test_without_a_covariance_the_stated_one_is_taken(covariance: Array | None) -> None:
    np.testing.assert_allclose(believed(covariance, 0.2).covariance, 0.04 * np.eye(3))


def test_a_covariance_that_is_one_is_taken_as_it_is() -> None:
    root = np.random.default_rng(0).standard_normal((3, 3))
    P = root @ root.T
    np.testing.assert_allclose(believed(P, 0.2).covariance, P, rtol=1e-9)


def test_deviations_are_those_of_the_worst_direction() -> None:
    c, s = math.cos(0.7), math.sin(0.7)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    belief = Belief(START, turn @ np.diag([0.09, 0.01, 0.04]) @ turn.T)
    assert belief.position_deviation == pytest.approx(0.3)
    assert belief.heading_deviation == pytest.approx(0.2)


def test_what_is_predicted_is_where_samples_of_the_belief_go() -> None:
    rng, task = np.random.default_rng(1), mission()
    plan, P = winding_path(task), np.diag([1e-4, 4e-4, 2.5e-4])
    end = Belief(START, P).predicted(plan, 0.5, 2.5)
    samples = []
    for x in rng.multivariate_normal(START, P, 2000):
        for k, u in enumerate(plan.u):
            held = min(2.5, float(plan.t[k + 1])) - max(0.5, float(plan.t[k]))
            x = task.flow(x, u, held) if held > 0.0 else x
        samples.append(x)
    np.testing.assert_allclose(np.mean(samples, axis=0), end.pose, atol=2e-3)
    np.testing.assert_allclose(np.cov(np.array(samples).T), end.covariance, atol=4e-5)


def test_a_plan_rests_within_the_wall_at_its_end() -> None:
    task = mission()
    for seed in range(20):
        x = task.curve.draw(np.random.default_rng(seed), task.margin)
        plan = asked(0.01 * np.eye(3), x)
        assert plan.t_end <= 1.0 + 1e-9
        assert task.curve.contains(plan.x[-1], task.margin - 0.01)
