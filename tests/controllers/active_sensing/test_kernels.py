"""The compiled prediction over the horizon, against the same formulas written in NumPy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.controllers.active_sensing.kernels import (
    BEARING,
    DIFFERENCE,
    RANGE,
    PredictionHorizon,
    RangeSensors,
    WallTable,
    clearance,
    expected_covariance,
    expected_traces,
    nodes_within,
    range_rate_gradient,
    sigma_poses,
    smallest_singular_values,
)
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import BEAN, EGG, Curve
from mathnavi.models.unicycle.beacons import exact_readings
from mathnavi.models.unicycle.kernels import rays_at
from tests.controllers.active_sensing.robots import FIELD, TWO, mission

CURVES = [FIELD, EGG, BEAN]
NOISE = np.array([0.05, 1e-3])
ANGLES = np.array(TWO)
SENSORS = RangeSensors(rays_at(ANGLES), NOISE)
NO_BEACONS = np.empty((0, 8))
curves = st.sampled_from(CURVES)
seeds = st.integers(0, 2**32 - 1)


def slopes(function: object, x: Array, step: float = 1e-5) -> Array:
    """Central differences of a function of a pose (3,), one column for each component."""
    assert callable(function)
    return np.stack([(function(x + d) - function(x - d)) / (2.0 * step) for d in step * np.eye(3)], axis=-1)


def covariance(rng: np.random.Generator, size: float) -> Array:
    root = size * rng.standard_normal((3, 3))
    return root @ root.T + 1e-6 * np.eye(3)


def wall_of(curve: Curve) -> WallTable:
    return WallTable(curve.table, curve.polyline)


def ranges(curve: Curve, x: Array) -> Array:
    return curve.ranges(x, ANGLES)[0]


@pytest.mark.parametrize("curve", CURVES, ids=lambda curve: curve.name)
@pytest.mark.parametrize("held", [0, 4, 10])
def test_the_expected_covariance_is_that_of_the_formula(curve: Curve, held: int) -> None:
    rng, task = np.random.default_rng(1), mission(curve)
    pose, P, u, h, n = np.array([0.3, 0.1, 0.8]), covariance(rng, 0.2), np.array([0.6, -0.9]), 0.1, 10

    def node(j: int, x: Array) -> Array:
        return task.flow(task.flow(x, u, min(j, held) * h), np.zeros(2), h)

    information = np.linalg.inv(P)
    for j in range(1, 11):
        HF = slopes(lambda x, j=j: ranges(curve, node(j, x)), pose)
        R = np.diag(np.square(NOISE[0] * ranges(curve, node(j, pose))) + NOISE[1] ** 2)
        information = information + HF.T @ (n * np.linalg.inv(R)) @ HF
    F = slopes(lambda x: node(10, x), pose)
    x, found = expected_covariance(
        wall_of(curve), SENSORS, PredictionHorizon(h, 10, float(n)), pose, P, u, held, NO_BEACONS
    )
    np.testing.assert_allclose(x, node(10, pose), atol=1e-12)
    np.testing.assert_allclose(found, F @ np.linalg.inv(information) @ F.T, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("kind", [RANGE, BEARING, DIFFERENCE])
def test_what_beacons_tell_is_that_of_the_formula(kind: int) -> None:
    places, noise = np.array([[2.5, 0.8], [-2.5, 0.9], [0.3, -1.2]]), (0.1, 0.02)
    pose, P, u, h, often = (
        np.array([0.3, 0.1, 0.8]),
        covariance(np.random.default_rng(1), 0.2),
        np.array([0.6, -0.9]),
        0.1,
        2.0,
    )
    read = places[int(kind == DIFFERENCE) :]
    table = np.array([[kind, *place, *places[0], *noise, often] for place in read])

    def node(j: int, x: Array) -> Array:
        return mission().flow(x, u, j * h)

    def readings(x: Array) -> Array:
        return exact_readings(places, kind, x)[len(places) - len(read) :]

    information = np.linalg.inv(P)
    for j in range(1, 11):
        at = node(j, pose)
        length = exact_readings(places, 0, at) if kind == BEARING else np.abs(readings(at))
        H = slopes(lambda x, j=j: readings(node(j, x)), pose)
        information = information + H.T @ np.diag(often / (noise[0] ** 2 + (noise[1] * length) ** 2)) @ H
    F = slopes(lambda x: node(10, x), pose)
    blind = RangeSensors(np.empty((0, 3)), NOISE)
    _, found = expected_covariance(wall_of(FIELD), blind, PredictionHorizon(h, 10, 1.0), pose, P, u, 10, table)
    np.testing.assert_allclose(found, F @ np.linalg.inv(information) @ F.T, rtol=1e-5, atol=1e-9)


def test_the_trace_is_that_of_the_expected_covariance_of_each_input() -> None:
    pose, P = np.array([0.3, 0.1, 0.8]), covariance(np.random.default_rng(2), 0.2)
    inputs, held = np.array([[0.5, 0.2], [0.0, -1.0], [-1.0, 0.0]]), np.array([10, 3, 1])
    wall, horizon = wall_of(FIELD), PredictionHorizon(0.1, 10, 10.0)
    traces = expected_traces(wall, SENSORS, horizon, pose, P, inputs, held, NO_BEACONS)
    for trace, u, n in zip(traces, inputs, held, strict=True):
        _, expected = expected_covariance(wall, SENSORS, horizon, pose, P, u, int(n), NO_BEACONS)
        assert trace == pytest.approx(np.trace(expected), rel=1e-12)


@given(curve=curves, seed=seeds)
@settings(max_examples=40, deadline=None)
def test_the_gradient_of_a_range_rate_is_that_of_differences(curve: Curve, seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, u, alpha = curve.draw(rng, 0.3), rng.uniform(-1.0, 1.0, 2), np.array([rng.uniform(-math.pi, math.pi)])

    def rate(pose: Array) -> float:
        ahead, back = (mission(curve).flow(pose, u, dt) for dt in (1e-4, -1e-4))
        return float(curve.ranges(ahead, alpha)[0][0] - curve.ranges(back, alpha)[0][0]) / 2e-4

    rho, s = curve.ranges(x, alpha)
    beta = float(x[2] + alpha[0])
    tangent = curve.tangent(s)[0]
    grazing = abs(math.cos(beta) * tangent[1] - math.sin(beta) * tangent[0]) < 0.4 * np.linalg.norm(tangent)
    if not grazing:
        found = range_rate_gradient(curve.table, float(s[0]), float(rho[0]), beta, float(x[2]), u)
        np.testing.assert_allclose(found, slopes(rate, x, 1e-3), rtol=2e-2, atol=5e-3)


def test_the_smallest_singular_value_is_that_of_ranges_and_rates() -> None:
    pose, u = np.array([1.0, 0.4, 0.9]), np.array([0.5, 0.3])

    def both(x: Array) -> Array:
        ahead, back = (ranges(FIELD, mission().flow(x, u, dt)) for dt in (1e-4, -1e-4))
        return np.concatenate([ranges(FIELD, x), (ahead - back) / 2e-4])

    expected = np.linalg.svd(slopes(both, pose, 1e-4), compute_uv=False)[-1]
    found = smallest_singular_values(wall_of(FIELD), ANGLES, pose, u[None, :])
    assert found[0] == pytest.approx(expected, rel=1e-4)


@given(curve=curves, seed=seeds)
@settings(max_examples=40, deadline=None)
def test_the_clearance_is_the_distance_to_the_wall(curve: Curve, seed: int) -> None:
    rng = np.random.default_rng(seed)
    p = rng.uniform(*curve.polyline.min(axis=0, keepdims=True), *curve.polyline.max(axis=0, keepdims=True))
    found = clearance(wall_of(curve), p[0], p[1])
    assert abs(found) == pytest.approx(curve.distance(p), abs=2e-2)
    if curve.distance(p) > 0.01:
        assert (found > 0.0) is curve.contains(p)


@given(curve=curves, seed=seeds)
@settings(max_examples=30, deadline=None)
def test_an_input_is_held_as_long_as_no_pose_nears_the_wall_and_no_longer(curve: Curve, seed: int) -> None:
    rng, margin = np.random.default_rng(seed), 0.3
    poses, inputs = np.array([curve.draw(rng, 0.1) for _ in range(3)]), rng.uniform(-1.5, 1.5, (4, 2))
    held = nodes_within(wall_of(curve), poses, margin, inputs, 0.1, 10)
    for u, n in zip(inputs, held, strict=True):
        keeps = [
            all(
                clearance(wall_of(curve), *mission().flow(x, u, 0.1 * j)[:2])
                >= min(margin, clearance(wall_of(curve), *x[:2])) - 1e-8
                for x in poses
            )
            for j in range(1, 11)
        ]
        assert all(keeps[:n])
        assert n == 10 or not keeps[n]


def test_turning_on_the_spot_keeps_inside_wherever_the_robot_may_be() -> None:
    poses = np.array([[3.6, 0.0, 0.0], [0.0, 1.41, 1.0], [0.0, 3.0, 0.0]])
    held = nodes_within(wall_of(FIELD), poses, 0.3, np.array([[0.0, 2.0], [0.0, 0.0]]), 0.1, 10)
    assert held.tolist() == [10, 10]


@given(curve=curves, seed=seeds, size=st.floats(0.0, 2.0))
@settings(max_examples=40, deadline=None)
def test_sigma_poses_are_not_where_the_robot_is_not(curve: Curve, seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    pose, P = curve.draw(rng, 0.1), covariance(rng, size)
    poses = sigma_poses(wall_of(curve), pose, P, 3.0, 0.3)
    least = min(0.3, clearance(wall_of(curve), *pose[:2]))
    np.testing.assert_array_equal(poses[0], pose)
    assert all(clearance(wall_of(curve), *x[:2]) >= least - 1e-9 for x in poses)


def test_far_from_the_wall_sigma_poses_have_the_covariance() -> None:
    P = covariance(np.random.default_rng(4), 0.05)
    poses = sigma_poses(wall_of(FIELD), np.zeros(3), P, 3.0, 0.3)[1:]
    np.testing.assert_allclose(poses.T @ poses / (2.0 * 9.0), P, atol=1e-12)
