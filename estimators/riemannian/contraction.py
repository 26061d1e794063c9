"""Contraction analysis of the observer (D.6): the matrix of (D.20) on spaces of constant curvature.

Two neighbouring trajectories of the observer differ by (a, b), the horizontal and the vertical part of a tangent vector
to TX. In an orthonormal frame that is transported along the trajectory

    D_t (a, b) = [M N; P Q] (a, b),
    M = -A Hess S - A' grad S (grad S)',       N = 1,       Q b = C kappa (<b, G> eta + <eta, G> b - 2 <eta, b> G),
    P a = R(eta - A G, a) eta - B H a + nabla_a Phi + C kappa (<eta, H a> eta - |eta|^2 H a)
          + C' kappa <G, a> (<eta, G> eta - |eta|^2 G),

with G = grad S, H = Hess S (D.14), A' and C' the slopes by S, Phi the force transported from x to xi and
R(X, Y) Z = kappa (<Y, Z> X - <X, Z> Y).
In the generalised Sasaki metric W = [a c; c b] > 0 the squared distance of the two changes by (a, b)' L (a, b),

    L = W [M N; P Q] + [M N; P Q]' W,

so (D.6) contracts with the rate -lambda / 2 where the largest eigenvalue lambda of W^-1 L is negative. The terms of P
and Q that are multiplied by C have the opposite sign in (D.20) as printed.

The observer (D.6) in continuous time, on spaces of constant curvature:

    xi' = eta - A G,    D_t eta = -B G + PT_{x -> xi} F + C R(eta, G),    G = grad_xi S = -log_xi x,

D_t eta = eta' + k <xi', eta> xi in the ambient space. It needs the position at every instant, so it is for known
motions, and shows the behaviour of the printed gains; ``sampled`` is for sensors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from mathnavi.estimators.riemannian.gains import IntrinsicGains
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.constant_curvature import ConstantCurvature, TwoPoint
from mathnavi.models.runge_kutta import classical_step

Instant = tuple[Array, Array]
"""position x (size,) and the force F (size,) there"""


def rates(
    space: ConstantCurvature, gains: IntrinsicGains, instant: Instant, xi: Array, eta: Array
) -> tuple[Array, Array]:
    """Rates xi' (size,) and D_t eta (size,) of the observer at xi, eta (size,), both tangent at xi (D.6)."""
    x, F = instant
    G = -space.log(xi, x)
    theta = space.norm(xi, G)
    drift = eta - gains.position(theta) * G
    curvature = gains.curved(theta) * space.curvature(xi, eta, G)
    return drift, space.transport(x, xi, F) - gains.velocity() * G + curvature


class ContinuousObserver:
    """Observer state (xi, eta), integrated by the Runge-Kutta method of order 4."""

    def __init__(self, space: ConstantCurvature, gains: IntrinsicGains, xi: Array, eta: Array) -> None:
        self._space, self._gains = space, gains
        self.xi, self.eta = space.check(xi), space.tangent(xi, eta)

    def step(self, h: float, begin: Instant, middle: Instant, end: Instant) -> None:
        """Integrate over h [s], in which the system moves from ``begin`` through ``middle`` to ``end``."""
        instants = {0.0: begin, 0.5: middle, 1.0: end}
        z = np.stack([self.xi, self.eta])
        xi, eta = classical_step(lambda z, c: self._slope(instants[c], z), z, h)
        self.xi = self._space.project(xi)
        self.eta = self._space.tangent(self.xi, eta)

    def _slope(self, instant: Instant, z: Array) -> Array:
        """Ambient slope at a stage z that is near the tangent bundle."""
        xi = self._space.project(z[0])
        eta = self._space.tangent(xi, z[1])
        drift, turned = rates(self._space, self._gains, instant, xi, eta)
        normal = self._space.kappa * self._space.inner(xi, drift, eta)
        return np.stack([drift, turned - normal * xi])


@dataclass(frozen=True)
class SasakiMetric:
    """Generalised Sasaki metric W = [a c; c b].

    Raises ArgumentError unless it is positive definite.
    """

    a: float = 1.0
    b: float = 0.33
    c: float = -0.5

    def __post_init__(self) -> None:
        values = (self.a, self.b, self.c)
        if not (all(map(math.isfinite, values)) and self.a > 0.0 and self.a * self.b > self.c**2):
            raise ArgumentError(f"(a, b, c) = {values!r}; allowed: a > 0 and a b > c^2")

    def matrix(self, n: int) -> Array:
        """Matrix (2 n, 2 n) of the metric in an orthonormal frame."""
        return np.kron(np.array([[self.a, self.c], [self.c, self.b]]), np.eye(n))


def linearised(pair: TwoPoint, eta: Array, gains: IntrinsicGains, force: Array | None = None) -> Array:
    """Matrix [M N; P Q] (2 n, 2 n) in ``frame(xi)`` for the observer at (xi, eta (size,)), with a ``force`` (size,) at
    x if any.
    """
    space, n, kappa = pair.space, pair.space.dimension, pair.space.kappa
    frame = space.frame(pair.xi)
    G, rate = space.components(pair.xi, pair.at_xi), space.components(pair.xi, eta)
    H = np.stack([space.components(pair.xi, pair.hessian(column)) for column in frame.T], axis=1)
    A, B, C = gains.position(pair.theta), gains.velocity(), gains.curved(pair.theta)
    drift = rate - A * G
    M = -A * H - gains.position_slope(pair.theta) * np.outer(G, G)
    P = kappa * (np.outer(drift, rate) - (drift @ rate) * np.eye(n)) - B * H
    P += C * kappa * (np.outer(rate, rate) - (rate @ rate) * np.eye(n)) @ H
    P += gains.curved_slope(pair.theta) * kappa * np.outer((rate @ G) * rate - (rate @ rate) * G, G)
    Q = C * kappa * (np.outer(rate, G) + (rate @ G) * np.eye(n) - 2.0 * np.outer(G, rate))
    if force is not None:
        P += _transported_along_xi(pair, force, frame)
    return np.block([[M, np.eye(n)], [P, Q]])


def lie_derivative(
    pair: TwoPoint, eta: Array, gains: IntrinsicGains, metric: SasakiMetric, force: Array | None = None
) -> Array:
    """Lie derivative L (2 n, 2 n) of the metric, (D.20), in ``frame(xi)``, at eta (size,) with a ``force`` (size,) at x
    if any.
    """
    W, J = metric.matrix(pair.space.dimension), linearised(pair, eta, gains, force)
    half: Array = W @ J
    return half + half.T


def largest_eigenvalue(
    pair: TwoPoint, eta: Array, gains: IntrinsicGains, metric: SasakiMetric, force: Array | None = None
) -> float:
    """Largest eigenvalue [1/s] of W^-1 L (2 n, 2 n) at eta (size,): negative where the observer is a strict
    contraction.
    """
    L = lie_derivative(pair, eta, gains, metric, force)
    return float(eigh(L, metric.matrix(pair.space.dimension), eigvals_only=True)[-1])


def _transported_along_xi(pair: TwoPoint, force: Array, frame: Array) -> Array:
    """Derivative nabla_a Phi (n, n): Phi is K' F, so it changes by K_|beta applied to F (D.18), taken at xi."""
    space = pair.space
    columns = []
    for a in frame.T:
        slope = [space.inner(pair.x, force, pair.transport_along_xi(w, a)) for w in frame.T]
        columns.append(slope)
    return np.array(columns).T
