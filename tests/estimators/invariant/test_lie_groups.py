"""The groups' maps against their definitions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from mathnavi.estimators.invariant.lie_groups import SE2, SE23, SO3, quaternion
from mathnavi.interfaces.signals import Array
from mathnavi.models.quaternion import rotation

GROUPS = (SO3, SE2, SE23)
groups = pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.__name__)
# angles near 0 and near pi, and in between, where the forms of the coefficients change
SIZES = st.one_of(st.floats(0.0, 3.1), st.floats(0.0, 1e-6), st.floats(0.049, 0.051), st.floats(3.13, 3.14159))
SEEDS = st.integers(0, 2**32 - 1)


def drawn(group: Any, size: float, seed: int) -> Array:
    """An element of the algebra whose rotation is by ``size`` [rad]."""
    rng = np.random.default_rng(seed)
    xi: Array = rng.standard_normal(group.dimension)
    turn = slice(2, 3) if group is SE2 else slice(0, 3)
    xi[turn] *= size / np.linalg.norm(xi[turn])
    return xi


def hat(group: Any, xi: Array) -> Array:
    """xi^, from the definition of each algebra."""
    if group is SO3:
        return SO3.bracket(xi)
    if group is SE2:
        return np.array([[0.0, -xi[2], xi[0]], [xi[2], 0.0, xi[1]], [0.0, 0.0, 0.0]])
    matrix = np.zeros((5, 5))
    matrix[:3, :3], matrix[:3, 3], matrix[:3, 4] = SO3.bracket(xi[:3]), xi[3:6], xi[6:]
    return matrix


@groups
@given(size=SIZES, seed=SEEDS)
def test_the_exponential_is_that_of_the_matrix_and_the_logarithm_its_inverse(
    group: Any, size: float, seed: int
) -> None:
    xi = drawn(group, size, seed)
    X = group.exp(xi)
    np.testing.assert_allclose(X, expm(hat(group, xi)), atol=1e-12)
    np.testing.assert_allclose(group.log(X), xi, atol=1e-7 if size > 3.13 else 1e-10)


@groups
@given(size=SIZES, seed=SEEDS)
def test_the_adjoint_moves_an_element_to_the_other_side(group: Any, size: float, seed: int) -> None:
    X, eta = group.exp(drawn(group, size, seed)), drawn(group, 0.7, seed + 1)
    np.testing.assert_allclose(group.exp(group.adjoint(X) @ eta) @ X, X @ group.exp(eta), atol=1e-11)


@groups
@given(size=SIZES, seed=SEEDS)
def test_the_adjoint_of_an_exponential_is_the_exponential_of_the_bracket(group: Any, size: float, seed: int) -> None:
    xi = drawn(group, size, seed)
    np.testing.assert_allclose(group.adjoint(group.exp(xi)), expm(group.bracket(xi)), atol=1e-11)


@groups
@given(size=SIZES, seed=SEEDS)
def test_the_jacobian_is_the_sum_of_its_series(group: Any, size: float, seed: int) -> None:
    n, xi = group.dimension, drawn(group, size, seed)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:] = group.bracket(xi), np.eye(n)
    np.testing.assert_allclose(group.left_jacobian(xi), expm(block)[:n, n:], atol=1e-11)
    np.testing.assert_allclose(
        group.left_jacobian(xi), group.adjoint(group.exp(xi)) @ group.right_jacobian(xi), atol=1e-11
    )


@given(seed=SEEDS, size=SIZES)
def test_a_quaternion_leads_to_its_rotation(seed: int, size: float) -> None:
    R = SO3.exp(drawn(SO3, size, seed))
    q = quaternion(R)
    assert q[0] >= 0.0
    np.testing.assert_allclose(rotation(q), R, atol=1e-12)


@given(seed=SEEDS)
def test_a_pose_is_the_element_of_its_own(seed: int) -> None:
    pose = np.random.default_rng(seed).uniform([-5.0, -5.0, -3.1], [5.0, 5.0, 3.1])
    np.testing.assert_allclose(SE2.pose(SE2.from_pose(pose)), pose, atol=1e-12)
