"""The identities (D.3) to (D.19) and (D.25), tested at drawn points.

Derivatives are taken along geodesics, by central differences of order 6: a vector at a nearby point is transported back
before it is compared. So the tests do not use the closed forms under test. Third derivatives of S are differences of
differences.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mathnavi.estimators.riemannian.contraction import rates
from mathnavi.estimators.riemannian.gains import IntrinsicGains
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.constant_curvature import ConstantCurvature, TwoPoint

STEP = 0.01  # [-] between the points of a difference
FINE = 0.001  # [s] likewise, along the motion of system and observer
OUTER = 0.012  # likewise, of differences of differences
FARTHEST = 2.0  # [-] between x and xi
_WEIGHTS = (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0)
_GAINS = IntrinsicGains(2.0, 0.8, "constant", "matched")


def residuals(seed: int, n: int, kappa: float) -> dict[str, float]:
    """A job: by equation, largest component of its left side less its right; "printed" are those of the thesis.

    The pair of points, in a space of dimension ``n`` and constant curvature ``kappa``, is drawn from ``seed``.
    """
    space, rng = ConstantCurvature(n, kappa), np.random.default_rng(seed)
    x = space.draw(rng)
    xi = space.exp(x, rng.uniform(0.05, FARTHEST) * space.draw_vector(rng, x))
    tried = _Tried(space, x, xi)
    u, w, y = (space.draw_vector(rng, xi) for _ in range(3))
    a, b = space.draw_vector(rng, x), space.draw_vector(rng, x)
    pair, G, inner = tried.pair, tried.pair.at_xi, space.inner
    along_G, hessian_u = tried.hessian(xi, G), tried.hessian(xi, u)
    turned = _curvature(space, w, G, u)
    transported = tried.transport_along_x(a, b)
    third = tried.hessian_along(G, w)
    mixed_K = tried.transport_along_xi(w, hessian_u)
    second_K = tried.transport_along_xi_along(w, u, G)
    vectors = {
        "D.3": tried.transport_along_xi(w, G),
        "D.4": pair.to_x(G) + pair.at_x,
        "D.5": np.array([inner(x, pair.to_x(u), pair.to_x(w)) - inner(xi, u, w)]),
        "D.8": np.array([inner(xi, G, G) - 2.0 * pair.S, inner(x, pair.at_x, pair.at_x) - 2.0 * pair.S]),
        "D.9": along_G - G,
        "D.10": tried.mixed(G) - pair.at_x,
        "D.11": third - (tried.hessian(xi, w) - _curvature(space, G, G, w) - tried.hessian(xi, tried.hessian(xi, w))),
        "D.12": second_K - (pair.to_x(turned) - mixed_K),
        "D.12 printed": second_K - (pair.to_x(turned) + mixed_K),
        "D.13": tried.hessian_along(y, u) - tried.hessian_along(u, y) - _curvature(space, G, u, y),
        "D.14": hessian_u - pair.hessian(u),
        "D.15": tried.mixed(u) - pair.mixed(u),
        "D.18": tried.transport_along_xi(w, u) - pair.transport_along_xi(w, u),
        "D.19": transported - pair.transport_along_x(a, b),
        "D.19 printed": transported - pair.printed_transport_along_x(a, b),
        **tried.lyapunov(2.0 * a, 1.5 * u, b),
    }
    return {name: float(np.abs(value).max()) for name, value in vectors.items()}


@dataclass(frozen=True, eq=False)
class _Tried:
    """Derivatives of S and K at one pair (x, xi), by finite differences."""

    space: ConstantCurvature
    x: Array
    xi: Array

    @property
    def pair(self) -> TwoPoint:
        return TwoPoint(self.space, self.x, self.xi)

    def gradient(self, xi: Array) -> Array:
        """Return S^alpha at xi."""
        return -self.space.log(xi, self.x)

    def hessian(self, xi: Array, w: Array) -> Array:
        """Return S^alpha_|beta w^beta at xi."""
        return self._along(self.gradient, xi, w, STEP)

    def hessian_along(self, direction: Array, w: Array) -> Array:
        """Return S^alpha_|beta|gamma w^beta direction^gamma."""
        return self._along(lambda xi: self.hessian(xi, self._there(xi, w)), self.xi, direction, OUTER)

    def mixed(self, w: Array) -> Array:
        """Return S^i_|alpha w^alpha."""
        return _difference(lambda h: -self.space.log(self.x, self.space.exp(self.xi, h * w)), STEP)

    def transport_along_xi(self, w: Array, along: Array, xi: Array | None = None) -> Array:
        """Return K^i_alpha|beta w^alpha along^beta at xi."""
        space, at = self.space, self.xi if xi is None else xi

        def carried(h: float) -> Array:
            there = space.exp(at, h * along)
            return space.transport(there, self.x, space.transport(at, there, w))

        return _difference(carried, STEP)

    def transport_along_xi_along(self, w: Array, u: Array, direction: Array) -> Array:
        """Return K^i_alpha|beta|gamma w^alpha u^beta direction^gamma."""

        def at(h: float) -> Array:
            xi = self.space.exp(self.xi, h * direction)
            return self.transport_along_xi(self._there(xi, w), self._there(xi, u), xi)

        return _difference(at, OUTER)

    def transport_along_x(self, w: Array, along: Array) -> Array:
        """Return K^j_alpha|k K^alpha_m w^m along^k."""
        at_xi = self.pair.to_xi(w)
        return self._along(lambda x: self.space.transport(self.xi, x, at_xi), self.x, along, STEP)

    def lyapunov(self, v: Array, eta: Array, F: Array) -> dict[str, Array]:
        """Return V' along the system and the observer, by finite differences, less (D.25), corrected and as printed."""
        space, pair, B = self.space, self.pair, _GAINS.velocity()
        drift, turned = rates(space, _gains(space), (self.x, F), self.xi, eta)

        def V(h: float) -> Array:  # noqa: N802
            x, xi = space.exp(self.x, h * v), space.exp(self.xi, h * drift)
            v_h = space.transport(self.x, x, v + h * F)
            eta_h = space.transport(self.xi, xi, eta + h * turned)
            error = v_h - space.transport(xi, x, eta_h)
            return np.array([0.5 * space.inner(x, error, error) + 0.5 * B * space.distance(x, xi) ** 2])

        s, v_hat, inner = pair.at_x, pair.to_x(eta), space.inner
        error = v - v_hat
        cubic = inner(self.x, s, error) * inner(self.x, v_hat, error) - inner(self.x, error, error) * inner(
            self.x, s, v_hat
        )
        decay = 2.0 * _GAINS.position(pair.theta) * B * pair.S
        found = _difference(V, FINE)
        return {"D.25": found + pair.upsilon * cubic + decay, "D.25 printed": found + decay}

    def _there(self, xi: Array, w: Array) -> Array:
        return self.space.transport(self.xi, xi, w)

    def _along(self, field: Callable[[Array], Array], at: Array, w: Array, step: float) -> Array:
        """Return nabla_w of a field of tangent vectors."""
        space = self.space

        def back(h: float) -> Array:
            there = space.exp(at, h * w)
            return space.transport(there, at, field(there))

        return _difference(back, step)


def _gains(space: ConstantCurvature) -> IntrinsicGains:
    return IntrinsicGains(_GAINS.bandwidth, _GAINS.damping, "constant", "matched", space.kappa)


def _curvature(space: ConstantCurvature, a: Array, b: Array, c: Array) -> Array:
    """Return R_iota,alpha,gamma^beta a^iota b^alpha c^gamma by (D.13), of vectors at one point."""
    turned: Array = space.kappa * (space.inner(a, a, b) * c - space.inner(a, a, c) * b)
    return turned


def _difference(function: Callable[[float], Array], step: float) -> Array:
    terms = [c * (function((k + 1) * step) - function(-(k + 1) * step)) for k, c in enumerate(_WEIGHTS)]
    slope: Array = sum(terms[1:], terms[0]) / step
    return slope
