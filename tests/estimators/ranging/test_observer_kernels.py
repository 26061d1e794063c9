"""V_rho and Q: zero on the truth, and the compiled ones those that CasADi derives."""

from __future__ import annotations

import itertools
import math

import casadi
import numpy as np
import pytest
from hypothesis import given, settings

from mathnavi.estimators.observability.output_flow import output_flow
from mathnavi.estimators.ranging.observer_kernels import corrected, descent
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import Curve
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


def feasibility(curve: Curve, angles: tuple[float, ...]) -> casadi.Function:
    """(z (l + 1,), rho (l,)) -> V_rho [m^2], r (2 l,) [m], J_v (2 l, l + 1)."""
    l = len(angles)  # noqa: E741
    z, rho = casadi.SX.sym("z", l + 1), casadi.SX.sym("rho", l)
    beta = [z[l] + angle for angle in angles]
    v = [curve.symbolic(z[i]) - rho[i] * casadi.vertcat(casadi.cos(b), casadi.sin(b)) for i, b in enumerate(beta)]
    r = math.sqrt(l) * casadi.vertcat(*(each - sum(v[1:], v[0]) / l for each in v))
    V = sum((casadi.sumsqr(one - other) for one, other in itertools.combinations(v, 2)), casadi.SX(0.0))
    return casadi.Function("feasibility", [z, rho], [V, r, casadi.jacobian(r, z)])


def truth(curve: Curve, alpha: Array, rng: np.random.Generator) -> tuple[Array, Array, Array, Array]:
    """z, rho, rho_dot and u of a robot in motion, the range rate by differences of ranges."""
    pose, u = clear_pose(curve, alpha, rng), rng.uniform((-1.0, -2.0), (1.0, 2.0))
    rho, s = ranges_around(curve, alpha, pose, u, STEP)
    return np.append(s[2], pose[2]), rho[2], central_difference(rho, STEP), u


@given(walls, angles, seeds)
@settings(max_examples=40, deadline=None)
def test_both_are_nought_on_the_truth(curve: Curve, alpha: tuple[float, ...], seed: int) -> None:
    z, rho, rho_dot, u = truth(curve, np.array(alpha), np.random.default_rng(seed))
    V, r, _ = feasibility(curve, alpha)(z, rho)
    Q, _ = output_flow(curve, alpha)(z, rho, rho_dot, u)
    assert float(V) <= 1e-20
    assert np.abs(np.array(r)).max() <= 1e-12
    assert np.abs(np.array(Q)).max() <= 1e-7


@given(walls, angles, seeds)
@settings(max_examples=40, deadline=None)
def test_the_compiled_descent_is_what_casadi_derives(curve: Curve, alpha: tuple[float, ...], seed: int) -> None:
    rng = np.random.default_rng(seed)
    l = len(alpha)  # noqa: E741
    z, rho, rho_dot = rng.uniform(-4.0, 4.0, l + 1), rng.uniform(0.1, 5.0, l), rng.uniform(-2.0, 2.0, l)
    u, (k_V, k_Q) = rng.uniform(-2.0, 2.0, 2), rng.uniform(0.1, 10.0, 2)
    V, r, J_v = (np.array(value) for value in feasibility(curve, alpha)(z, rho))
    Q, J_q = (np.array(value) for value in output_flow(curve, alpha)(z, rho, rho_dot, u))
    gradient, H, value, squares = descent(curve.table, np.array(alpha), z, rho, rho_dot, u, (k_V, k_Q))
    size = np.abs(H).max()
    np.testing.assert_allclose(gradient, (2.0 * k_V * J_v.T @ r + k_Q * J_q.T @ Q).ravel(), rtol=0, atol=1e-11 * size)
    np.testing.assert_allclose(H, 2.0 * k_V * J_v.T @ J_v + k_Q * J_q.T @ J_q, rtol=0, atol=1e-12 * size)
    assert value == pytest.approx(float(V[0, 0]), rel=1e-12)
    assert value == pytest.approx(float((r.T @ r)[0, 0]), rel=1e-12)  # the two forms of V_rho are the same
    assert squares == pytest.approx(0.5 * float((Q.T @ Q)[0, 0]), rel=1e-12)


@given(walls, seeds)
@settings(max_examples=20, deadline=None)
def test_a_lost_ray_is_as_if_it_were_not_carried(curve: Curve, seed: int) -> None:
    rng = np.random.default_rng(seed)
    alpha, there = np.array([0.0, 1.0, 2.0, 4.0]), np.array([True, False, True, True])
    z, rho, rho_dot = rng.uniform(-4.0, 4.0, 5), rng.uniform(0.1, 5.0, 4), rng.uniform(-2.0, 2.0, 4)
    u, kept = np.array([0.5, 1.0]), np.append(there, True)
    rho[~there] = np.nan
    gradient, H, V, squares = descent(curve.table, alpha, z, rho, rho_dot, u, (2.0, 3.0))
    fewer = descent(curve.table, alpha[there], z[kept], rho[there], rho_dot[there], u, (2.0, 3.0))
    np.testing.assert_allclose(gradient[kept], fewer[0], rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(H[np.ix_(kept, kept)], fewer[1], rtol=1e-10, atol=1e-10)
    assert (V, squares) == pytest.approx(fewer[2:])
    assert gradient[1] == 0.0
    assert not H[1].any()


def test_a_step_stays_finite_whatever_it_is_given() -> None:
    alpha = np.array([-1.0, 1.0])
    for rho, rho_dot, u in (
        ((1e200, 1.0), (0.0, 0.0), (0.0, 0.0)),
        ((1.0, 1.0), (1e200, 0.0), (0.0, 0.0)),
        ((1.0, 1.0), (0.0, 0.0), (1e300, 1e300)),
        ((np.nan, np.nan), (np.nan, np.nan), (0.0, 0.0)),
    ):
        z, _, _ = corrected(
            FIELD.table, alpha, np.zeros(3), np.array(rho), np.array(rho_dot), np.array(u), (5.0, 1.0), 0.01
        )
        assert np.isfinite(z).all()
        assert np.abs(z).max() <= 0.5


def test_the_step_is_stable_where_an_explicit_one_is_not() -> None:
    """From next to a truth, at rest, with the printed gains and with far larger ones."""
    alpha = np.radians([-60.0, 60.0, 180.0])
    pose = np.array([1.0, -0.5, 1.5])
    rho, s = FIELD.ranges(pose, alpha)
    z_0, still = np.append(s, pose[2]), np.zeros(2)
    for k_V, k_Q in ((5.0, 1.0), (300.0, 300.0)):
        z = z_0 + 0.02 * np.array([1.0, -1.0, 1.0, -1.0])
        _, H, before, _ = descent(FIELD.table, alpha, z, rho, np.zeros(3), still, (k_V, k_Q))
        assert 0.01 * np.linalg.eigvalsh(H).max() > 2.0  # an explicit step of .01 s would blow up
        for _ in range(200):
            z, after, _ = corrected(FIELD.table, alpha, z, rho, np.zeros(3), still, (k_V, k_Q), 0.01)
            assert after <= before + 1e-20
            before = after
        assert after <= 1e-6


def rank(alpha: Array, z: Array, rho: Array, rho_dot: Array, u: tuple[float, float]) -> int:
    """Rank of [J_v; J_q], which is that of H."""
    _, H, _, _ = descent(FIELD.table, alpha, z, rho, rho_dot, np.array(u), (1.0, 1.0))
    return int(np.linalg.matrix_rank(H, hermitian=True))


@pytest.mark.parametrize(("u", "full"), [((0.5, 0.6), True), ((0.0, 0.0), False)])
def test_two_rays_tell_the_state_only_if_the_robot_moves(u: tuple[float, float], full: bool) -> None:
    """rank [J_v; J_q] = l + 1, which is what the proof of Proposition C.2 needs."""
    alpha, pose = (math.radians(-60.0), math.radians(60.0)), np.array([1.0, -0.5, 1.5])
    rho, s = ranges_around(FIELD, np.array(alpha), pose, np.array(u), STEP)
    assert (rank(np.array(alpha), np.append(s[2], pose[2]), rho[2], central_difference(rho, STEP), u) == 3) is full


def test_three_rays_tell_it_at_rest() -> None:
    alpha, pose = np.radians([0.0, 120.0, 240.0]), np.array([1.0, -0.5, 1.5])
    rho, s = FIELD.ranges(pose, alpha)
    assert rank(alpha, np.append(s, pose[2]), rho, np.zeros(3), (0.0, 0.0)) == 4


def test_casadi_follows_the_letters_of_the_thesis() -> None:
    """Q_i as it is printed, with R_alpha as it is printed: a transposed matrix."""
    alpha, z, rho, rho_dot, u = (-0.4, 1.1), np.array([0.3, 2.0, 0.7]), (1.2, 0.8), (0.3, -0.2), (0.5, 0.9)

    def turn(a: float) -> Array:  # R_a
        return np.array([[math.cos(a), math.sin(a)], [-math.sin(a), math.cos(a)]]).T

    e_1, e_2 = np.eye(2)
    expected = [
        FIELD.tangent(z[i]) @ turn(z[2]) @ (u[0] * e_2 + rho_dot[i] * turn(a) @ e_2 - rho[i] * u[1] * turn(a) @ e_1)
        for i, a in enumerate(alpha)
    ]
    Q, _ = output_flow(FIELD, alpha)(z, casadi.DM(rho), casadi.DM(rho_dot), casadi.DM(u))
    np.testing.assert_allclose(np.array(Q).ravel(), expected, rtol=1e-14)
