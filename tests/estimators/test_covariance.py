"""Square roots of covariances, what rounding has made indefinite, and how good estimates of (x, v) say they are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.estimators.invariant.attitude import AttitudeIekf
from mathnavi.estimators.kalman_steps import square_root
from mathnavi.estimators.moving_horizon import MovingHorizonEstimator
from mathnavi.estimators.velocity.kalman import LagrangianEkf, LagrangianUkf
from mathnavi.interfaces.signals import Measurement
from mathnavi.models.manifold.attitude import nearer
from mathnavi.models.manifold.constant_curvature import hyperbolic_space
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.manifold.system import LagrangianSystem
from mathnavi.models.manifold.systems import PointSystem, RigidBody, linear
from mathnavi.models.mechanism.entity import build_spec
from mathnavi.models.mechanism.system import MechanismSystem

seeds = st.integers(0, 2**32 - 1)


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_the_root_of_a_covariance_is_upper_triangular_and_squares_to_it(seed: int) -> None:
    root = np.random.default_rng(seed).standard_normal((4, 4))
    P = root @ root.T + 1e-9 * np.eye(4)
    U = square_root(P)
    np.testing.assert_allclose(U.T @ U, P, atol=1e-9)
    np.testing.assert_array_equal(U, np.triu(U))


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_the_root_of_a_matrix_that_is_indefinite_is_that_of_the_nearest_which_is_not(seed: int) -> None:
    Q = np.linalg.qr(np.random.default_rng(seed).standard_normal((4, 4)))[0]
    U = square_root(Q * [2.0, 1.0, 0.5, -1e-3] @ Q.T)
    np.testing.assert_allclose(U.T @ U, Q * [2.0, 1.0, 0.5, 0.0] @ Q.T, atol=1e-9)
    np.testing.assert_allclose(U, np.triu(U), atol=1e-12)


H, Q, NOISE = 0.02, 0.3, 0.01  # [s], [rad/s^1.5], [rad]
SYSTEMS: dict[str, tuple[LagrangianSystem, Any]] = {
    "arm": (MechanismSystem(build_spec("two-link").compile()), LagrangianEkf),
    "arm, sigma points": (MechanismSystem(build_spec("two-link").compile()), LagrangianUkf),
    "arm, window": (MechanismSystem(build_spec("two-link").compile()), MovingHorizonEstimator),
    "body": (RigidBody(0.05), AttitudeIekf),
    "curved plane": (PointSystem(hyperbolic_space(2), linear(1.0, 0)), LagrangianEkf),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_an_estimate_of_position_and_velocity_is_as_good_as_its_covariance_says(name: str) -> None:
    """NEES has the mean 2 n where accelerations and readings are as noisy as declared.

    On a curved space the covariance of the state's components has the rank 2 n.
    """
    (system, plugin), rng = SYSTEMS[name], np.random.default_rng(2)
    manifold, n = system.manifold, system.manifold.dimension
    mission = LagrangianMission(system, PositionQuality(NOISE), H, speed_max=3.0)
    estimator = plugin.build(plugin.Config(acceleration=Q), mission)
    x, u = np.concatenate([manifold.origin, np.zeros(manifold.vector_size)]), np.zeros(len(system.inputs))
    squares = []
    for k in range(300):
        y = manifold.point(x[: manifold.size], NOISE * rng.standard_normal(n))
        estimate = estimator.update(k * H, [Measurement("position", k * H, y)], u)
        assert estimate.covariance is not None
        assert estimate.covariance.shape == (len(x), len(x))
        if k >= 50:
            difference = estimate.x - x
            if name == "body":
                difference[:4] = nearer(x[:4], estimate.x[:4]) - x[:4]
            values, vectors = np.linalg.eigh(estimate.covariance)
            squares.append(np.sum((vectors.T @ difference)[-2 * n :] ** 2 / values[-2 * n :]))
        x = system.flow(x, u, H)
        kick = manifold.vector(x[: manifold.size], Q * np.sqrt(H) * rng.standard_normal(n))
        x = np.concatenate([x[: manifold.size], x[manifold.size :] + kick])
    assert np.mean(squares) == pytest.approx(2.0 * n, rel=0.3)
