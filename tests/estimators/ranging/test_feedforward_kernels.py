"""The feed-forward of z is Psi_* F on the truth; as printed there is none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from mathnavi.estimators.ranging.feedforward_kernels import LEAST_DENOMINATOR, rho_dot_rate, s_rate, stay
from mathnavi.estimators.ranging.observer import FEED_FORWARDS, FeedForward
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import Curve
from mathnavi.models.unicycle.kernels import integrate
from tests.estimators.ranging.walls import (
    FIELD,
    angles,
    central_difference,
    clear_pose,
    ranges_around,
    seeds,
    walls,
)

STEP = 2e-4  # [s] of the differences
DT = 0.01  # [s]


@given(walls, angles, seeds)
@settings(max_examples=40, deadline=None)
def test_both_rates_are_that_of_the_truth(curve: Curve, alpha: tuple[float, ...], seed: int) -> None:
    rng, at = np.random.default_rng(seed), np.array(alpha)
    pose, u = clear_pose(curve, at, rng), rng.uniform((-1.0, -2.0), (1.0, 2.0))
    rho, s = ranges_around(curve, at, pose, u, STEP)
    z, rate = np.append(s[2], pose[2]), np.append(central_difference(s, STEP), u[1])
    np.testing.assert_allclose(s_rate(curve.table, at, z, rho[2], u), rate, rtol=0, atol=2e-9)
    by_ranges = rho_dot_rate(curve.table, at, z, rho[2], central_difference(rho, STEP), u)
    np.testing.assert_allclose(by_ranges, rate, rtol=0, atol=2e-9)


@given(walls, angles, seeds)
@settings(max_examples=40, deadline=None)
def test_a_period_on_the_truth_ends_on_the_truth(curve: Curve, alpha: tuple[float, ...], seed: int) -> None:
    """manifold to round-off, s and rho_dot to what Heun's method leaves of a period."""
    rng, at = np.random.default_rng(seed), np.array(alpha)
    pose, u = clear_pose(curve, at, rng), rng.uniform((-1.0, -2.0), (1.0, 2.0))
    here, there = readings(curve, at, pose, u), readings(curve, at, integrate(pose, *u, DT), u)
    z = np.append(curve.ranges(pose, at)[1], pose[2])
    after = np.append(curve.ranges(integrate(pose, *u, DT), at)[1], pose[2] + DT * u[1])
    allowed: dict[FeedForward, float] = {"s": 5e-4, "rho_dot": 5e-4, "manifold": 1e-11}
    for name, atol in allowed.items():
        error = FEED_FORWARDS[name](curve.wall, at, z, here, there, u, DT) - after
        assert np.abs((error + np.pi) % (2.0 * np.pi) - np.pi).max() <= atol


def test_the_print_has_none() -> None:
    z, nothing = np.array([1.0, 2.0, 3.0]), np.zeros((2, 2))
    after = stay(FIELD.wall, np.zeros(2), z, nothing, nothing, np.ones(2), DT)
    np.testing.assert_array_equal(after, z)
    assert after is not z


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_where_a_ray_grazes_the_wall_s_moves_no_faster_than_the_guard_lets_it(side: float) -> None:
    alpha, u = np.array([0.0]), np.array([0.3, 0.7])
    s = 0.4
    t_x, t_y = FIELD.tangent(np.array(s))
    z = np.array([s, np.arctan2(t_y, t_x) + side * 1e-6])
    rate = s_rate(FIELD.table, alpha, z, np.array([1.2]), u)
    assert rate[0] == pytest.approx(-side * 1.2 * u[1] / LEAST_DENOMINATOR)


def readings(curve: Curve, alpha: Array, pose: Array, u: Array) -> Array:
    """(2, l) rho and rho_dot."""
    rho, _ = ranges_around(curve, alpha, pose, u, STEP)
    return np.stack([rho[2], central_difference(rho, STEP)])
