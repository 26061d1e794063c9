"""Modes that evaluate candidate inputs: what they choose, and that they stay within the wall."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.controllers.active_sensing.belief import Belief, BeliefFromEstimates
from mathnavi.controllers.active_sensing.candidate_search import Containment, ExpectedCovariance, candidates
from mathnavi.interfaces.signals import Array, Estimate, PlanRequest, Status
from mathnavi.models.field.curve import BEAN, EGG, Curve
from mathnavi.models.unicycle.beacons import BeaconFieldMission, BeaconMission, BeaconQuality
from mathnavi.models.unicycle.mission import DrivePhase
from tests.controllers.active_sensing.robots import FIELD, START, TWO, assert_well_formed, built, fly, knowing, mission

MODES = ("active", "singular-value", "random")
CURVES = (FIELD, EGG, BEAN)


def unsure(pose: Array, along: float, size: float = 0.3, rest: float = 0.01) -> Belief:
    """A belief that knows little of one direction [rad] and of nothing else."""
    w = np.array([math.cos(along), math.sin(along), 0.0])
    return Belief(pose, rest**2 * np.eye(3) + size**2 * np.outer(w, w))


def test_candidates_are_symmetric_and_within_the_limits() -> None:
    inputs = candidates(mission(speed_max=0.5, turn_rate_max=0.15))
    assert len(inputs) == 25
    np.testing.assert_allclose(inputs[::-1], -inputs, atol=1e-15)
    np.testing.assert_array_equal(np.abs(inputs).max(axis=0), [0.5, 0.15])
    assert np.zeros(2).tolist() in inputs.tolist()


def test_active_prefers_what_leaves_the_least_trace_even_if_it_is_shorter() -> None:
    task = mission()
    belief, inputs = unsure(START, 0.8), candidates(task)
    active = ExpectedCovariance(task, 1.0, 10)
    whole = np.full(len(inputs), 10)
    k, least = active.best(belief, inputs, whole)
    for other in range(len(inputs)):
        assert active.best(belief, inputs[other : other + 1], whole[:1])[1] >= least
    cut = whole.copy()
    cut[k] = 1
    assert active.best(belief, inputs, cut)[1] >= least


def test_two_sensors_are_not_left_standing_still_by_who_is_unsure() -> None:
    """Zero input leaves one direction unobservable; a robot that is unsure in that direction has to drive."""
    task = mission(turn_rate_max=0.15)
    active, inputs = ExpectedCovariance(task, 1.0, 10), candidates(task)
    rng = np.random.default_rng(0)
    for _ in range(10):
        pose = task.curve.draw(rng, 0.6)
        k, score = active.best(Belief(pose, 0.09 * np.eye(3)), inputs, np.full(25, 10))
        still = active.best(Belief(pose, 0.09 * np.eye(3)), np.zeros((1, 2)), np.full(1, 10))[1]
        assert inputs[k, 0] != 0.0
        assert score < 0.5 * still


def test_who_reads_beacons_moves_to_find_its_heading_rather_than_turn_rays_that_it_does_not_read() -> None:
    """Turning on the spot changes no range to a beacon; the robot that reads the wall learns by it."""
    places = ((2.5, 0.8), (-2.5, 0.9), (0.3, -1.2))
    among = BeaconFieldMission(FIELD, TWO, beacons=BeaconMission(places, ranges=BeaconQuality(0.1), interval=0.1))
    belief = Belief(START, np.diag([0.01, 0.01, 0.5]) ** 2)
    inputs, held = np.array([[0.0, 2.0], [0.5, 0.0]]), np.array([10, 10])
    scores = {
        kind: [ExpectedCovariance(task, 1.0, 10).best(belief, inputs[k : k + 1], held[:1])[1] for k in range(2)]
        for kind, task in (("wall", among.wall_mission), ("beacons", among))
    }
    assert scores["wall"][0] < 0.1 * 0.25
    assert scores["beacons"][0] > 0.99 * 0.25
    assert scores["beacons"][1] < 0.2 * 0.25


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("curve", CURVES, ids=lambda curve: curve.name)
def test_who_knows_the_pose_keeps_the_margin(mode: str, curve: Curve) -> None:
    task = mission(curve)
    flight = fly(built(task, mode=mode), task, curve.draw(np.random.default_rng(1), task.margin), 10.0)
    assert flight.clearance(curve) >= task.margin - 0.01
    for plan in flight.plans:
        assert_well_formed(plan, task)


@given(seed=st.integers(0, 2**32 - 1), mode=st.sampled_from(MODES))
@settings(max_examples=10, deadline=None)
def test_an_estimate_off_by_what_it_says_does_not_lead_to_the_wall(seed: int, mode: str) -> None:
    """Off by a constant of up to two standard deviations: the robot does not lose more than the rest of the margin."""
    rng, task, deviation = np.random.default_rng(seed), mission(), np.array([0.1, 0.1, 0.1])
    start = task.curve.draw(rng, 0.35)
    error = deviation * np.clip(rng.standard_normal(3), -1.1, 1.1)
    believing = lambda t, truth: Estimate(t, truth + error, np.diag(np.square(deviation)))  # noqa: E731
    flight = fly(built(task, mode=mode, seed=1 + seed % 100), task, start, 6.0, believing)
    assert flight.clearance(task.curve) > 0.16


@pytest.mark.parametrize("seed", range(4))
def test_from_too_near_to_the_wall_the_way_back_is_slow_and_reported_once(seed: int) -> None:
    task = mission()
    rng = np.random.default_rng(seed)
    s = rng.uniform(0.0, 2.0 * math.pi)
    start = np.array([*(0.97 * task.curve.points(np.array(s))), rng.uniform(-math.pi, math.pi)])
    flight = fly(built(task, mode="active"), task, start, 8.0, knowing(0.05))
    assert flight.kinds == ["way-back"]
    backing = [plan for plan in flight.plans if plan.phase[0] == DrivePhase.MANOEUVRE]
    assert backing
    assert all(abs(plan.u[0, 0]) <= 0.2 * task.speed_max for plan in backing)
    clearances = [task.curve.distance(x[:2]) for x in flight.truth]
    assert min(clearances) > 0.0
    assert max(clearances) >= 0.5 * task.margin
    assert task.curve.contains(flight.truth[-1])


def test_from_outside_the_way_back_leads_inside() -> None:
    """An estimate may be there, though the robot is not."""
    task = mission()
    parts = built(task, mode="active")
    flight = fly(parts, task, np.array([0.0, 1.7, 0.3]), 12.0)
    assert task.curve.contains(flight.truth[-1])


@pytest.mark.parametrize("status", [Status.INITIALISING, Status.LOST])
def test_without_an_estimate_the_robot_turns_on_the_spot(status: Status) -> None:
    task = mission()
    believing = lambda t, truth: Estimate(t, np.array([3.0, 0.1, 0.0]), np.eye(3), status)  # noqa: E731
    flight = fly(built(task, mode="active"), task, START, 2.0, believing)
    assert flight.kinds == ["blind"]
    np.testing.assert_allclose(np.array(flight.truth)[:, :2] - START[:2], 0.0, atol=1e-12)
    assert abs(flight.command[-1][1]) == task.turn_rate_max


def test_the_less_sure_the_estimate_the_shorter_inputs_are_held() -> None:
    task = mission()
    inside, inputs = Containment(task, 1.0, 10, 3.0), candidates(task)
    held = [inside.admissible_nodes(Belief(START, size**2 * np.eye(3)), inputs) for size in (0.0, 0.1, 0.2, 1.0)]
    for surer, other in itertools.pairwise(held):
        assert (other <= surer).all()
    assert held[0].sum() > held[-1].sum()


def test_every_pose_that_may_be_the_true_one_is_kept_off_the_wall() -> None:
    task, inputs = mission(), np.array([[1.0, 0.0]])
    containment = Containment(task, 1.0, 10, 3.0)
    middle, ahead = np.zeros(3), np.array([3.763 - 0.6, 0.0, 0.0])  # [m] from the end of the longer axis
    P = 1e-6 * np.eye(3)
    (alone,) = containment.admissible_nodes(Belief(middle, P), inputs)
    (beside,) = containment.admissible_nodes(Belief(middle, P, alternatives=ahead[None]), inputs)
    assert alone == 10
    assert 0 < beside < 4


def test_a_robot_that_does_not_know_which_of_some_poses_is_its_own_explores_all_the_same() -> None:
    """What keeps off the wall from all of them; with nothing but an estimate it turns on the spot."""
    task = mission()
    images = np.array([[0.8, 0.3, 0.4], [-0.5, -0.2, 2.0]])
    estimate = Estimate(0.0, images[0], 1e-4 * np.eye(3), Status.INITIALISING, {"hypotheses": images})
    belief = BeliefFromEstimates(0.1, 1.0).update(PlanRequest(0.0, 0.2, estimate, None))
    np.testing.assert_array_equal(belief.alternatives, images[1:])
    moved = belief.predicted(built(task)[0].plan(PlanRequest(0.0, 0.0, estimate, None)), 0.0, 0.2)
    assert moved.alternatives.shape == (1, 3)
    assert not np.array_equal(moved.alternatives, images[1:])
    plan = built(task)[0].plan(PlanRequest(0.0, 0.2, estimate, None))
    assert "blind" not in plan.notes
    assert np.abs(plan.u).max() > 0.0
    left = np.array([images[0], np.full(3, np.nan)])  # the others are ruled out, but it is not certified yet
    last = Estimate(0.0, images[0], 1e-4 * np.eye(3), Status.INITIALISING, {"hypotheses": left})
    assert "blind" not in built(task)[0].plan(PlanRequest(0.0, 0.2, last, None)).notes
    nothing = Estimate(0.0, images[0], None, Status.INITIALISING, {"hypotheses": np.full((2, 3), np.nan)})
    assert "blind" in built(task)[0].plan(PlanRequest(0.0, 0.2, nothing, None)).notes


def test_random_inputs_are_those_of_the_seed() -> None:
    task = mission()
    one, same, other = (fly(built(task, mode="random", seed=seed), task).truth[-1] for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)
