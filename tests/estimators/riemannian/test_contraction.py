"""Contraction: the linearised observer is that of its equations, and Theorem D.1 has a law."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimators.riemannian.continuous import rates
from estimators.riemannian.contraction import SasakiMetric, largest_eigenvalue, lie_derivative, linearised
from estimators.riemannian.gains import Gains
from models.manifold.constant_curvature import ConstantCurvature, sphere
from models.manifold.two_point import TwoPoint
from sim.signals import Array

WEIGHTS, STEP = (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0), 0.005


@pytest.mark.parametrize("kappa", [1.0, -1.0])
@pytest.mark.parametrize(
    ("law", "curvature"), [("constant", "minus-one"), ("constant", "plus-one"), ("printed", "matched")]
)
def test_it_is_the_derivative_of_the_observer(kappa: float, law: str, curvature: str) -> None:
    """Along a motion of (xi, eta) the rates change by [M N; P Q], and D_t b has R(xi', a) eta beside."""
    space, rng = ConstantCurvature(3, kappa), np.random.default_rng(4)
    gains = Gains(2.0, 0.7, law, curvature, kappa)  # type: ignore[arg-type]
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
    gains = Gains(math.sqrt(3.0), 0.5 * math.sqrt(3.0), "constant", "minus-one", 1.0)
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


def test_the_lie_derivative_is_symmetric() -> None:
    space, rng = sphere(2), np.random.default_rng(0)
    x = space.draw(rng)
    xi = space.exp(x, 0.3 * space.draw_vector(rng, x))
    L = lie_derivative(TwoPoint(space, x, xi), space.draw_vector(rng, xi), Gains(2.0), SasakiMetric())
    assert L.shape == (4, 4)
    assert pytest.approx(L.T) == L


@pytest.mark.parametrize("values", [(0.0, 1.0, 0.0), (1.0, 0.2, 0.5), (-1.0, -1.0, 0.0), (math.nan, 1.0, 0.0)])
def test_a_metric_that_is_not_definite_is_refused(values: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match=r"\(a, b, c\) = .*; allowed: a > 0 and a b > c\^2"):
        SasakiMetric(*values)
