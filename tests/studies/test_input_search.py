"""The exhaustive search over inputs finds the best of all sequences, and no policy is sooner."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from mathnavi.controllers.active_sensing.candidate_search import candidates
from mathnavi.controllers.active_sensing.kernels import PredictionHorizon, expected_covariance, inverse
from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import RangeQuality
from mathnavi.studies.ranging.active_control import start
from mathnavi.studies.ranging.input_search import (
    NODE,
    SLOW,
    WALL,
    InputSearch,
    KnownPoseProblem,
    advance,
    known_pose_problem,
    soonest,
    soonest_nodes,
)

MISSION = RangingMission(WALL, (math.radians(-60.0), math.radians(60.0)), RangeQuality(0.05), turn_rate_max=SLOW)
POSE, P = np.array([1.0, -0.4, 2.0]), 0.09 * np.eye(3)


def one_by_one(problem: KnownPoseProblem, inputs: Array, piece: int, depth: int) -> int:
    """The same as ``soonest_nodes``, every sequence to its end."""
    best = problem.most
    for sequence in itertools.product(inputs, repeat=depth):
        x, F, information = POSE, np.eye(3), inverse(P)
        for j in range(problem.most):
            x, F, information, error = advance(problem, x, F, information, sequence[min(j // piece, depth - 1)])
            if error < problem.limit:
                best = min(best, j + 1)
                break
    return best


def test_the_bound_is_the_covariance_that_the_planner_expects() -> None:
    problem, u = known_pose_problem(MISSION, 0.1, 1.0), np.array([0.5, 0.1])
    x, F, information = POSE, np.eye(3), inverse(P)
    for _ in range(10):
        x, F, information, error = advance(problem, x, F, information, u)
    horizon = PredictionHorizon(NODE, 10, problem.readings)
    pose, expected = expected_covariance(problem.wall, problem.sensors, horizon, POSE, P, u, 10, np.empty((0, 8)))
    assert x == pytest.approx(pose)
    assert error == pytest.approx(math.sqrt(expected[0, 0] + expected[1, 1]))


@pytest.mark.parametrize("limit", [0.2, 0.12, 0.07])
def test_no_sequence_is_sooner_than_the_best_that_is_found(limit: float) -> None:
    problem = known_pose_problem(MISSION, limit, 1.0)
    inputs = candidates(MISSION)[::6]
    found = [soonest_nodes(problem, POSE, P, inputs, 4, depth) for depth in (1, 2, 3)]
    assert found == [one_by_one(problem, inputs, 4, depth) for depth in (1, 2, 3)]
    assert found == sorted(found, reverse=True)


def test_a_robot_at_the_margin_rests() -> None:
    problem = known_pose_problem(MISSION, 0.1, 1.0)._replace(margin=10.0)
    x, F, _, _ = advance(problem, POSE, np.eye(3), inverse(P), np.array([1.0, 0.1]))
    assert (x == POSE).all()
    assert (np.eye(3) == F).all()


def test_no_policy_is_sooner_than_the_best_inputs_and_a_lower_limit_takes_longer() -> None:
    near, far = (soonest(InputSearch(3, start(SLOW, 20.0, 3), limit, 20.0, 2)) for limit in (0.1, 0.2))
    for times in (near, far):
        assert 0.0 < times["best"] <= min(times["active"], times["random"]) < 20.0
    assert far["best"] < near["best"]
