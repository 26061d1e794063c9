"""The compiled extended Kalman filter does what its equations say, one ray after the other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.estimators.ranging.kalman_kernels import (
    RaySensors,
    condition,
    expected_range,
    expected_ranges,
    no_innovations,
    predict,
    step_within,
)
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import Curve
from mathnavi.models.unicycle.kernels import integrate, rays_at
from mathnavi.models.unicycle.mission import RangingMission
from tests.estimators.ranging.walls import FIELD, angles, clear_pose, seeds, walls

OPEN = 1e300  # a gate that refuses nothing
RELATIVE, ABSOLUTE = 0.05, 0.01


def sensors_at(angles: Array, gate: float = OPEN, outliers: float = 0.0) -> RaySensors:
    return RaySensors(rays_at(angles), RELATIVE, ABSOLUTE, gate, outliers, 8.0)


def second_derivative(curve: Curve, pose: Array, ray: Array) -> tuple[float, Array, Array]:
    """h, H (3,) and h'' (3, 3) of a ray."""
    H, D, heading = np.empty(3), np.empty(3), np.array([0.0, 0.0, 1.0])
    h, B, C, E = expected_range(curve.wall, pose, ray, H, D)
    turned = np.outer(H, heading)
    return h, H, C * np.outer(D, D) - B * (turned + turned.T) + E * np.outer(heading, heading)


def any_covariance(rng: np.random.Generator, deviation: float) -> Array:
    root = deviation * rng.standard_normal((4, 4))
    return root @ root.T + 1e-6 * np.eye(4)


@settings(max_examples=40, deadline=None)
@given(walls, seeds, st.sampled_from([(0.0, 0.0), (0.15, -0.1)]))
def test_derivatives_of_a_range_are_those_of_differences(curve: Curve, seed: int, place: tuple[float, float]) -> None:
    """Of the range that a sensor reads where it is mounted, by the pose of the axle."""
    mission = RangingMission(curve, (0.4,), mounting=(place,))
    sensor, h = clear_pose(curve, mission.alpha, np.random.default_rng(seed)), 1e-4
    pose = sensor - [*(mission.origins(sensor)[0] - sensor[:2]), 0.0]
    rho, H, second = second_derivative(curve, pose, mission.rays[0])
    step = h * np.eye(3)
    slope = [(mission.ranges(pose + e)[0] - mission.ranges(pose - e)[0]) / (2.0 * h) for e in step]
    gradients = [[second_derivative(curve, pose + sign * e, mission.rays[0])[1] for sign in (1, -1)] for e in step]
    numerical = [(ahead - behind) / (2.0 * h) for ahead, behind in gradients]
    assert rho == pytest.approx(curve.ranges(sensor, mission.alpha)[0][0], abs=1e-12)
    np.testing.assert_allclose(H, slope, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(second, numerical, rtol=1e-4, atol=1e-4 * np.abs(second).max())


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_a_prediction_carries_the_covariance_on_by_the_jacobian_of_the_motion(seed: int) -> None:
    rng, dt = np.random.default_rng(seed), 0.1
    x, P, u, W = np.array([0.2, -0.1, 3.0, 0.02]), any_covariance(rng, 0.2), rng.normal(size=2), np.array([0.3, 0.2])

    def motion(at: Array, v: Array) -> Array:
        return np.array([*integrate(at[:3], *((1.0 - at[3]) * u + v), dt), at[3]])

    h = 1e-6
    A = np.array([(motion(x + e, np.zeros(2)) - motion(x - e, np.zeros(2))) / (2.0 * h) for e in h * np.eye(4)]).T
    G = np.array([(motion(x, e) - motion(x, -e)) / (2.0 * h) for e in h * np.eye(2)]).T
    after, covariance = x.copy(), P.copy()
    predict(after, covariance, u, W, FIELD.wall, dt)
    expected = motion(x, np.zeros(2))
    np.testing.assert_allclose(after[[0, 1, 3]], expected[[0, 1, 3]], atol=1e-12)
    assert math.remainder(after[2] - expected[2], 2.0 * math.pi) == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(covariance, A @ P @ A.T + G * W @ G.T, rtol=1e-7, atol=1e-9)
    np.testing.assert_array_equal(covariance, covariance.T)


@settings(max_examples=40, deadline=None)
@given(walls, angles, seeds)
def test_rays_one_after_the_other_are_the_update_with_all_of_them(
    curve: Curve, alpha: tuple[float, ...], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    pose, P = clear_pose(curve, np.array(alpha), rng), any_covariance(rng, 0.3)
    x = np.array([*pose, 0.01])
    parts = [second_derivative(curve, pose, ray) for ray in rays_at(alpha)]
    h, H = np.array([part[0] for part in parts]), np.array([[*part[1], 0.0] for part in parts])
    R = np.square(RELATIVE * h) + ABSOLUTE**2
    R += [0.5 * np.trace(part[2] @ P[:3, :3] @ part[2] @ P[:3, :3]) for part in parts]
    nu = 0.05 * h * rng.standard_normal(len(h))
    S = H @ P @ H.T + np.diag(R)
    K = P @ H.T @ np.linalg.inv(S)

    after, covariance = x.copy(), P.copy()
    wall = curve.wall
    innovations = no_innovations(len(h))
    likelihood, nis, read = condition(after, covariance, h + nu, wall, sensors_at(np.array(alpha)), innovations)
    assert read == len(h)
    assert nis == pytest.approx(nu @ np.linalg.solve(S, nu), rel=1e-6)
    _, log_det = np.linalg.slogdet(2.0 * math.pi * S)
    assert likelihood == pytest.approx(-0.5 * (nis + log_det), rel=1e-6, abs=1e-6)
    np.testing.assert_allclose(innovations.residual, nu, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(innovations.variance, np.square(RELATIVE * h) + ABSOLUTE**2)
    assert innovations.white @ innovations.white == pytest.approx(nis)
    step = step_within(wall, *x[:2], *(K @ nu)[:2])
    assert math.remainder(after[2] - x[2] - step * (K @ nu)[2], 2.0 * math.pi) == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose((after - x)[[0, 1, 3]], step * (K @ nu)[[0, 1, 3]], atol=1e-6)
    np.testing.assert_allclose(covariance, P - K @ S @ K.T, atol=1e-6 * np.abs(P).max())


def test_a_lost_ray_is_as_if_there_were_no_sensor() -> None:
    pose, alpha = np.array([0.5, 0.2, 0.3]), np.array([-1.0, 0.0, 1.0])
    z = 1.02 * FIELD.ranges(pose, alpha)[0]
    wall, results = FIELD.wall, []
    for readings, angles_of in ((np.where([0, 1, 0], np.nan, z), alpha), (z[[0, 2]], alpha[[0, 2]])):
        x, P = np.array([*pose, 0.0]), 0.01 * np.eye(4)
        found = condition(x, P, readings, wall, sensors_at(angles_of), no_innovations(len(angles_of)))
        results.append((*found, *x, *P.ravel()))
    np.testing.assert_array_equal(*results)


def test_an_outlier_changes_nothing_and_counts_as_a_ray_at_the_gate() -> None:
    pose, alpha, gate = np.array([0.5, 0.2, 0.3]), np.array([0.7]), 9.0
    z = FIELD.ranges(pose, alpha)[0]
    x, P = np.array([*pose, 0.0]), 1e-4 * np.eye(4)
    innovations = no_innovations(1)
    likelihood, nis, read = condition(x, P, 2.0 * z, FIELD.wall, sensors_at(alpha, gate, 0.1), innovations)
    assert (nis, read) == (gate, 1)
    assert likelihood == pytest.approx(math.log(0.1 / 8.0))
    assert innovations.white[0] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(x, [*pose, 0.0], rtol=1e-14)
    np.testing.assert_allclose(P, 1e-4 * np.eye(4), rtol=1e-12)


def test_a_reading_that_may_be_an_outlier_is_believed_by_how_likely_it_is_none() -> None:
    """Probabilistic data association: the mean of both cases, and the covariance of their mixture."""
    pose, alpha, epsilon = np.array([0.5, 0.2, 0.3]), np.array([0.7]), 0.3
    h = float(FIELD.ranges(pose, alpha)[0][0])
    start, z = 1e-4 * np.eye(4), np.array([h * (1.0 + 2.0 * RELATIVE)])
    updated, covariance = np.array([*pose, 0.0]), start.copy()
    likelihood, nis, _ = condition(updated, covariance, z, FIELD.wall, sensors_at(alpha), no_innovations(1))
    inlier, outlier = (1.0 - epsilon) * math.exp(likelihood), epsilon / 8.0
    beta = inlier / (inlier + outlier)
    x, P = np.array([*pose, 0.0]), start.copy()
    mixed, same, _ = condition(x, P, z, FIELD.wall, sensors_at(alpha, outliers=epsilon), no_innovations(1))
    step = updated - [*pose, 0.0]
    assert 0.1 < beta < 0.99
    assert same == nis
    assert mixed == pytest.approx(math.log(inlier + outlier))
    np.testing.assert_allclose(x, [*pose, 0.0] + beta * step, rtol=1e-12)
    spread = beta * (1.0 - beta) * np.outer(step, step)
    np.testing.assert_allclose(P, beta * covariance + (1.0 - beta) * start + spread, atol=1e-14)


@settings(max_examples=60, deadline=None)
@given(walls, angles, seeds)
def test_whatever_is_read_the_estimate_stays_within_the_wall(curve: Curve, alpha: tuple[float, ...], seed: int) -> None:
    rng = np.random.default_rng(seed)
    wall = curve.wall
    x, P = np.array([*curve.draw(rng), 0.0]), any_covariance(rng, 1.0)
    for _ in range(10):
        predict(x, P, rng.normal(scale=30.0, size=2), np.ones(2), wall, 0.1)
        assert curve.contains(x[:2])
        rho, innovations = rng.uniform(0.01, 20.0, len(alpha)), no_innovations(len(alpha))
        condition(x, P, rho, wall, sensors_at(np.array(alpha), outliers=0.1), innovations)
        assert curve.contains(x[:2])
        assert np.isfinite(P).all()


def test_a_ray_that_grazes_the_wall_tells_nothing() -> None:
    h, H = expected_ranges(FIELD.wall, np.array([3.763 - 1e-9, 0.0, 0.5 * math.pi]), rays_at([0.0]))
    assert np.isnan(h).all()
    assert np.isnan(H).all()
