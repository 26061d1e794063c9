"""Poses brought onto the set of feasible states, and far from each other."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings

from mathnavi.estimators.ranging.feasible_set_kernels import farthest_points, project, pushed
from mathnavi.models.field.curve import Curve
from mathnavi.models.unicycle.kernels import rays_at
from mathnavi.models.unicycle.mission import RangingMission
from tests.estimators.ranging.walls import FIELD, angles, clear_pose, seeds, walls


@settings(max_examples=25, deadline=None)
@given(walls, angles, seeds)
def test_many_random_poses_reach_the_feasible_set_in_a_few_steps(
    curve: Curve, alpha: tuple[float, ...], seed: int
) -> None:
    rng, sensors = np.random.default_rng(seed), np.array(alpha)
    y, _ = curve.ranges(clear_pose(curve, sensors, rng), sensors)
    states = np.array([[*curve.draw(rng), 0.0] for _ in range(100)])
    before = states.copy()
    on, far = project(states, y, np.square(0.02 * y), curve.wall, rays_at(sensors), 6, np.inf)
    assert np.mean(far < 10.0) > 0.03
    for state in on[far < 10.0]:
        assert curve.contains(state[:2])
        assert np.all(np.abs(curve.ranges(state[:3], sensors)[0] - y) < 0.08 * y)
    np.testing.assert_array_equal(states, before)


@settings(max_examples=30, deadline=None)
@given(walls, seeds)
def test_a_pose_near_the_set_moves_to_the_nearest_of_it(curve: Curve, seed: int) -> None:
    """The shortest step has no part along the set: it is in the span of the gradients."""
    rng, sensors = np.random.default_rng(seed), np.array([-0.8, 0.3])
    truth = clear_pose(curve, sensors, rng, 0.4)
    y, _ = curve.ranges(truth, sensors)
    start = truth + 1e-3 * rng.standard_normal(3)
    on, _ = project(np.array([[*start, 0.0]]), y, np.full(2, 1e-8), curve.wall, rays_at(sensors), 3, np.inf)
    h = 1e-5
    H = np.array(
        [(curve.ranges(truth + e, sensors)[0] - curve.ranges(truth - e, sensors)[0]) / (2.0 * h) for e in h * np.eye(3)]
    ).T
    along = np.cross(*H)
    assert abs((on[0, :3] - start) @ along) <= 0.05 * np.linalg.norm(along) * np.linalg.norm(on[0, :3] - start) + 1e-5
    np.testing.assert_allclose(curve.ranges(on[0, :3], sensors)[0], y, atol=1e-4)


def test_a_ray_that_was_lost_does_not_count() -> None:
    sensors, state = np.array([0.0, 1.0, 2.0]), np.array([[0.3, 0.1, 0.2, 0.0]])
    y, _ = FIELD.ranges(state[0, :3] + [0.2, 0.1, 0.0], sensors)
    wall = FIELD.wall
    v = np.full(3, 1e-3)
    projected, _ = project(state, np.array([y[0], np.nan, y[2]]), v, wall, rays_at(sensors), 3, np.inf)
    same, _ = project(state, y[[0, 2]], v[:2], wall, rays_at(sensors[[0, 2]]), 3, np.inf)
    np.testing.assert_array_equal(projected, same)


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_each_farthest_point_is_as_far_as_any_from_those_before(seed: int) -> None:
    states = np.random.default_rng(seed).uniform(-3.0, 3.0, (60, 4))
    chosen = farthest_points(states, 7, 12, 0.1)
    assert chosen[0] == 7
    assert len(set(chosen)) == len(chosen) == 12
    turn = (states[:, None, 2] - states[None, :, 2] + np.pi) % (2.0 * np.pi) - np.pi
    far = np.sqrt(np.square(states[:, None, :2] - states[None, :, :2]).sum(axis=2) + np.square(turn))
    for k in range(1, 12):
        from_those = far[:, chosen[:k]].min(axis=1)
        assert from_those[chosen[k]] == from_those.max()


def test_points_that_are_too_near_are_not_chosen() -> None:
    states = np.array([[0.0, 0.0, 0.0, 0.0], [0.05, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [1.0, 0.05, 0.0, 0.0]])
    assert sorted(farthest_points(states, 0, 4, 0.1)) in ([0, 2], [0, 3])


def test_states_are_pushed_along_with_the_inputs() -> None:
    mission = RangingMission(FIELD, (0.0,))
    inputs = np.array([[0.5, 1.0], [0.4, -2.0], [0.6, 0.1]])
    state = np.array([[0.3, 0.2, 1.0, 0.0]])
    expected = mission.flow(state[0, :3], inputs[0], 0.05)
    for u in inputs[1:]:
        expected = mission.flow(expected, u, 0.1)
    after = pushed(state, inputs, FIELD.wall, 0.1, 0.5)
    np.testing.assert_allclose(after[0, :3], expected, atol=1e-12)
