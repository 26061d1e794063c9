from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.velocity.error_state import Propagation, StateErrors
from mathnavi.estimators.velocity.kalman import Unscented, linearised
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.constant_curvature import sphere
from tests.estimators.velocity.runs import SYSTEMS, moving


@pytest.mark.parametrize("name", sorted(SYSTEMS))
def test_a_difference_is_what_has_to_be_added(name: str) -> None:
    system, state = moving(name, 0.6)
    bundle, n = StateErrors(system.manifold), system.manifold.dimension
    rng = np.random.default_rng(3)
    for _ in range(20):
        error = 0.5 * rng.standard_normal(2 * n)
        np.testing.assert_allclose(bundle.difference(bundle.sum(state, error), state), error, atol=1e-12)


def test_a_covariance_means_the_same_where_the_frame_jumps() -> None:
    """Just before and just after p_0 = 0 on the sphere: what it says of an error, as an ambient vector."""
    manifold = sphere(2)
    bundle = StateErrors(manifold)
    p, q = (manifold.check(np.array([1e-9 * sign, 0.6, 0.8])) for sign in (1.0, -1.0))
    P = np.diag([1.0, 4.0, 9.0, 16.0])
    turned = bundle.turned(P, p, q)

    def ambient(at: Array, covariance: Array) -> Array:
        frame = manifold.frame(at)
        return frame @ covariance[:2, :2] @ frame.T

    assert not np.allclose(manifold.frame(p), manifold.frame(q), atol=0.1)
    np.testing.assert_allclose(ambient(q, turned), ambient(p, P), atol=1e-7)


@pytest.mark.parametrize("propagation", [linearised, Unscented(4, 0.6), Unscented(4, 1.0)])
def test_a_linear_map_carries_a_covariance_on_exactly(propagation: Propagation) -> None:
    rng = np.random.default_rng(4)
    A, root = rng.standard_normal((4, 4)), rng.standard_normal((4, 4))
    mean, P = propagation(lambda e: A @ e, root @ root.T)
    np.testing.assert_allclose(mean, 0.0, atol=1e-12)
    np.testing.assert_allclose(P, A @ root @ root.T @ A.T, rtol=1e-7, atol=1e-8)


def test_sigma_points_know_the_mean_of_a_square() -> None:
    """E a^2 = P_aa, to which a linearisation is blind."""
    P = np.diag([0.04, 0.09])
    for propagation, expected in ((linearised, 0.0), (Unscented(2, 0.6), 0.04)):
        mean, _ = propagation(lambda e: np.array([e[0] ** 2, e[1]]), P)
        assert mean[0] == pytest.approx(expected, abs=1e-12)


def test_a_covariance_stays_positive_definite_by_any_map() -> None:
    """Whatever the curvature, no weight of the sigma points is negative."""
    rng = np.random.default_rng(5)
    for alpha in (0.52, 0.6, 1.0):
        propagation = Unscented(3, alpha)
        for _ in range(50):
            root, curvature = rng.standard_normal((3, 3)), 10.0 * rng.standard_normal((3, 3))
            _, P = propagation(lambda e, B=curvature: e + B @ np.square(e), root @ root.T)
            least, *_, greatest = np.linalg.eigvalsh(P)
            assert least > -1e-12 * greatest
