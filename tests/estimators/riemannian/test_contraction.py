"""Contraction: the linearised observer is that of its equations, and Theorem D.1 has a law."""

from __future__ import annotations

import math

import casadi
import numpy as np
import pytest
from scipy.linalg import eigh

from mathnavi.estimators.riemannian.contraction import (
    SasakiMetric,
    largest_eigenvalue,
    linearised,
    rates,
)
from mathnavi.estimators.riemannian.gains import CurvatureName, IntrinsicGains
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.constant_curvature import ConstantCurvature, TwoPoint, sphere
from mathnavi.models.manifold.tangent_bundle import TangentBundle
from mathnavi.models.manifold.tangent_bundle import lie_derivative as lie_derivative_of

WEIGHTS, STEP = (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0), 0.005


@pytest.mark.parametrize("kappa", [1.0, -1.0])
@pytest.mark.parametrize(
    ("law", "curvature"), [("constant", "minus-one"), ("constant", "plus-one"), ("printed", "matched")]
)
def test_it_is_the_derivative_of_the_observer(kappa: float, law: str, curvature: str) -> None:
    """Along a motion of (xi, eta) the rates change by [M N; P Q], and D_t b has R(xi', a) eta beside."""
    space, rng = ConstantCurvature(3, kappa), np.random.default_rng(4)
    gains = IntrinsicGains(2.0, 0.7, law, curvature, kappa)  # type: ignore[arg-type]
    x = space.draw(rng)
    xi = space.exp(x, 0.8 * space.draw_vector(rng, x))
    eta, F = 1.7 * space.draw_vector(rng, xi), 2.0 * space.draw_vector(rng, x)
    a, b = rng.standard_normal(3), rng.standard_normal(3)
    along, up = space.vector(xi, a), space.vector(xi, b)

    def at(h: float) -> Array:
        there = space.exp(xi, h * along)
        found = rates(space, gains, (x, F), there, space.transport(xi, there, eta + h * up))
        return np.stack([space.transport(there, xi, w) for w in found])

    slopes = sum(c * (at((k + 1) * STEP) - at(-(k + 1) * STEP)) for k, c in enumerate(WEIGHTS)) / STEP
    drift, _ = rates(space, gains, (x, F), xi, eta)
    bent = kappa * (space.inner(xi, along, eta) * drift - space.inner(xi, drift, eta) * along)
    expected = np.concatenate([space.components(xi, slopes[0]), space.components(xi, slopes[1] + bent)])
    J = linearised(TwoPoint(space, x, xi), eta, gains, F)
    assert J @ np.concatenate([a, b]) == pytest.approx(expected, abs=1e-8)


def on_sphere(theta: float, speed: float, angle: float) -> float:
    space = sphere(3)
    xi = space.origin
    x = space.exp(xi, space.vector(xi, np.array([theta, 0.0, 0.0])))
    eta = space.vector(xi, speed * np.array([math.cos(angle), math.sin(angle), 0.0]))
    gains = IntrinsicGains(math.sqrt(3.0), 0.5 * math.sqrt(3.0), "constant", "minus-one", 1.0)
    return largest_eigenvalue(TwoPoint(space, x, xi), eta, gains, SasakiMetric())


def test_on_the_truth_it_contracts_however_fast() -> None:
    for speed in (0.0, 1.0, 100.0):
        assert on_sphere(1e-9, speed, 1.0) == pytest.approx(-2.965, abs=1e-3)


@pytest.mark.parametrize("theta", [0.01, 0.03, 0.1])
def test_beside_it_only_below_a_speed(theta: float) -> None:
    """|eta| theta = .905 at the boundary."""
    angles = np.linspace(0.0, math.pi, 33)
    assert max(on_sphere(theta, 0.88 / theta, angle) for angle in angles) < 0.0
    assert max(on_sphere(theta, 0.93 / theta, angle) for angle in angles) > 0.0


@pytest.mark.parametrize("kappa", [1.0, -1.0])
@pytest.mark.parametrize("curvature", ["minus-one", "none", "plus-one"])
def test_it_is_the_lie_derivative_of_the_sasaki_metric(kappa: float, curvature: CurvatureName) -> None:
    """L_X of the metric on TX along the field X of (D.6), in a stereographic chart, has the same eigenvalues."""
    rng, gains, metric = (
        np.random.default_rng(3),
        IntrinsicGains(2.0, 0.7, "constant", curvature, kappa),
        SasakiMetric(),
    )
    space = ConstantCurvature(2, kappa)
    x = space.draw(rng)
    z, v = rng.uniform(-0.4, 0.4, 2), rng.standard_normal(2)
    bundle = TangentBundle(2, lambda z: 4.0 / (1.0 + kappa * casadi.sumsqr(z)) ** 2 * casadi.SX.eye(2))
    at, rate = casadi.SX.sym("z", 2), casadi.SX.sym("v", 2)
    G = bundle.sasaki(metric.a, metric.b, metric.c)
    L = lie_derivative_of(lambda z, v: observer_in_chart(bundle, space, gains, x, z, v), G, at, rate)
    point, slope = on_chart(kappa, at)
    evaluated = casadi.Function("at", [at, rate], [L, G(at, rate), point, slope @ rate])(z, v)
    found, W, xi, eta = (np.array(each).squeeze() for each in evaluated)
    expected = largest_eigenvalue(TwoPoint(space, x, xi), eta, gains, metric)
    assert eigh(found, W, eigvals_only=True)[-1] == pytest.approx(expected, rel=1e-9)


def on_chart(kappa: float, z: casadi.SX) -> tuple[casadi.SX, casadi.SX]:
    """The ambient point at z, seen from the point opposite the origin, and its derivative."""
    square = kappa * casadi.sumsqr(z)
    point = casadi.vertcat(1.0 - square, 2.0 * z) / (1.0 + square)
    return point, casadi.jacobian(point, z)


def observer_in_chart(
    bundle: TangentBundle, space: ConstantCurvature, gains: IntrinsicGains, x: Array, z: casadi.SX, v: casadi.SX
) -> casadi.SX:
    """(z', v') of (D.6) without a force."""
    kappa, (point, slope) = space.kappa, on_chart(space.kappa, z)
    signs = casadi.diag(casadi.DM([kappa, 1.0, 1.0]))
    cosine = kappa * casadi.dot(point, signs @ x)
    theta = casadi.acos(cosine) if kappa > 0.0 else casadi.acosh(cosine)
    G = -theta / (casadi.sin(theta) if kappa > 0.0 else casadi.sinh(theta)) * (x - cosine * point)
    eta = slope @ v
    turn = kappa * (casadi.dot(eta, signs @ G) * eta - casadi.dot(eta, signs @ eta) * G)
    into = casadi.solve(bundle.metric(z), slope.T @ signs)  # the components in the chart of a tangent vector
    moved = into @ (eta - gains.position(0.0) * G)
    turned = into @ (-gains.velocity() * G + gains.curved(0.0) * turn)
    return casadi.vertcat(moved, turned - bundle.christoffel(z, moved, v))


@pytest.mark.parametrize("values", [(0.0, 1.0, 0.0), (1.0, 0.2, 0.5), (-1.0, -1.0, 0.0), (math.nan, 1.0, 0.0)])
def test_a_metric_that_is_not_definite_is_refused(values: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match=r"\(a, b, c\) = .*; allowed: a > 0 and a b > c\^2"):
        SasakiMetric(*values)
